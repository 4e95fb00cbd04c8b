"""One clip through the workflow: opened once, measured, written."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.errors import InputError
from anglecam.io.netcdf_parquet import Also, read_netcdf
from anglecam.workflow.clip import measure_source, open_source, write_clip_overlay, write_measurement
from support.films import SWING


def test_all_results_of_a_clip_come_from_one_open_film(films, tmp_path, monkeypatch):
    clip, opened = films.film(SWING), []
    real = __import__("anglecam.video.container", fromlist=["av"]).av.open

    def counted(file, *arguments, **options):
        opened.append(str(file))
        return real(file, *arguments, **options)

    monkeypatch.setattr("anglecam.video.container.av.open", counted)
    source = open_source(clip)
    measurement = measure_source(source)
    write_measurement(measurement, source.command, tmp_path, [Also.netcdf])
    write_clip_overlay(source, measurement, tmp_path)
    # once for what the container declares, once for decoding; the pictures of a short film are then in memory
    assert sum("swing.avi" in name for name in opened) == 2
    names = {path.name for path in tmp_path.iterdir()}
    assert {"swing.angles.csv", "swing.angles.nc", "swing.png", "swing.overlay.mp4"} <= names
    np.testing.assert_array_equal(read_netcdf(tmp_path / "swing.angles.nc").angle, measurement.series.angle)


def test_a_series_of_angles_is_not_measured(tmp_path):
    path = tmp_path / "a.angles.csv"
    path.write_text("time_s,angle_deg\n0,1\n")
    with pytest.raises(InputError, match="holds angles already"):
        open_source(path)
