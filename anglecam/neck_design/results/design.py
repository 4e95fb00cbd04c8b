"""``anglecam neck design``: steps 3 to 6 of the design procedure, and the neck that was made to a wish."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from anglecam.neck.correlated import CorrelatedQuantities
from anglecam.neck.design import Relations
from anglecam.neck.linear import LinearNeck, linear_neck, passive_stiffness
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.step import linear_step_figures
from anglecam.neck.synthesis import Synthesis
from anglecam.neck.variation import NOD, PARAMETERS
from anglecam.neck_design.render import Facts, Layout, Lines
from anglecam.neck_design.results.constraint import ConstraintRow, constraint_row, constraint_table
from anglecam.neck_design.results.demand import ServoDemand, servo_demand
from anglecam.neck_design.results.design_quantities import UNITS, Quantities, fact, quantities
from anglecam.neck_design.results.step import VoltageStep, voltage_step
from anglecam.neck_design.text import number, quantity, with_sigma, without_remainder
from anglecam.neck_design.units import INTERNAL, OPTIONAL, Unit

TITLES = {
    "by_inertia": "known: inertia, spring, weight, C",
    "by_inertia_and_motor": "known: inertia, weight, h, motor",
    "by_motor": "known: motor, spring, weight",
}
"""Title of each route through Eqs. (34) and (35)."""


@dataclass(frozen=True)
class RouteFacts:
    """One route through Eqs. (34) and (35)."""

    route: str
    known: Quantities
    found: Quantities
    stable: bool
    """Whether Eq. (35) holds."""
    contradictions: tuple[str, ...]

    @property
    def title(self) -> str:
        """What the route takes as known."""
        return TITLES.get(self.route, self.route)

    def facts(self, *, with_known: bool) -> Facts:
        """Return the route's table."""
        known = [(f"{label} (known)", text) for label, text in (fact(n, q) for n, q in self.known.items())]
        return Facts(
            self.title,
            [
                *(known if with_known else []),
                *(fact(name, value) for name, value in self.found.items()),
                ("Eq. (35)", "holds" if self.stable else "does not hold: the neck falls from neutral"),
            ],
        )


@dataclass(frozen=True)
class Component:
    """One of the quantities that a neck consists of."""

    value: float
    unit: str
    name: str


@dataclass(frozen=True)
class Change:
    """A quantity before and after a synthesis, SI."""

    before: float
    after: float
    unit: str


@dataclass(frozen=True)
class SynthesisFacts:
    """A neck made to a wish."""

    feasible: bool
    unmet: tuple[str, ...]
    changes: Mapping[str, Change]
    """By symbol."""
    neck: Mapping[str, Component]
    """By symbol."""
    a: Annotated[float, UNITS["a"]]
    b: Annotated[float, UNITS["b"]]
    c: Annotated[float, UNITS["c"]]
    derivative_gain: Annotated[float, Unit("V_s_per_rad", "V·s/rad")]
    """K_d."""
    command_gain: Annotated[float, Unit("V_per_rad", "V/rad")]
    """C_i."""
    step: VoltageStep
    """With the controller."""
    constraints: tuple[ConstraintRow, ...]

    @property
    def title(self) -> str:
        """Whether the wish is met."""
        return "made to the wish" if self.feasible else "nearest to the wish, which cannot be met"

    def tables(self) -> list[Layout]:
        """Return the changes and the constraints."""
        lines = [
            (symbol, quantity(change.before, change.unit), quantity(without_remainder(change.after), change.unit))
            for symbol, change in self.changes.items()
        ]
        links = {symbol: self.neck[symbol] for symbol in ("L_3", "gamma")}
        lines += [(symbol, "", quantity(link.value, link.unit)) for symbol, link in links.items()]
        lines.append(("C_i", "", quantity(self.command_gain, "V/rad")))
        return [Lines((self.title, "declared", "after"), lines), constraint_table(self.constraints)]


@dataclass(frozen=True)
class DesignSources:
    """What the figures of ``anglecam neck design`` draw."""

    identified: CorrelatedQuantities
    """a, b, c."""
    routes: tuple[Relations, ...]
    synthesis: Synthesis | None
    before: LinearNeck
    """The neck that a synthesis starts from."""


