"""What is declared about a rig and its camera: ``rig.yaml``, every key optional, an unknown key an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from anglecam.io.yaml_schema import Declared, Finite, Positive, read_declared

Byte = Annotated[int, Field(ge=0, le=255)]
SlantDeg = Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)]


class RigMark(Declared):
    """The mark at the far end of the lever: its colour, or ``None`` to find it."""

    rgb: tuple[Byte, Byte, Byte] | None = None


class RigPivot(Declared):
    """Where the mechanism turns and how that place is marked."""

    near: tuple[Finite, Finite] | None = None
    """A hint, px."""
    marker: Literal["auto", "disc", "ring", "none"] = "auto"
    """``none``: the centre of rotation fitted to the mouth's path."""


class RigCamera(Declared):
    """What is known about the camera."""

    calibration: str | None = None
    """A calibration file; in ``rig.yaml`` relative to it."""
    focal_px: Positive | None = None
    """Focal length where there is no calibration; counts only where the view is tilted."""
    tilt_deg: SlantDeg | None = None
    """Between the line of sight to the pivot and the axis of rotation."""
    tilt_axis_deg: Finite = 0.0
    """Of the axis in the picture about which the camera is turned: 0 looks from above, 90 from the side at the left;
    counted as angles are, so that ``facing: left`` mirrors it."""
    tilt_sigma_deg: Annotated[float, Field(ge=0, lt=45, allow_inf_nan=False)] = 0.0
    """Standard uncertainty of ``tilt_deg``."""
    row_time_s: Positive | None = None
    """How much later each row is exposed than the one above it."""
    exposure_s: Positive | None = None

    @model_validator(mode="after")
    def _one_focal_length(self) -> RigCamera:
        if self.calibration is not None and self.focal_px is not None:
            raise ValueError("focal_px stands in the calibration already; declare one of them")
        return self


class RigSync(Declared):
    """What ties the command's clock to the clip's."""

    lamp: tuple[Finite, Finite] | None = None
    """Where in the picture a lamp stands that lights at the first command change, px."""


class RigModel(Declared):
    """Starting values of θ̈ = c·u − a·θ̇ − b·θ (Eq. (30) of the paper)."""

    a: Finite = 26.0
    """1/s."""
    b: Finite = 524.0
    """1/s²."""
    c: Finite = 508.0
    """1/s²."""
    gravity_deg: Finite | None = None
    """The centre of mass from upright at neutral, degrees."""


class RigKeypoints(Declared):
    """Which points that another program has tracked are mouth and pivot."""

    mouth: str
    pivot: str
    rate_hz: Positive | None = None
    """Frames per second, where no clip stands beside the tracks to say when each frame was taken."""
    least_likelihood: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    """Points less likely than this are missing; ``None``: the tracking program's own default."""

    @model_validator(mode="after")
    def _two_points(self) -> RigKeypoints:
        if self.mouth == self.pivot:
            raise ValueError("mouth and pivot are the same point; an angle needs two")
        return self


class Rig(Declared):
    """One rig, as ``rig.yaml`` declares it."""

    mouth: RigMark | Literal["auto"] = "auto"
    pivot: RigPivot = RigPivot()
    facing: Literal["right", "left"] = "right"
    neutral: Finite | Literal["auto"] = "auto"
    """``line_deg`` that counts as zero; ``auto``: the rest before the first command change, else the median."""
    pixel_error_px: tuple[Positive, ...] = (6.0, 10.0)
    held_out: tuple[str, ...] = ()
    camera: RigCamera = RigCamera()
    marks: RigKeypoints | None = None
    """Of sessions whose recordings are tracks of points."""
    sync: RigSync = RigSync()
    model: RigModel = RigModel()

    @property
    def mouth_rgb(self) -> tuple[int, int, int] | None:
        """The declared colour of the mouth, ``None`` where it is to be found."""
        return None if self.mouth == "auto" else self.mouth.rgb


def read_rig(path: Path) -> Rig:
    """Read and validate a rig file.

    Parameters
    ----------
    path : Path
        A YAML file as the README describes it.

    Returns
    -------
    Rig
        With the defaults in place of what is not declared.

    Raises
    ------
    RigError
        Naming the file, the key and the cause.
    """
    rig = read_declared(path, Rig)
    if rig.camera.calibration is None:
        return rig
    beside = {"calibration": str(path.parent / rig.camera.calibration)}
    return rig.model_copy(update={"camera": rig.camera.model_copy(update=beside)})
