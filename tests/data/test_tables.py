"""A series as pandas, xarray and HTML: the numbers and units of its files; without the library, one clear line."""

from __future__ import annotations

import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from anglecam.data.series import AngleSeries
from anglecam.data.tables import html_curve, html_table
from anglecam.io.netcdf_parquet import write_netcdf
from anglecam.io.series_csv import write_series


@pytest.fixture
def series() -> AngleSeries:
    """Five frames; the third is covered."""
    gap = np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    return AngleSeries(
        "swing",
        time=np.arange(5) / 30.0,
        angle=np.array([0.0, 0.1, 0.2, 0.15, -0.1]) * gap,
        sigma=np.full(5, 1e-3) * gap,
        status=("ok", "ok", "occluded", "ok", "ok"),
        mark_px=np.arange(10.0).reshape(5, 2),
        bounds={6.0: np.full(5, 0.01), 10.0: np.full(5, 0.02), 4.0: np.full(5, 0.005)},
        first_frame=7,
    )


def test_the_pandas_table_is_the_file_without_rounding(series, tmp_path):
    write_series(series, tmp_path / "swing.angles.csv")
    table = series.to_pandas()
    pd.testing.assert_frame_equal(
        table, pd.read_csv(tmp_path / "swing.angles.csv", index_col="frame"), atol=1e-4, check_dtype=False
    )
    assert np.array_equal(np.radians(table["angle_deg"]), np.radians(np.degrees(series.angle)), equal_nan=True)
    assert list(table.index) == [7, 8, 9, 10, 11]


def test_the_dataset_has_the_variables_of_the_netcdf_file(series, tmp_path):
    write_netcdf(series, tmp_path / "swing.angles.nc")
    dataset = series.to_xarray()
    with xr.open_dataset(tmp_path / "swing.angles.nc", engine="h5netcdf") as file:
        assert set(file.variables) - {"confidence"} == set(dataset.variables) - {"frame"}
        for name in dataset.data_vars:
            xr.testing.assert_equal(file[name], dataset[name].drop_vars("frame"))
            assert file[name].attrs.get("units") == dataset[name].attrs.get("units")


@pytest.mark.parametrize(("method", "library"), [("to_pandas", "pandas"), ("to_xarray", "xarray")])
def test_a_missing_library_is_named_in_one_line(series, monkeypatch, method, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=rf"{library} is needed .*pip install {library}") as missing:
        getattr(series, method)()
    assert "\n" not in str(missing.value)


def test_neither_library_is_loaded_before_it_is_needed():
    code = "import sys, anglecam.data.series; print({'pandas', 'xarray'} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True, timeout=60) == "set()\n"


def test_the_summary_counts_frames_and_states_units(series):
    page = series._repr_html_()
    assert "4 of 5 (1 occluded)" in page
    assert "-5.73° … 8.59°" in page
    assert "0.057°" in page


def test_the_curve_has_a_gap_where_nothing_was_measured(series):
    picture = ElementTree.fromstring(html_curve(series.time, series.angle, "angle & time"))
    path = picture[0].attrib["d"]
    assert path.count("M") == 2
    assert path.count("L") == 2
    assert picture.attrib["aria-label"] == "angle & time"


def test_a_long_curve_keeps_its_extremes():
    time = np.arange(100_000) / 30.0
    values = np.zeros(100_000)
    values[54_321] = 1.0
    page = html_curve(time, values, "spike")
    assert len(page) < 20_000
    assert " 1.0" in page  # the top of the picture


def test_an_empty_series_has_a_summary_too():
    nothing = np.full(3, np.nan)
    series = AngleSeries("dark", np.arange(3.0), nothing, nothing, ("no_mouth",) * 3)
    assert "0 of 3 (3 no_mouth)" in series._repr_html_()


def test_names_cannot_add_markup():
    assert "<b>" not in html_table("<b>", ["<b>"], [["<b>"]])
