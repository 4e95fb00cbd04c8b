"""``rig.yaml``: what is declared about a rig and its camera. Every key is optional; an unknown key is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from anglecam.io.yaml_schema import Declared, Finite, Positive, read_declared

Byte = Annotated[int, Field(ge=0, le=255)]
FrameNumber = Annotated[int, Field(ge=0, le=10**9)]
SlantDeg = Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)]


class RigMark(Declared):
    """The mark on the body, at the far end of the lever: its colour, or where to see it."""

    rgb: tuple[Byte, Byte, Byte] | None = None
    """Its colour; ``None``: the colour is found from the clip."""
    at: tuple[Finite, Finite] | None = None
    """A point on it in frame ``frame``, px."""
    box: tuple[Finite, Finite, Finite, Finite] | None = None
    """A box around it in frame ``frame``: left, top, right, bottom, px."""
    frame: Annotated[int, Field(ge=0)] = 0
    """Number of that frame in the film, from 0."""

    @model_validator(mode="after")
    def _one_way(self) -> RigMark:
        if sum(way is not None for way in (self.rgb, self.at, self.box)) > 1:
            raise ValueError("rgb, at and box each name the mark; declare only one of them")
        if "frame" in self.model_fields_set and self.at is None and self.box is None:
            raise ValueError("frame says in which frame at or box is; declare one of them")
        if self.box is not None and not (self.box[0] < self.box[2] and self.box[1] < self.box[3]):
            raise ValueError("box is left, top, right, bottom, with left < right and top < bottom")
        return self

    @property
    def as_box(self) -> tuple[float, float, float, float] | None:
        """The box, or the point as a box without extent, px; ``None`` where neither is declared."""
        return self.box if self.at is None else (*self.at, *self.at)


class RigPivot(Declared):
    """Where the mechanism turns, and how that place is marked."""

    near: tuple[Finite, Finite] | None = None
    """A hint: a point within some 10 px of the pivot, px."""
    at: tuple[Finite, Finite] | None = None
    """The pivot itself, inside or outside the picture, px."""
    sigma_px: Positive | None = None
    """Standard uncertainty of each coordinate of ``at``, px; 1 px if it is not declared."""
    marker: Literal["auto", "disc", "ring", "none"] = "auto"
    """Shape of the marker on the shaft; ``none``: the pivot is the centre of rotation, fitted to the mark's path."""

    @model_validator(mode="after")
    def _one_place(self) -> RigPivot:
        if self.at is not None and self.near is not None:
            raise ValueError("at fixes the pivot and near hints at it; declare only one of them")
        if self.sigma_px is not None and self.at is None:
            raise ValueError("sigma_px is the uncertainty of at; declare both")
        return self

    @property
    def expected(self) -> tuple[float, float] | None:
        """Where the pivot is expected, px: ``at`` or ``near``."""
        return self.near if self.at is None else self.at


class RigCamera(Declared):
    """What is known about the camera."""

    calibration: str | None = None
    """Path of a calibration file; in ``rig.yaml`` relative to that file."""
    focal_px: Positive | None = None
    """Focal length, px, for a camera without a calibration; used only where the view is tilted."""
    tilt_deg: SlantDeg | None = None
    """Angle between the line of sight to the pivot and the axis of rotation, degrees."""
    tilt_axis_deg: Finite = 0.0
    """Direction in the picture of the axis about which the camera is turned, degrees: at 0 it looks from above, at 90
    from the left. It is counted as angles are, so ``facing: left`` mirrors it."""
    tilt_sigma_deg: Annotated[float, Field(ge=0, lt=45, allow_inf_nan=False)] = 0.0
    """Standard uncertainty of ``tilt_deg``, degrees."""
    row_time_s: Positive | None = None
    """Delay of the exposure from one row of the picture to the next, s."""
    exposure_s: Positive | None = None
    """Length of the exposure, s."""

    @model_validator(mode="after")
    def _one_focal_length(self) -> RigCamera:
        if self.calibration is not None and self.focal_px is not None:
            raise ValueError("focal_px is already in the calibration; declare only one of them")
        return self


class RigFrames(Declared):
    """Which frames of a film are measured, and the rate of numbered pictures.

    Examples
    --------
    >>> frames = RigFrames.model_validate({"from": 30, "to": 149})
    >>> frames.first, frames.last
    (30, 149)
    """

    first: FrameNumber | None = Field(default=None, alias="from")
    """Number of the first frame that is measured; the film's first frame has 0."""
    last: FrameNumber | None = Field(default=None, alias="to")
    """Number of the last frame that is measured."""
    rate_hz: Positive | None = None
    """Pictures per second, for a folder of numbered pictures, which have no time stamps."""

    @model_validator(mode="after")
    def _in_order(self) -> RigFrames:
        if self.last is not None and self.last < (self.first or 0):
            raise ValueError(f"to: {self.last} comes before from: {self.first}")
        return self


class RigCommand(Declared):
    """What the rows of the command files mean."""

    hold: Literal["zero", "linear"] = "zero"
    """``zero``: each value holds until the next row, as a servo is commanded; ``linear``: the rows are samples of a
    continuous signal, with straight lines between them."""


