"""`anglecam neck`: the paper's design calculations, a verb each.

Every verb prints tables, or with ``--json`` one JSON object and nothing else; with ``--out`` it writes the JSON and the
figures. A verb reads its files first and then imports what calculates and draws, which takes long to load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from anglecam.cli.progress import stages
from anglecam.errors import RigError
from anglecam.io.files import json_text, write_json
from anglecam.io.model_json import read_model_file
from anglecam.io.series_csv import read_series
from anglecam.prepare import prepare_kernels
from anglecam.progress import Stage
from anglecam.terminal import make_folder, screen

if TYPE_CHECKING:
    from anglecam.io.neck_file import DeclaredNeck
    from anglecam.neck_design.render import Result

app = typer.Typer(
    help="The paper's design calculations: linkage, statics, responses, design, control, sensitivities, power.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

NeckFile = Annotated[Path | None, typer.Option("--neck", metavar="NECK.yaml", help="A neck other than the paper's.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for numbers (JSON) and figures; made if missing.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables; keys end in their unit.")]
ModelFile = Annotated[
    Path | None, typer.Option("--model", metavar="MODEL.json", help="A model of `anglecam identify`.")
]
_Result = TypeVar("_Result", bound="Result")


@app.command()
def kinematics(
    angle: Annotated[
        list[float] | None,
        typer.Option("--angle", metavar="DEG", help="A wanted nod; prints its command; repeatable."),
    ] = None,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Compute four-bar and turning mechanism: Table 3, limits, commands of wanted nods."""
    if any(math.isnan(a) for a in angle or ()):
        raise RigError("--angle nan: not a number")
    with _call(neck):
        declared = _declared(neck)
        from anglecam.neck_design.figures.mechanism import linkage_figure, turning_figure
        from anglecam.neck_design.results.kinematics import kinematics_of

        result = kinematics_of(declared, [math.radians(a) for a in angle or ()])
        _show("kinematics", result, {"linkage": linkage_figure, "turning": turning_figure}, out, as_json)


