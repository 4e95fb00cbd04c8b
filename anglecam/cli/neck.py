"""`anglecam neck`: the paper's design calculations, a verb each.

Every verb prints tables, or with ``--json`` one object and nothing else; with ``--out`` it writes both the numbers and
figures. What a verb needs is imported where it is needed: python-control, for one, takes long to load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from anglecam.errors import RigError
from anglecam.io.files import json_text, write_json
from anglecam.terminal import make_folder, screen

if TYPE_CHECKING:
    from anglecam.neck_design.numbers import Numbers

app = typer.Typer(
    help="The paper's design calculations: linkage, statics, responses, design, control, sensitivities, power.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

NeckFile = Annotated[Path | None, typer.Option("--neck", metavar="NECK.yaml", help="Another neck than the paper's.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for numbers (JSON) and figures; made if missing.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables; keys end in their unit.")]
ModelFile = Annotated[
    Path | None, typer.Option("--model", metavar="MODEL.json", help="A model of `anglecam identify`.")
]
Figures = Mapping[str, Callable[[Path], None]]


@app.command()
def kinematics(
    angle: Annotated[
        list[float] | None, typer.Option("--angle", metavar="DEG", help="A wanted nod, for its command; repeatable.")
    ] = None,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Work out four-bar and turning mechanism: Table 3, limits, commands of wanted nods."""
    from anglecam.io.neck_file import read_neck
    from anglecam.neck_design.figures import kinematics_figure, turning_figure
    from anglecam.neck_design.numbers import kinematics_numbers
    from anglecam.neck_design.tables import kinematics_tables

    if any(math.isnan(a) for a in angle or ()):
        raise RigError("--angle nan: not a number")
    with _call(neck):
        made = read_neck(neck)
        numbers = kinematics_numbers(made, [math.radians(a) for a in angle or ()])
        figures: Figures = {
            "linkage": lambda path: kinematics_figure(made, path),
            "turning": lambda path: turning_figure(made, path),
        }
        _tell("kinematics", numbers, kinematics_tables, figures, out, as_json)


