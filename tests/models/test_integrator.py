"""The integrator is compiled once for all processes, and again when the ledger changes."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from anglecam.models import integrator
from anglecam.models.plant import Plant

RUN = "Plant(driven=False).predict(np.array([26.0, 524.0]), np.arange(9) / 30, None, np.array([0.1, 0.0]))"
ELSEWHERE = f"""
import numpy as np
from anglecam.models.integrator import integrate
from anglecam.models.plant import Plant
{RUN}
print(sum(integrate.stats.cache_hits.values()), sum(integrate.stats.cache_misses.values()))
"""


def test_another_process_finds_the_compiled_integrator():
    eval(RUN, {"np": np, "Plant": Plant})
    said = subprocess.run([sys.executable, "-c", ELSEWHERE], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["1", "0"]


def test_the_cache_key_of_the_compiled_integrator_changes_with_the_source_of_an_effect(tmp_path):
    (tmp_path / "drag.py").write_text("one")
    before = integrator.hash_of_sources(tmp_path)
    (tmp_path / "drag.py").write_text("two")
    assert integrator.hash_of_sources(tmp_path) != before
    (enclosed,) = (cell.cell_contents for cell in integrator.integrate.py_func.__closure__ or ())
    assert enclosed == integrator.SOURCES
