"""The figures of `anglecam neck`: they draw what was worked out, name their units, and no legend hides a curve."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest

from anglecam.io.neck_file import read_neck
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER
from anglecam.neck.pd import PdGains, close_loop, gains_table, sys2
from anglecam.neck.pd_tuning import Nod, tune_pd
from anglecam.neck.power import PowerLog, power_use
from anglecam.neck.sensitivity import figure_9
from anglecam.neck.synthesis import Wish, synthesise
from anglecam.neck_design import figures as neck_figures
from anglecam.neck_design import loop_figures as neck_loop_figures
from anglecam.neck_design import procedure
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
    neck_figures.power_figure(log, power_use(log), path)


def draw_response(path):
    neck_loop_figures.step_figure(paper_systems(NECK.large_angle), STEP, None, path)


def draw_series(path):
    neck_loop_figures.series_figure(side_by_side(paper_systems(NECK.large_angle)), path)


def draw_design(path):
    found = procedure.identified_motion((26.0, 524.0, 508.0), (1.0, 10.0, 12.0), None, 1.0)
    neck_loop_figures.design_figure(found, procedure.routes_of(found, NECK.beforehand), path)


def draw_synthesis(path):
    made = synthesise(Wish(Nod(0.15, 0.02)), free=("K", "C"))
    neck_loop_figures.synthesis_figure(made, linear_neck(PAPER), path)


def draw_tuned(path):
    loop = close_loop(sys2(), PdGains())
    neck_loop_figures.tuning_figure(loop, tune_pd(sys2(), Nod(0.3, 0.0)), None, path)


DRAWN = {
    "linkage": lambda path: neck_figures.kinematics_figure(NECK, path),
    "turning": lambda path: neck_figures.turning_figure(NECK, path),
    "statics": lambda path: neck_figures.statics_figure(NECK, path),
    "sensitivity": lambda path: neck_figures.sensitivity_figure(figure_9(), path),
    "power": draw_power,
    "step": draw_response,
    "series": draw_series,
    "design": draw_design,
    "synthesis": draw_synthesis,
    "pd": lambda path: neck_loop_figures.pd_figure(gains_table(sys2()), procedure.chosen_plant(None, None), path),
    "tuned": draw_tuned,
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
def test_it_is_wide_enough_and_its_axes_name_their_units(figures, name):
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


def test_the_step_shows_each_model_at_its_rest(figures):
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


def test_the_tuned_curve_rises_as_was_wanted(figures):
    (axes,) = figures[1]["tuned"].axes
    tuned = axes.get_lines()[-1]
    assert tuned.get_label() == "tuned"
    low, high = (np.interp(share, tuned.get_ydata(), tuned.get_xdata()) for share in (10.0, 90.0))
    assert high - low == pytest.approx(0.3, rel=0.025)


def test_an_unstable_curve_is_told(figures):
    texts = [text.get_text() for text in figures[1]["sensitivity"].axes[2].get_legend().get_texts()]
    assert "1000 V/V, unstable" in texts
    assert all(math.isfinite(limit) for limit in figures[1]["sensitivity"].axes[2].get_ylim())