@app.command()
def statics(
    pretension: Annotated[
        float | None, typer.Option("--pretension", metavar="DEG", help="A pretension angle, to find neutral for.")
    ] = None,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Hold spring against weight: balance, pretension, the servo's torque."""
    from anglecam.io.neck_file import read_neck
    from anglecam.neck_design.figures import statics_figure
    from anglecam.neck_design.numbers import statics_numbers
    from anglecam.neck_design.tables import statics_tables

    with _call(neck):
        made = read_neck(neck)
        numbers = statics_numbers(made, None if pretension is None else math.radians(pretension))
        _tell("statics", numbers, statics_tables, {"statics": lambda path: statics_figure(made, path)}, out, as_json)


@app.command()
def response(
    model: ModelFile = None,
    measured: Annotated[
        Path | None,
        typer.Option("--measured", metavar="NAME.angles.csv", help="Laid over; its command, if beside it, drives."),
    ] = None,
    step: Annotated[float, typer.Option("--step", metavar="DEG", help="Height of the commanded step.")] = 22.0,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Step the paper's models and a fitted one side by side.

    Eqs. (28) and (31), SYS1 and SYS2, as in Figs. 10, 11, 14 and 15.
    """
    from anglecam.identification.export import read_model
    from anglecam.io.neck_file import read_neck
    from anglecam.neck_design.loop_figures import series_figure, step_figure
    from anglecam.neck_design.loop_numbers import response_numbers
    from anglecam.neck_design.loop_tables import response_tables
    from anglecam.neck_design.systems import driven_record, first_step, fitted_system, paper_systems, side_by_side

    with _call(neck):
        if not 0.0 < abs(step) < 180.0:
            raise ValueError(f"--step {step:g}: a step has a height, below 180°")
        made = read_neck(neck)
        systems = list(paper_systems(made.large_angle))
        if model is not None:
            systems.append(fitted_system(read_model(model)))
        height = math.radians(step)
        record = None if measured is None else driven_record(measured)
        beside = None if measured is None or record is not None else first_step(measured)
        runs = side_by_side(systems, record)
        figures: Figures = {
            "step": lambda path: step_figure(systems, height, beside, path),
            "series": lambda path: series_figure(runs, path),
        }
        numbers = response_numbers(systems, height, runs.rmse, made.parameters)
        _tell("response", numbers, response_tables, figures, out, as_json)


@app.command()
def design(
    a: Annotated[float | None, typer.Option("--a", metavar="1/S", help="Identified; SYS1's by default.")] = None,
    b: Annotated[float | None, typer.Option("--b", metavar="1/S²")] = None,
    c: Annotated[float | None, typer.Option("--c", metavar="1/S²")] = None,
    sigma: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--sigma", metavar="A B C", help="Standard uncertainties of a, b and c."),
    ] = None,
    model: ModelFile = None,
    wish_rise: Annotated[float | None, typer.Option("--wish-rise", metavar="S", help="Wanted rise time.")] = None,
    wish_overshoot: Annotated[float | None, typer.Option("--wish-overshoot", metavar="PERCENT")] = None,
    wish_up: Annotated[float | None, typer.Option("--wish-up", metavar="DEG", help="Wanted range upwards.")] = None,
    wish_down: Annotated[float | None, typer.Option("--wish-down", metavar="DEG")] = None,
    wish_torque: Annotated[
        float | None, typer.Option("--wish-torque", metavar="N·M", help="Stall torque that has to do.")
    ] = None,
    free: Annotated[
        str, typer.Option("--free", metavar="NAMES", help="What a wish may change: K L_6 h G_a C K_m R_a L_2 K_d.")
    ] = "K,L_6,h,G_a,K_d",
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Follow the design procedure: motion to neck, wish to neck.

    From a, b, c to what the neck is made of, and from a wish to another neck.
    """
    from anglecam.io.neck_file import read_neck
    from anglecam.neck.linear import linear_neck
    from anglecam.neck.pd_tuning import ADULT
    from anglecam.neck.synthesis import Wish, synthesise
    from anglecam.neck_design.loop_figures import design_figure, synthesis_figure
    from anglecam.neck_design.loop_numbers import design_numbers
    from anglecam.neck_design.loop_tables import contradictions, design_tables
    from anglecam.neck_design.procedure import explain, identified_motion, routes_of, wish_of

    with _call(neck):
        made = read_neck(neck)
        found = identified_motion((a, b, c), sigma, model, made.parameters.servo.command_gain)
        routes = routes_of(found, made.beforehand)
        explained = explain(routes, made.example)
        start = explained or made.example
        wanted = wish_of(wish_rise, wish_overshoot, wish_up, wish_down, wish_torque)
        names = tuple(free.replace(",", " ").split())
        synthesis = None if wanted is None else synthesise(wanted, start, names)
        reach = wanted or Wish(ADULT)
        numbers = design_numbers(found, routes, explained, synthesis, made.parameters, max(reach.up, reach.down))
        figures: dict[str, Callable[[Path], None]] = {"design": lambda path: design_figure(found, routes, path)}
        if synthesis is not None:
            figures["synthesis"] = lambda path: synthesis_figure(synthesis, linear_neck(start), path)
        _tell("design", numbers, design_tables, figures, out, as_json, contradictions(numbers))


@app.command()
def pd(
    model: ModelFile = None,
    proportional: Annotated[list[float] | None, typer.Option("--kp", metavar="NUMBER", help="K_p; repeatable.")] = None,
    derivative: Annotated[list[float] | None, typer.Option("--kd", metavar="NUMBER", help="K_d; repeatable.")] = None,
    tune: Annotated[bool, typer.Option("--tune", help="Find gains for a human-like nod, the paper's adult.")] = False,
    like: Annotated[
        Path | None, typer.Option("--like", metavar="NAME.responses.json", help="Tune to this measured nod.")
    ] = None,
    rise: Annotated[float | None, typer.Option("--rise", metavar="S", help="Tune to this rise time.")] = None,
    overshoot: Annotated[float | None, typer.Option("--overshoot", metavar="PERCENT")] = None,
    loss: Annotated[
        float, typer.Option("--loss", metavar="PERCENT", help="Of the steady state that tuned gains may take away.")
    ] = 5.0,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Close a PD loop and tune it: responses, margins, gains.

    Eq. (37) and Fig. 16: of SYS2, of a fitted model, or with --neck of that neck.
    """
    from anglecam.io.neck_file import read_neck
    from anglecam.neck.pd import PdGains, close_loop, gains_table
    from anglecam.neck.pd_tuning import tune_pd
    from anglecam.neck_design.demand import saturation_notes
    from anglecam.neck_design.loop_figures import pd_figure, tuning_figure
    from anglecam.neck_design.loop_numbers import pd_numbers
    from anglecam.neck_design.loop_tables import pd_tables
    from anglecam.neck_design.procedure import chosen_plant, default_gains, simulated_loop, wanted_nod

    with _call(neck):
        if model is not None and neck is not None:
            raise ValueError("--model and --neck are two plants: give one of them")
        if not all(math.isfinite(gain) for gain in [*(proportional or ()), *(derivative or ())]):
            raise ValueError("--kp and --kd: a gain is a finite number")
        made = None if neck is None else read_neck(neck)
        chosen = chosen_plant(model, made)
        plant = chosen.transfer
        K_p, K_d = default_gains(plant)
        loops = gains_table(plant, proportional or K_p, derivative or K_d)
        figures: dict[str, Callable[[Path], None]] = {"pd": lambda path: pd_figure(loops, chosen, path)}
        tuned = simulated = None
        notes: list[str] = []
        nod = wanted_nod(tune, like, rise, overshoot)
        if nod is not None:
            tuned = tune_pd(plant, nod, largest_loss=loss / 100.0)
            notes += tuned.unmet
            if made is not None:
                try:
                    simulated = simulated_loop(made.large_angle, tuned.loop)
                    asked = made.parameters.servo.amplifier_gain * float(simulated.voltage[0])
                    notes += saturation_notes(asked, "at the step's start: Eq. (31) has no such limit")
                except ValueError as refusal:
                    notes.append(f"at large angles, Eq. (31): {refusal}")
            alone = close_loop(plant, PdGains())
            figures["tuned"] = lambda path: tuning_figure(alone, tuned, simulated, path)
        numbers = pd_numbers(chosen, loops, tuned, simulated)
        _tell("pd", numbers, pd_tables, figures, out, as_json, notes)


@app.command()
def sensitivity(neck: NeckFile = None, out: Out = None, as_json: Json = False) -> None:
    """Vary what the neck is made of, and see the response move.

    Fig. 9 a-f and normalised sensitivities.
    """
    from anglecam.io.neck_file import read_neck
    from anglecam.neck.sensitivity import figure_9, sensitivities
    from anglecam.neck_design.figures import sensitivity_figure
    from anglecam.neck_design.numbers import sensitivity_numbers
    from anglecam.neck_design.tables import sensitivity_tables

    with _call(neck):
        parameters = read_neck(neck).parameters
        figure = figure_9(parameters)
        numbers = sensitivity_numbers(sensitivities(parameters), figure)
        figures: Figures = {"sensitivity": lambda path: sensitivity_figure(figure, path)}
        _tell("sensitivity", numbers, sensitivity_tables, figures, out, as_json)


@app.command()
def power(
    log: Annotated[Path, typer.Argument(metavar="LOG.csv", help="time_s,voltage_v,current_a at a servo's terminals.")],
    nod: Annotated[
        list[str] | None, typer.Option("--nod", metavar="START:END", help="When it nodded, s; found if not given.")
    ] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure each nod's energy and power, and the supply's sag.

    As in Figs. 12 and 13.
    """
    from anglecam.io.power_csv import read_power_log
    from anglecam.neck.power import power_use
    from anglecam.neck_design.figures import power_figure
    from anglecam.neck_design.numbers import power_numbers
    from anglecam.neck_design.tables import power_tables

    spans = [_span(text) for text in nod or ()]
    read = read_power_log(log)
    use = power_use(read, spans or None)
    figures: Figures = {"power": lambda path: power_figure(read, use, path)}
    _tell("power", power_numbers(use), power_tables, figures, out, as_json)


def _tell(
    verb: str,
    numbers: Numbers,
    tables: Callable[[Numbers], list[Table]],
    figures: Figures,
    out: Path | None,
    as_json: bool,
    notes: Sequence[str] = (),
) -> None:
    """Print what was worked out and, where asked for, write it with its figures."""
    from anglecam.neck_design.numbers import without_dust

    numbers = without_dust(numbers)
    if out is not None:
        make_folder(out)
    if as_json:
        print(json_text(numbers))
    else:
        for made in tables(numbers):
            screen.print(made)
        for note in [*numbers.get("notes", ()), *notes]:
            screen.print(note, soft_wrap=True, highlight=False, markup=False)
    if out is not None:
        write_json(out / f"{verb}.json", numbers)
        for name, draw in figures.items():
            draw(out / f"{name}.png")


@contextmanager
def _call(neck: Path | None) -> Iterator[None]:
    """Turn what a calculation refuses into a fault of the call or of the neck file."""
    try:
        yield
    except ValueError as refusal:
        raise RigError(f"{neck or 'anglecam neck'}: {refusal}") from refusal


def _span(text: str) -> tuple[float, float]:
    try:
        start, end = (float(part) for part in text.split(":"))
    except ValueError:
        raise RigError(f"--nod {text}: say when it began and ended, such as 1.0:1.6") from None
    return start, end
