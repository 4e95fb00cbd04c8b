"""A model that runs away, that is reversed or that is not determined is not exported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.identification.export import SECOND_ORDER, THIRD_ORDER, FittedModel
from anglecam.identification.simulators.usable import require_usable

FILE = Path("loop.json")


def model(values, sigmas, names=SECOND_ORDER):
    order = 3 if names is THIRD_ORDER else 2
    values, sigmas = np.array(values), np.array(sigmas)
    denominator = np.array([1.0, *values[:order]])
    return FittedModel("loop", names[: len(values)], values, np.diag(sigmas**2), values[order:], denominator)


@pytest.mark.parametrize(
    "usable",
    [
        model([26.0, 524.0, 508.0], [0.5, 4.0, 4.0]),
        model([20.0, -0.02, 35.0], [0.1, 0.03, 0.2]),  # a drive without stiffness
        model([0.05, 64.0], [0.001, 0.01]),  # a free swing
        model([0.0, 64.0], [np.nan, 0.01]),
        model([30.0, 600.0, 9000.0, 0.0, 0.0, 9000.0], [1.0] * 6, THIRD_ORDER),
    ],
)
def test_a_model_of_a_mechanism_is_usable(usable):
    require_usable(usable, FILE)


@pytest.mark.parametrize(
    ("values", "sigmas", "cause"),
    [
        ([-0.04, 94.0, 90.0], [0.01, 1.0, 1.0], "a_per_s = -0.04 ± 0.01: with negative damping"),
        ([26.0, -40.0, 508.0], [0.5, 4.0, 4.0], "b_per_s2 = -40 ± 4: with negative stiffness"),
        ([26.0, 524.0, -2570.0], [0.5, 4.0, 4.0], "c_per_s2 = -2570 ± 4: the body moves against its command"),
        ([26.0, 524.0, 508.0], [0.5, 4.0, 300.0], "c_per_s2 = 508 ± 3e+02: the recordings do not determine"),
        ([26.0, 524.0, -2570.0], [0.5, 4.0, np.nan], "c_per_s2 = -2570, not determined: the recordings do not"),
    ],
)
def test_what_is_no_mechanism_is_refused_with_its_value_and_the_cause(values, sigmas, cause):
    with pytest.raises(InputError, match=r"loop\.json: ") as refused:
        require_usable(model(values, sigmas), FILE)
    assert cause in str(refused.value)


def test_an_unstable_model_of_third_order_is_refused_with_its_pole():
    with pytest.raises(InputError, match=r"unstable: a pole at 1\.9"):
        require_usable(model([30.0, 600.0, -1300.0, 0.0, 0.0, 9000.0], [1.0] * 6, THIRD_ORDER), FILE)
