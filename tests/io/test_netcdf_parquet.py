"""Angle series as netCDF and Parquet: other programs read the same numbers, and anglecam reads every bit."""

from __future__ import annotations

import sys
import time
from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr
from pyarrow import parquet

from anglecam.cli import app as cli
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.derivatives import Derivatives
from anglecam.data.series import SERIES_COLUMNS as COLUMNS
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.io.netcdf_parquet import GROUP, Also, read_netcdf, write_also, write_netcdf, write_parquet
from anglecam.io.series_csv import read_series, write_series
from support.tracked import nod, write_sleap


@pytest.fixture
def series() -> AngleSeries:
    """Return fifty frames at uneven times, two of them without an angle, and a bound for a further radius."""
    rng, n = np.random.default_rng(0), 50
    status = ["ok"] * n
    status[7], status[8] = "no_mouth", "occluded"
    ok = np.array([s == "ok" for s in status])

    def there(values):
        return np.where(ok if values.ndim == 1 else ok[:, None], values, np.nan)

    return AngleSeries(
        name="nod",
        time=np.cumsum(rng.uniform(0.03, 0.04, n)),
        angle=there(rng.normal(size=n)),
        sigma=there(rng.uniform(0.001, 0.002, n)),
        status=tuple(status),
        line=there(rng.normal(size=n)),
        mark_px=there(rng.uniform(0, 600, (n, 2))),
        pivot_px=there(rng.uniform(0, 600, (n, 2))),
        bounds={r: there(np.full(n, r / 180.0)) for r in (4.0, 6.0, 10.0)},
        sigma_random=there(rng.uniform(0.0005, 0.001, n)),
        derivatives=Derivatives(*there(rng.normal(size=(n, 4))).T.copy()),
    )


EVIDENCE = CameraEvidence(
    picture_px=(640, 480),
    marker_px=(211.25, 1.0 / 3.0),
    from_mark=True,
    outline_turn=(-0.0, 5e-324),
    lamp_s=(0.1, 0.1 + 1e-17),
    only_pivot_differs=False,
)
VARIANTS = {
    "with evidence": lambda series: replace(series, evidence=EVIDENCE),
    "without evidence": lambda series: series,
    "of a clip whose name is not text": lambda series: replace(series, name="nick\udcff\udce9-é"),
    "with None in every optional field": lambda series: replace(
        series,
        line=None,
        mark_px=None,
        pivot_px=None,
        bounds={},
        sigma_random=None,
        derivatives=None,
        evidence=replace(EVIDENCE, marker_px=None),
    ),
    "with numbers that a table would round": lambda series: replace(
        series, angle=np.nextafter(series.angle, 9.0), sigma=np.full(50, -0.0), bounds={0.1 + 0.2: np.full(50, 1e-310)}
    ),
}


