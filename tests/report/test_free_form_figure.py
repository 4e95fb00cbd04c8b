"""The colours of a missing torque are not set by one extreme value, and their scale says so."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np

from anglecam.loop.free_form.band import Band
from anglecam.report.free_form_figure import free_form_figures

SCALE = "scale of 98 % of the time"


def figures(acceleration):
    """Return the figures of a torque over angle and velocity at points that are visited equally long."""
    n = len(acceleration)
    points = (np.linspace(-0.2, 0.2, n), np.linspace(-1.0, 1.0, n))
    band = Band(("angle", "velocity"), points, np.radians(acceleration), np.full(n, 0.01), np.full(n, 1.0 / n))
    return free_form_figures(SimpleNamespace(band=band))


def ticks(svg):
    """Return the numbers at the scale of colours, the figure's second pair of axes."""
    scale = svg[svg.index('id="axes_2"') :].replace("\N{MINUS SIGN}", "-")
    return [float(number) for number in re.findall(r">(-?[0-9.]+)</text>", scale)]


def test_one_extreme_value_does_not_set_the_scale_which_says_of_how_much_of_the_time_it_is():
    values = np.linspace(-10.0, 10.0, 200)
    torque, _ = figures(np.append(values, 1000.0))
    assert SCALE in torque
    assert 5.0 <= max(ticks(torque)) <= 10.0


def test_a_scale_that_holds_all_values_says_nothing():
    torque, band = figures(np.tile([-10.0, 10.0], 100))
    assert SCALE not in torque
    assert SCALE not in band
    assert max(ticks(torque)) == 10.0
