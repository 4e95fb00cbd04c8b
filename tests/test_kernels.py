"""Every kernel is declared for the types that it is called with, so that it is compiled once, and never by a call."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from anglecam.prepare import Kernels

WITH_PARTS = ("anglecam.models.",)
"""Packages in which a function that is not kept on disk is a part of the kernels that call it."""
OF_TWO_TYPES = {"_sort_upper"}
MODULES = [name for package in ("anglecam", "synth") for name in Kernels(package).modules()]


def kernels_of(module: str) -> list[Dispatcher]:
    found = [value for value in vars(import_module(module)).values() if isinstance(value, Dispatcher)]
    return [kernel for kernel in found if kernel.py_func.__module__ == module]


def test_the_modules_are_found():
    assert {"anglecam.vision.registration.turn_kernel", "anglecam.video.picture", "synth.draw.area"} <= set(MODULES)
    assert sum(len(kernels_of(module)) for module in MODULES) > 60


@pytest.mark.parametrize("module", MODULES)
def test_each_kernel_is_compiled_for_what_it_declares_and_kept(module):
    for kernel in kernels_of(module):
        if kernel.targetoptions.get("inline") == "always":  # becomes a part of its callers and is not compiled itself
            assert not kernel.signatures
            continue
        if module.startswith(WITH_PARTS) and kernel.stats.cache_path is None:
            continue
        assert not kernel._can_compile, f"{kernel} would be compiled by a call"
        assert len(kernel.signatures) == (2 if kernel.__name__ in OF_TWO_TYPES else 1)
        assert kernel.stats.cache_path, f"{kernel} is not kept on disk"


def test_a_call_with_other_types_is_an_error():
    from anglecam.vision.registration.kernels import relight

    zeros = np.zeros((1, 1))
    with pytest.raises(TypeError, match="No matching definition"):
        relight(zeros, np.array([0, 1]), zeros, zeros)  # its values are in single precision
