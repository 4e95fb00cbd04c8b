"""The figures of `anglecam neck`: they draw the results, name their units, and no legend hides a curve."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest

from anglecam.io.neck_file import read_neck
from anglecam.neck.pd_tuning import NodTarget
from anglecam.neck.power import PowerLog, power_use
from anglecam.neck.sensitivity import figure_9
from anglecam.neck.synthesis import Wish, synthesise
from anglecam.neck_design.figures.design import design_figure, synthesis_figure
from anglecam.neck_design.figures.mechanism import linkage_figure, statics_figure, turning_figure
from anglecam.neck_design.figures.pd import pd_figure, tuning_figure
from anglecam.neck_design.figures.power import power_figure
from anglecam.neck_design.figures.response import series_figure, step_figure
from anglecam.neck_design.figures.sensitivity import sensitivity_figure
from anglecam.neck_design.procedure import chosen_plant, default_gains, identified_motion, routes_of
from anglecam.neck_design.results.design import design_of
from anglecam.neck_design.results.kinematics import kinematics_of
from anglecam.neck_design.results.pd import pd_of
from anglecam.neck_design.results.power import power_of
from anglecam.neck_design.results.response import response_of
from anglecam.neck_design.results.sensitivity import sensitivities_of
from anglecam.neck_design.results.statics import statics_of
from anglecam.neck_design.systems import STEP, paper_systems, side_by_side

NECK = read_neck(None)
UNITS = ("°", ", s", " V", ", A", ", W", "%", "N·m", "V/rad")
WITHOUT_UNIT = {"", "slope γ", "slope dφ/ds", "nod"}


def made_log():
    time = np.arange(0.0, 4.0, 0.005)
    current = np.where((time % 2.0 > 0.5) & (time % 2.0 < 1.5), 0.6, 0.02)
    return PowerLog("made", time, 6.0 - 4.17 * current + 0.01 * np.sin(40.0 * time), current)


def draw_power(path):
    log = made_log()
    power_figure(power_of(log, power_use(log)), path)


def response_result():
    systems = paper_systems(NECK.large_angle)
    return response_of(systems, STEP, side_by_side(systems))


def design_result(synthesis=None):
    found = identified_motion((26.0, 524.0, 508.0), (1.0, 10.0, 12.0), None, 1.0)
    return design_of(found, routes_of(found, NECK.known), None, synthesis)


def pd_result(target=None):
    plant = chosen_plant(None, None)
    return pd_of(plant, *default_gains(plant.transfer), target)


DRAWN = {
    "linkage": lambda path: linkage_figure(kinematics_of(NECK), path),
    "turning": lambda path: turning_figure(kinematics_of(NECK), path),
    "statics": lambda path: statics_figure(statics_of(NECK), path),
    "sensitivity": lambda path: sensitivity_figure(sensitivities_of((), figure_9()), path),
    "power": draw_power,
    "step": lambda path: step_figure(response_result(), path),
    "series": lambda path: series_figure(response_result(), path),
    "design": lambda path: design_figure(design_result(), path),
    "synthesis": lambda path: synthesis_figure(
        design_result(synthesise(Wish(NodTarget(0.15, 0.02)), free=("K", "C"))), path
    ),
    "pd": lambda path: pd_figure(pd_result(), path),
    "tuned": lambda path: tuning_figure(pd_result(NodTarget(0.3, 0.0)), path),
}


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """Every figure, kept open instead of closed."""
    folder = tmp_path_factory.mktemp("figures")
    kept = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plt, "close", lambda figure: None)
        for name, draw in DRAWN.items():
            before = set(plt.get_fignums())
            draw(folder / f"{name}.png")
            (number,) = set(plt.get_fignums()) - before
            kept[name] = plt.figure(number)
    yield folder, kept
    plt.close("all")


@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_is_wide_enough_and_its_axes_name_their_units(figures, name):
    folder, kept = figures
    height, width = plt.imread(folder / f"{name}.png").shape[:2]
    assert 850 <= width <= 1100
    assert height >= 400
    for axes in kept[name].axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert label in WITHOUT_UNIT or any(unit in label for unit in UNITS), label


@pytest.mark.parametrize("name", DRAWN)
def test_no_legend_hides_a_curve(figures, name):
    _, kept = figures
    kept[name].canvas.draw()
    for axes in kept[name].axes:
        legend = axes.get_legend()
        if legend is None:
            continue
        box = legend.get_window_extent()
        for line in axes.get_lines():
            x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
            if len(x) < 50:  # a straight line has only its ends
                continue
            points = axes.transData.transform(np.column_stack([x, y]))
            inside = (
                (points[:, 0] > box.x0) & (points[:, 0] < box.x1) & (points[:, 1] > box.y0) & (points[:, 1] < box.y1)
            )
            assert not inside.any(), line.get_label()


def test_fig_4_shows_the_links_and_the_line(figures):
    angle, gamma, mu = figures[1]["linkage"].axes
    curve, line, *marks = angle.get_lines()
    assert np.interp(135.0, curve.get_xdata(), curve.get_ydata()) == pytest.approx(46.76, abs=0.01)
    assert np.diff(line.get_ydata())[0] / np.diff(line.get_xdata())[0] == pytest.approx(-0.3566, abs=1e-4)
    assert [mark.get_ydata()[0] for mark in marks] == pytest.approx([20.89, 46.76, 70.51], abs=0.01)
    exact = gamma.get_lines()[0]
    numeric = np.gradient(curve.get_ydata(), curve.get_xdata())
    np.testing.assert_allclose(exact.get_ydata()[5:-5], numeric[5:-5], atol=1e-3)
    assert 50.0 < mu.get_lines()[0].get_ydata().min() < 55.0


def test_the_step_figure_shows_each_steady_state(figures):
    (axes,) = figures[1]["step"].axes
    ends = {line.get_label().split(",")[0]: line.get_ydata()[-1] for line in axes.get_lines()[1:]}
    assert ends == pytest.approx({"SYS1": 21.32, "small angles": 21.21, "SYS2": 23.58, "large angles": 23.80}, abs=0.02)


def test_the_design_points_lie_on_the_line_of_the_motion(figures):
    for axes in figures[1]["design"].axes:
        (line,) = (x for x in axes.get_lines() if x.get_label() == "what the motion says, ±2σ")
        for container in axes.containers:
            x, y = (float(data[0]) for data in container.lines[0].get_data())
            # the route by the motor has another inertia, c3/c, and so a line of its own
            tolerance = 0.05 * float(np.ptp(line.get_ydata()))
            assert np.interp(x, line.get_xdata(), line.get_ydata()) == pytest.approx(y, abs=tolerance)


def test_fig_16_has_a_panel_for_each_k_p_and_a_curve_for_each_k_d(figures):
    panels = figures[1]["pd"].axes
    assert [len(axes.get_lines()) for axes in panels] == [4, 4, 4, 4]
    last = [axes.get_lines()[0].get_ydata()[-1] for axes in panels]
    assert last[0] == pytest.approx(23.58, abs=0.02)
    assert last[3] == pytest.approx(23.58 * (1.0 - 0.191), abs=0.05)


def test_the_tuned_curve_has_the_wanted_rise_time(figures):
    (axes,) = figures[1]["tuned"].axes
    tuned = axes.get_lines()[-1]
    assert tuned.get_label() == "tuned"
    low, high = (np.interp(share, tuned.get_ydata(), tuned.get_xdata()) for share in (10.0, 90.0))
    assert high - low == pytest.approx(0.3, rel=0.025)


def test_the_legend_names_an_unstable_curve(figures):
    texts = [text.get_text() for text in figures[1]["sensitivity"].axes[2].get_legend().get_texts()]
    assert "1000 V/V, unstable" in texts
    assert all(math.isfinite(limit) for limit in figures[1]["sensitivity"].axes[2].get_ylim())