@app.command()
def statics(
    pretension: Annotated[
        float | None,
        typer.Option("--pretension", metavar="DEG", help="Pretension angle; prints where the head rests."),
    ] = None,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Compare spring and weight: balance, pretension, the servo's torque."""
    with _call(neck):
        declared = _declared(neck)
        from anglecam.neck_design.figures.mechanism import statics_figure
        from anglecam.neck_design.results.statics import statics_of

        result = statics_of(declared, None if pretension is None else math.radians(pretension))
        _show("statics", result, {"statics": statics_figure}, out, as_json)


@app.command()
def response(
    model: ModelFile = None,
    measured: Annotated[
        Path | None,
        typer.Option("--measured", metavar="NAME.angles.csv", help="Drawn over the models; its command drives them."),
    ] = None,
    step: Annotated[float, typer.Option("--step", metavar="DEG", help="Height of the commanded step.")] = 22.0,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Step the paper's models and a fitted one side by side.

    The models are Eqs. (28) and (31), SYS1 and SYS2, as in Figs. 10, 11, 14 and 15.
    """
    with _call(neck):
        if not 0.0 < abs(step) < 180.0:
            raise ValueError(f"--step {step:g}: a step has a height, below 180°")
        declared = _declared(neck)
        _require_model(model)
        if measured is not None:
            read_series(measured)
        from anglecam.identification.export import read_model
        from anglecam.neck_design.figures.response import series_figure, step_figure
        from anglecam.neck_design.results.response import response_of
        from anglecam.neck_design.systems import driven_record, first_step, fitted_system, paper_systems, side_by_side

        systems = list(paper_systems(declared.large_angle))
        if model is not None:
            systems.append(fitted_system(read_model(model)))
        record = None if measured is None else driven_record(measured)
        measured_step = None if measured is None or record is not None else first_step(measured)
        runs = side_by_side(systems, record)
        result = response_of(systems, math.radians(step), runs, measured_step, declared.parameters)
        _show("response", result, {"step": step_figure, "series": series_figure}, out, as_json)


@app.command()
def design(
    a: Annotated[float | None, typer.Option("--a", metavar="1/S", help="Identified a; SYS1's by default.")] = None,
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
        float | None,
        typer.Option("--wish-torque", metavar="N·M", help="Stall torque that has to suffice."),
    ] = None,
    free: Annotated[
        str,
        typer.Option("--free", metavar="NAMES", help="A wish may change these: K L_6 h G_a C K_m R_a L_2 K_d."),
    ] = "K,L_6,h,G_a,K_d",
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Follow the design procedure: motion to neck, wish to neck.

    It computes the neck's quantities from a, b and c, and another neck from a wish.
    """
    with _call(neck):
        declared = _declared(neck)
        _require_model(model)
        from anglecam.neck.pd_tuning import ADULT
        from anglecam.neck.synthesis import Wish, synthesise
        from anglecam.neck_design.figures.design import design_figure, synthesis_figure
        from anglecam.neck_design.procedure import explain, identified_motion, routes_of, wish_of
        from anglecam.neck_design.results.design import design_of

        found = identified_motion((a, b, c), sigma, model, declared.parameters.servo.command_gain)
        routes = routes_of(found, declared.known)
        explained = explain(routes, declared.example)
        start = explained or declared.example
        wish = wish_of(wish_rise, wish_overshoot, wish_up, wish_down, wish_torque)
        free_symbols = tuple(free.replace(",", " ").split())
        synthesis = None if wish is None else synthesise(wish, start, free_symbols)
        reach = wish or Wish(ADULT)
        result = design_of(
            found,
            routes,
            explained,
            synthesis,
            start=start,
            declared=declared.parameters,
            nod=max(reach.up, reach.down),
        )
        figures = {"design": design_figure} | ({} if synthesis is None else {"synthesis": synthesis_figure})
        _show("design", result, figures, out, as_json)


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
        float, typer.Option("--loss", metavar="PERCENT", help="Largest loss of steady state by tuned gains.")
    ] = 5.0,
    neck: NeckFile = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Close a PD loop and tune it: responses, margins, gains.

    As in Eq. (37) and Fig. 16, for SYS2, for a fitted model, or with --neck for that neck.
    """
    with _call(neck):
        if model is not None and neck is not None:
            raise ValueError("--model and --neck are two plants: give one of them")
        if not all(math.isfinite(gain) for gain in [*(proportional or ()), *(derivative or ())]):
            raise ValueError("--kp and --kd: a gain is a finite number")
        declared = None if neck is None else _declared(neck)
        _require_model(model)
        from anglecam.neck_design.figures.pd import pd_figure, tuning_figure
        from anglecam.neck_design.procedure import chosen_plant, default_gains, wanted_nod
        from anglecam.neck_design.results.pd import pd_of

        plant = chosen_plant(model, declared)
        K_p, K_d = default_gains(plant.transfer)
        target = wanted_nod(tune, like, rise, overshoot)
        result = pd_of(plant, proportional or K_p, derivative or K_d, target, largest_loss=loss / 100.0, neck=declared)
        figures = {"pd": pd_figure} | ({} if target is None else {"tuned": tuning_figure})
        _show("pd", result, figures, out, as_json)


@app.command()
def sensitivity(neck: NeckFile = None, out: Out = None, as_json: Json = False) -> None:
    """Vary each quantity of the neck and compare the responses.

    It prints normalised sensitivities and draws Fig. 9 a-f.
    """
    with _call(neck):
        parameters = _declared(neck).parameters
        from anglecam.neck.sensitivity import figure_9, sensitivities
        from anglecam.neck_design.figures.sensitivity import sensitivity_figure
        from anglecam.neck_design.results.sensitivity import sensitivities_of

        figure = figure_9(parameters)
        result = sensitivities_of(sensitivities(parameters), figure)
        _show("sensitivity", result, {"sensitivity": sensitivity_figure}, out, as_json)


@app.command()
def power(
    log: Annotated[Path, typer.Argument(metavar="LOG.csv", help="time_s,voltage_v,current_a at a servo's terminals.")],
    nod: Annotated[
        list[str] | None,
        typer.Option(
            "--nod", metavar="START:END", help="Start and end of a nod, s; found from the current by default."
        ),
    ] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure each nod's energy and power, and the supply's sag.

    As in Figs. 12 and 13.
    """
    from anglecam.io.power_csv import read_power_log

    spans = [_span(text) for text in nod or ()]
    with _call(None):
        measured = read_power_log(log)
        from anglecam.neck.power import power_use
        from anglecam.neck_design.figures.power import power_figure
        from anglecam.neck_design.results.power import power_of

        result = power_of(measured, power_use(measured, spans or None))
        _show("power", result, {"power": power_figure}, out, as_json)


def _show(
    verb: str,
    result: _Result,
    figures: Mapping[str, Callable[[_Result, Path], None]],
    out: Path | None,
    as_json: bool,
) -> None:
    """Print a result as tables or JSON and, with a folder, write the JSON and the figures there."""
    from anglecam.neck_design.render import as_json as json_of
    from anglecam.neck_design.render import terminal_tables

    content = json_of(result)
    if out is not None:
        make_folder(out)
    if as_json:
        print(json_text(content))
    else:
        for table in terminal_tables(result):
            screen.print(table)
        for remark in result.remarks():
            screen.print(remark, soft_wrap=True, highlight=False, markup=False)
    if out is not None:
        write_json(out / f"{verb}.json", content)
        for name, draw in figures.items():
            draw(result, out / f"{name}.png")


@contextmanager
def _call(neck: Path | None) -> Iterator[None]:
    """Show that something is calculated, and report a ValueError as a fault of the call or of the neck file."""
    with stages() as progress:
        progress(Stage("calculating and drawing"))
        try:
            yield
        except ValueError as refusal:
            raise RigError(f"{neck or 'anglecam neck'}: {refusal}") from refusal


def _declared(neck: Path | None) -> DeclaredNeck:
    """Read a neck file before what calculates and draws is loaded; without one, the paper's neck."""
    from anglecam.io.neck_file import read_neck

    declared = read_neck(neck)
    prepare_kernels("anglecam")
    return declared


def _require_model(model: Path | None) -> None:
    """Raise `InputError` where the file of a model cannot be read."""
    if model is not None:
        read_model_file(model)


def _span(text: str) -> tuple[float, float]:
    try:
        start, end = (float(part) for part in text.split(":"))
    except ValueError:
        raise RigError(f"--nod {text}: give start and end in seconds, such as 1.0:1.6") from None
    return start, end
