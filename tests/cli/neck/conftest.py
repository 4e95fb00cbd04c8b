"""`anglecam neck` as a user calls it, in the process of the test, and a fitted model for it."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from anglecam.cli import app as cli
from anglecam.io.files import write_json


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command line in this process: exit status, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["anglecam", "neck", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    return call


@pytest.fixture
def numbers(run):
    def call(*arguments):
        status, out, err = run(*arguments, "--json")
        assert (status, err) == (0, "")
        return json.loads(out)

    return call


@pytest.fixture
def model_file(tmp_path):
    """Return a model.json of SYS1 with correlated uncertainties."""
    names = ("a_per_s", "b_per_s2", "c_per_s2")
    covariance = np.array([[1.0, 8.0, 9.0], [8.0, 100.0, 110.0], [9.0, 110.0, 144.0]])
    values = (25.9786, 523.7292, 507.5597)
    sigmas = np.sqrt(np.diag(covariance))
    parameters = {n: {"value": v, "sigma": s} for n, v, s in zip(names, values, sigmas, strict=True)}
    path = tmp_path / "model.json"
    result = {"estimator": "oe2", "parameters": parameters, "covariance": {"names": names, "matrix": covariance}}
    write_json(path, result)
    return path