@dataclass(frozen=True)
class Design:
    """Result of ``anglecam neck design``."""

    identified: Quantities
    """a, b and c."""
    step: VoltageStep
    routes: tuple[RouteFacts, ...]
    explained_neck: Mapping[str, Component] | None
    """By symbol; None where every route contradicts itself."""
    synthesis: Annotated[SynthesisFacts | None, OPTIONAL]
    demand: ServoDemand
    notes: tuple[str, ...]
    sources: Annotated[DesignSources, INTERNAL]

    def tables(self) -> list[Layout]:
        """Return the identified motion, each route, the synthesis if any, and the demand on the servo."""
        facts = [(name, f"{with_sigma(value)} {UNITS[name].symbol}") for name, value in self.identified.items()]
        facts += [("its step", str(self.step.step)), ("gain", f"{number(self.step.gain, 3)} rad/V")]
        synthesis = self.synthesis
        return [
            Facts("step 3: identified", facts),
            *(route.facts(with_known=route is self.routes[0]) for route in self.routes),
            *([] if synthesis is None else synthesis.tables()),
            Facts("the declared neck" if synthesis is None else synthesis.title, [self.demand.fact()]),
        ]

    def remarks(self) -> list[str]:
        """Return the notes, where motion and knowledge contradict each other, and what a wish cannot meet."""
        contradictions = [f"{route.title}: {line}" for route in self.routes for line in route.contradictions]
        unmet = [] if self.synthesis is None else [f"the wish: {line}" for line in self.synthesis.unmet]
        return [*self.notes, *contradictions, *unmet]


def design_of(
    found: CorrelatedQuantities,
    routes: Sequence[Relations],
    explained: NeckParameters | None,
    made: Synthesis | None,
    *,
    start: NeckParameters = PAPER,
    declared: NeckParameters = PAPER,
    nod: float = NOD,
) -> Design:
    """Return the design procedure's steps 3 to 6 and, if one was wished for, the neck made to the wish.

    Parameters
    ----------
    found : CorrelatedQuantities
        a, b, c.
    routes : sequence of Relations
        Each way through Eqs. (34) and (35).
    explained : NeckParameters or None
        The neck whose Eq. (28) is that motion.
    made : Synthesis or None
        The neck made to a wish.
    start : NeckParameters
        The neck that the synthesis started from.
    declared : NeckParameters
        The declared neck: a synthesis is compared with it, and without one its servo holds the nod.
    nod : float
        The farthest nod to be held, rad.

    Returns
    -------
    Design
        For the renderer and the figures.
    """
    a, b, c = (found[name].value for name in ("a", "b", "c"))
    holding = declared if made is None else made.neck
    at_head = abs(passive_stiffness(holding)) * nod
    demand = servo_demand(holding, nod, abs(holding.gamma) * at_head, at_head)
    return Design(
        identified=quantities(found, ("a", "b", "c")),
        step=voltage_step(linear_step_figures([c], [1.0, a, b])),
        routes=tuple(
            RouteFacts(
                route=route.route,
                known=quantities(route.quantities, route.given),
                found=quantities(route.quantities, route.found),
                stable=route.stable,
                contradictions=route.contradictions,
            )
            for route in routes
        ),
        explained_neck=None if explained is None else _components(explained),
        synthesis=None if made is None else _synthesis_facts(made, declared),
        demand=demand,
        notes=demand.notes(),
        sources=DesignSources(found, tuple(routes), made, linear_neck(start)),
    )


def _components(neck: NeckParameters) -> dict[str, Component]:
    """Return what a neck consists of, by the paper's symbols."""
    components = {symbol: Component(p.read(neck), p.unit, p.name) for symbol, p in PARAMETERS.items()}
    components["L_3"] = Component(neck.linkage.coupler, "m", "coupler")
    return components


def _synthesis_facts(made: Synthesis, declared: NeckParameters) -> SynthesisFacts:
    return SynthesisFacts(
        feasible=made.feasible,
        unmet=made.unmet,
        changes={symbol: _change(symbol, *values, declared) for symbol, values in made.changes.items()},
        neck=_components(made.neck),
        a=made.linear.a,
        b=made.linear.b,
        c=made.linear.c,
        derivative_gain=made.gains.derivative,
        command_gain=made.command_gain,
        step=voltage_step(made.figures),
        constraints=tuple(constraint_row(c) for c in made.constraints),
    )


def _change(symbol: str, before: float, after: float, declared: NeckParameters) -> Change:
    if symbol == "K_d":
        return Change(before, after, "V·s/rad")
    return Change(PARAMETERS[symbol].read(declared), after, PARAMETERS[symbol].unit)