class RigSync(Declared):
    """What relates the command's clock to the clip's clock."""

    lamp: tuple[Finite, Finite] | None = None
    """Position in the picture of a lamp that lights at the first change of the command, px."""


class RigModel(Declared):
    """Starting values of θ̈ = c·u − a·θ̇ − b·θ (Eq. (30) of the paper)."""

    a: Finite = 26.0
    """Damping, 1/s."""
    b: Finite = 524.0
    """Stiffness, 1/s²."""
    c: Finite = 508.0
    """Gain of the command, 1/s²."""
    gravity_deg: Finite | None = None
    """Direction of the centre of mass from upright at neutral, degrees."""


class RigKeypoints(Declared):
    """Which points that another program has tracked are the mark and the pivot."""

    mouth: str
    """Name of the mark's point."""
    pivot: str
    """Name of the pivot's point."""
    rate_hz: Positive | None = None
    """Frames per second, for tracks without their clip next to them, from which frame times would be read."""
    least_likelihood: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    """Likelihood below which a point counts as missing; ``None``: the tracking program's default."""

    @model_validator(mode="after")
    def _two_points(self) -> RigKeypoints:
        if self.mouth == self.pivot:
            raise ValueError("mouth and pivot are the same point; an angle needs two")
        return self


class Rig(Declared):
    """One rig, as ``rig.yaml`` declares it.

    Examples
    --------
    >>> rig = Rig.model_validate({"mouth": {"rgb": [190, 35, 40]}, "pivot": {"near": [218, 298]}})
    >>> rig.mark_rgb
    (190, 35, 40)
    >>> rig.pivot.marker, rig.facing, rig.pixel_error_px
    ('auto', 'right', (6.0, 10.0))
    >>> Rig().mark_rgb is None
    True
    """

    other_names: ClassVar = {"mark": "mouth"}
    """Keys that are accepted for others."""
    mouth: RigMark | Literal["auto"] = "auto"
    """The mark, also called ``mark`` in the file; ``auto``: it is found from the clip."""
    pivot: RigPivot = RigPivot()
    facing: Literal["right", "left"] = "right"
    """Side that the face looks to; with ``left``, angles are counted clockwise in the picture."""
    neutral: Finite | Literal["auto"] = "auto"
    """``line_deg`` that counts as zero; ``auto``: its mean over the rest before the first command change, without a
    command its median over the clip."""
    pixel_error_px: tuple[Positive, ...] = (6.0, 10.0)
    """Radii within which the mark may lie, px; each gives a worst-case error of the angle."""
    held_out: tuple[str, ...] = ()
    """Names of the recordings that are only predicted and never fitted to."""
    least_measured: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.5
    """Share of a recording's frames that must be measured for it to be trusted and fitted to. With half of them, what
    was measured is what happened for most of the time."""
    camera: RigCamera = RigCamera()
    frames: RigFrames = RigFrames()
    """Which frames of a film are measured."""
    body: Annotated[int, Field(ge=1, le=6)] | None = None
    """Number, in ``NAME.bodies.json``, of the body that is measured first, where several move."""
    marks: RigKeypoints | None = None
    """For sessions whose recordings are tracks of points."""
    source: Literal["camera", "encoder"] = "camera"
    """Where the angles come from; those of an encoder have no errors of a camera."""
    command: RigCommand = RigCommand()
    sync: RigSync = RigSync()
    model: RigModel = RigModel()

    @model_validator(mode="before")
    @classmethod
    def _mark_is_mouth(cls, content: object) -> object:
        """Accept the key ``mark`` for ``mouth``."""
        if not isinstance(content, dict) or "mark" not in content:
            return content
        if "mouth" in content:
            raise ValueError("mark and mouth are two names of one key; declare only one of them")
        return {"mouth" if key == "mark" else key: value for key, value in content.items()}

    @property
    def pointed_mark(self) -> RigMark | None:
        """The mark where the rig names it by a point or a box; ``None`` otherwise."""
        return None if self.mouth == "auto" or (self.mouth.at is None and self.mouth.box is None) else self.mouth

    @property
    def mark_rgb(self) -> tuple[int, int, int] | None:
        """The declared colour of the mark; ``None`` if it is to be found from the clip."""
        return None if self.mouth == "auto" else self.mouth.rgb


def read_rig(path: Path) -> Rig:
    """Read and validate a rig file.

    Parameters
    ----------
    path : Path
        A YAML file; the classes of this module are its sections.

    Returns
    -------
    Rig
        What the file declares; the defaults for everything else. ``camera.calibration`` is resolved against the
        file's folder.

    Raises
    ------
    RigError
        If the file cannot be read, a key is unknown or a value is not allowed; a line for each such key names the
        file, the key and the cause.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "rig.yaml")
    ...     _ = path.write_text("{facing: left, neutral: -12.5, held_out: [stairs]}")
    ...     rig = read_rig(path)
    >>> rig.facing, rig.neutral, rig.held_out
    ('left', -12.5, ('stairs',))
    """
    rig = read_declared(path, Rig)
    if rig.camera.calibration is None:
        return rig
    resolved = {"calibration": str(path.parent / rig.camera.calibration)}
    return rig.model_copy(update={"camera": rig.camera.model_copy(update=resolved)})