def bits(value):
    """Return a value such that two are equal exactly if they are equal bit for bit, NaN and the sign of 0 included."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, Derivatives):
        return bits(vars(value))
    if isinstance(value, dict):
        return [(bits(key), bits(item)) for key, item in value.items()]
    if isinstance(value, tuple):
        return [bits(item) for item in value]
    return type(value), value.hex() if isinstance(value, float) else value


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_series_comes_back_from_netcdf_bit_for_bit(series, tmp_path, variant):
    written = VARIANTS[variant](series)
    write_netcdf(written, tmp_path / "a.nc")
    back = read_netcdf(tmp_path / "a.nc")
    for field in fields(AngleSeries):
        if field.name != "evidence":
            assert bits(getattr(back, field.name)) == bits(getattr(written, field.name)), field.name
    for field in fields(CameraEvidence):
        assert bits(getattr(back.evidence, field.name)) == bits(getattr(written.evidence, field.name)), field.name


def test_two_writes_of_a_series_give_equal_bytes_at_different_times(series, tmp_path):
    written = [changed(series) for changed in VARIANTS.values()]
    for k, one in enumerate(written):
        write_netcdf(one, tmp_path / f"{k}.nc")
    time.sleep(1.1)  # HDF5 would store times of whole seconds
    for k, (name, one) in enumerate(zip(VARIANTS, written, strict=True)):
        write_netcdf(one, tmp_path / "again.nc")
        assert (tmp_path / f"{k}.nc").read_bytes() == (tmp_path / "again.nc").read_bytes(), name


@pytest.mark.parametrize("variant", VARIANTS)
def test_xarray_opens_every_variant_in_the_layout_of_movement(series, tmp_path, variant):
    written = VARIANTS[variant](series)
    write_netcdf(written, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        assert data.position.dims == ("time", "space", "keypoints", "individuals")
        assert data.attrs["ds_type"] == "poses"
        data.attrs["source_file"].encode()  # text, whatever the clip is called
        np.testing.assert_array_equal(data.angle_deg, np.degrees(written.angle))
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf", group=GROUP) as exact:
        np.testing.assert_array_equal(exact.angle, written.angle)


def test_a_series_of_one_frame_comes_back(tmp_path):
    write_netcdf(AngleSeries("a", np.zeros(1), np.zeros(1), np.zeros(1), ("ok",)), tmp_path / "a.nc")
    back = read_netcdf(tmp_path / "a.nc")
    assert (back.name, back.status, back.bounds, back.line) == ("a", ("ok",), {}, None)
    assert back.evidence == CameraEvidence()


def test_a_netcdf_file_of_another_program_is_refused_in_one_line(series, tmp_path):
    xr.Dataset({"position": ("time", np.zeros(3))}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"other\.nc: not an angle series of anglecam$"):
        read_netcdf(tmp_path / "other.nc")
    (tmp_path / "text.nc").write_text("time_s,angle_deg\n")
    with pytest.raises(OSError, match=r"."):
        read_netcdf(tmp_path / "text.nc")


def test_netcdf_has_the_dimensions_variables_and_attributes_of_movement(series, tmp_path):
    """As `movement.validators.datasets.ValidPosesInputs` requires (movement 0.15)."""
    write_netcdf(series, tmp_path / "nod.angles.nc")
    with xr.open_dataset(tmp_path / "nod.angles.nc", engine="h5netcdf") as data:
        assert data.position.dims == ("time", "space", "keypoints", "individuals")
        assert data.confidence.dims == ("time", "keypoints", "individuals")
        assert data.space.values.tolist() == ["x", "y"]
        assert data.keypoints.values.tolist() == ["mouth", "pivot"]
        assert data.sizes == {"time": 50, "space": 2, "keypoints": 2, "individuals": 1}
        assert data.attrs["ds_type"] == "poses"
        assert data.attrs["source_software"] == "anglecam"
        assert data.attrs["time_unit"] == "seconds"
        assert data.attrs["fps"] == pytest.approx(1.0 / np.median(np.diff(series.time)))
        assert data.time.dtype == np.float64  # seconds as they are, not taken for a date
        np.testing.assert_array_equal(data.time, series.time)
        mouth = data.position.sel(keypoints="mouth", individuals="head").transpose("time", "space")
        np.testing.assert_array_equal(mouth, series.mark_px)
        pivot = data.position.sel(keypoints="pivot", individuals="head", space="y")
        np.testing.assert_array_equal(pivot, series.pivot_px[:, 1])
        np.testing.assert_array_equal(data.angle_deg, np.degrees(series.angle))
        np.testing.assert_array_equal(data.sigma_deg, np.degrees(series.sigma))
        np.testing.assert_array_equal(data.bound_4px_deg, np.degrees(series.bounds[4.0]))
        assert data.angle_deg.attrs["units"] == "degree"
        assert tuple(data.status.values) == series.status


def test_parquet_has_the_columns_of_the_contract_with_units_and_nulls(series, tmp_path):
    write_parquet(series, tmp_path / "nod.angles.parquet")
    table = parquet.read_table(tmp_path / "nod.angles.parquet")
    assert tuple(table.column_names) == (*COLUMNS, "bound_4px_deg")
    units = {field.name: (field.metadata or {}).get(b"unit") for field in table.schema}
    assert (units["time_s"], units["angle_deg"], units["mouth_x_px"]) == (b"s", b"degree", b"pixel")
    assert units["frame"] is None
    assert table.column("frame").to_pylist() == list(range(50))
    assert table.column("angle_deg").null_count == 2
    assert table.column("angle_deg")[7].as_py() is None
    assert tuple(table.column("status").to_pylist()) == series.status
    write_series(series, tmp_path / "nod.angles.csv")
    back = read_series(tmp_path / "nod.angles.csv")
    np.testing.assert_allclose(table.column("angle_deg").to_numpy(), np.degrees(back.angle), atol=5.1e-7)


def test_a_series_without_marks_or_with_one_frame_is_written_too(tmp_path):
    bare = AngleSeries("bare", np.array([0.5]), np.array([0.1]), np.array([np.nan]), ("ok",))
    write_also(bare, [Also.netcdf, Also.parquet], tmp_path / "bare")
    with xr.open_dataset(tmp_path / "bare.angles.nc", engine="h5netcdf") as data:
        assert np.isnan(data.position).all()
        assert np.isnan(data.attrs["fps"])
    assert parquet.read_table(tmp_path / "bare.angles.parquet").column("sigma_deg").null_count == 1


@pytest.mark.parametrize("wanted", Also)
def test_the_same_series_gives_the_same_bytes_and_nothing_is_left_behind(series, tmp_path, wanted):
    for folder in ("once", "again"):
        write_also(series, [wanted, wanted], tmp_path / folder / "nod")
    (once,), (again,) = ((tmp_path / folder).iterdir() for folder in ("once", "again"))
    assert once.name == again.name == f"nod.angles.{'nc' if wanted is Also.netcdf else 'parquet'}"
    assert once.read_bytes() == again.read_bytes()


def test_measure_writes_both_formats_next_to_the_csv(tmp_path, monkeypatch, capsys):
    write_sleap(tmp_path / "nod.h5", nod(np.linspace(0.0, 20.0, 60), np.random.default_rng(0)))
    (tmp_path / "rig.yaml").write_text("marks: {mouth: nose, pivot: neck, rate_hz: 30}\n")
    call = ["anglecam", "measure", str(tmp_path / "nod.h5"), "--out", str(tmp_path / "out"), "--also"]
    for formats, status in ((["netcdf", "--also", "parquet"], 0), (["excel"], 2)):
        monkeypatch.setattr(sys, "argv", [*call, *formats])
        with pytest.raises(SystemExit) as left:
            cli.main()
        assert (left.value.code or 0) == status
    assert "excel" in capsys.readouterr().err
    found = {path.name for path in (tmp_path / "out").iterdir()}
    assert found == {"nod.angles.csv", "nod.angles.nc", "nod.angles.parquet", "nod.html", "nod.png"}
