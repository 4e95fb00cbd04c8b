"""The sections of a spec that describe the picture: rig, scene, camera, rendering."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from anglecam.neck import FourBar, head_angle, reach
from synth.section import NotNegative, Pixel, Positive, Rgb, Section, Share

NEUTRAL_SERVO = math.radians(135.0)
"""Crank angle with the head upright, Table 3, rad."""

LIPSTICKS: dict[str, Rgb] = {
    "red": (190, 35, 40),
    "coral": (222, 92, 78),
    "pink": (214, 72, 120),
    "plum": (112, 28, 62),
    "brick": (150, 56, 42),
    "bare": (188, 122, 112),
}
SKINS: dict[str, Rgb] = {
    "pale": (222, 178, 150),
    "olive": (186, 140, 104),
    "brown": (132, 88, 62),
    "dark": (82, 54, 40),
}


class Rig(Section):
    """The mechanism, and where it appears in the picture."""

    lever_px: Positive = 200.0
    """Distance from pivot to mouth in a square view."""
    pivot_px: Pixel = (240.0, 300.0)
    facing: Literal["right", "left"] = "right"
    marker: Literal["disc", "ring", "none"] = "disc"
    """Mark on the end of the shaft."""
    head: Literal["female", "male"] = "female"
    skin: Literal["pale", "olive", "brown", "dark"] | Rgb = "pale"
    lips: Literal["red", "coral", "pink", "plum", "brick", "bare"] | Rgb = "red"
    neck: Literal["linkage", "human"] = "linkage"
    """A human neck has no linkage, no shaft and no springs, and reaches further."""
    linkage: FourBar = FourBar()
    """Link lengths, m."""

    @property
    def lips_rgb(self) -> Rgb:
        """Return the colour of the lips."""
        return LIPSTICKS[self.lips] if isinstance(self.lips, str) else self.lips

    @property
    def skin_rgb(self) -> Rgb:
        """Return the colour of the skin."""
        return SKINS[self.skin] if isinstance(self.skin, str) else self.skin

    @model_validator(mode="after")
    def _closes(self) -> Rig:
        if min(self.linkage.ground, self.linkage.coupler, self.linkage.rocker, self.linkage.crank) <= 0:
            raise ValueError("linkage: every link must be longer than zero")
        try:
            reach(self.linkage)
            head_angle(self.linkage, NEUTRAL_SERVO)
        except ValueError as error:
            raise ValueError(f"linkage: {error}") from error
        if self.neck == "human" and self.marker != "none":
            raise ValueError("marker: a human neck has no shaft for a marker, set marker: none")
        return self


class Occluder(Section):
    """A dark bar that passes in front of the mouth, from left to right."""

    from_s: NotNegative
    """Time at which it begins to cover the mouth at neutral."""
    for_s: Positive
    """Time for which it covers the mouth."""
    width_px: Positive = 60.0
    rgb: Rgb = (46, 44, 48)


class Distractor(Section):
    """A mug of the lips' colour, fixed or swaying."""

    at_px: Pixel
    width_px: Positive = 60.0
    sway_px: NotNegative = 0.0
    """Amplitude of a sideways oscillation at 0.5 Hz."""
    rgb: Rgb | None = None
    """The lips' colour by default."""


class Scene(Section):
    """Objects in the picture besides the rig."""

    lamp_px: Pixel | None = None
    """Position of a lamp that lights at the first command change and stays on."""
    occluders: tuple[Occluder, ...] = ()
    distractor: Distractor | None = None


class Flicker(Section):
    """Flicker of the light: its strength is multiplied by 1 + share·sin(2π·f·t)."""

    share: Share
    frequency_hz: Positive = 100.0


class Shake(Section):
    """Vibration of the camera: band-limited noise of this standard deviation in x and in y."""

    rms_px: Positive
    frequency_hz: Positive = 4.0
    """Upper limit of the band."""


Container = Literal["avi", "mp4", "mkv"]


class Camera(Section):
    """The camera, its faults and the file it writes; faults that anglecam identifies are under ``effects``."""

    size: tuple[Annotated[int, Field(ge=64, le=4096)], Annotated[int, Field(ge=64, le=4096)]] = (640, 480)
    fps: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 30.0
    distance_m: Annotated[float, Field(ge=0.4, le=20, allow_inf_nan=False)] = 1.5
    """Distance to the plane of motion; the rig's size in the picture does not depend on it."""
    azimuth_deg: Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)] = 0.0
    """Oblique view: from the front of the face if positive."""
    elevation_deg: Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)] = 0.0
    """Oblique view: from above if positive."""
    exposure_s: NotNegative = 0.0
    """Time for which each row is open; the frame's time is its middle."""
    noise_grey: NotNegative = 2.0
    """Standard deviation of the read noise on each of red, green and blue, grey levels."""
    electrons_at_white: Positive | None = None
    """Photo-electrons at grey level 255; their Poisson noise is the shot noise. No shot noise by default."""
    gamma: Annotated[float, Field(ge=0.2, le=5, allow_inf_nan=False)] = 1.0
    """Grey level is light to the power 1/gamma; 1 is a machine-vision camera, 2.2 an ordinary one."""
    focus_blur_px: Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)] = 0.0
    """Standard deviation of the lens's blur."""
    vignetting: Share = 0.0
    """Share of the light lost in the corners."""
    flicker: Flicker | None = None
    shake: Shake | None = None
    dropped: Annotated[float, Field(ge=0, lt=0.9, allow_inf_nan=False)] = 0.0
    """Share of frames missing in the file; the others keep their times."""
    duplicated: Annotated[float, Field(ge=0, lt=0.9, allow_inf_nan=False)] = 0.0
    """Share of frames that repeat the previous picture."""
    interval_jitter: Annotated[float, Field(ge=0, le=0.9, allow_inf_nan=False)] = 0.0
    """Variable frame rate: intervals vary uniformly by ± this share; the file's times are correct."""
    declared_fps: Positive | None = None
    """Wrong frame rate stated by the file; the true rate by default."""
    codec: Literal["mjpeg", "ffv1", "h264"] = "mjpeg"
    container: Container | None = None
    """AVI for mjpeg and ffv1, MP4 for h264 by default."""
    chroma: Literal[444, 422, 420] | None = None
    """Colour resolution; 444 for mjpeg and 420 for h264 by default. ffv1 stores red, green and blue."""
    quality: Annotated[int, Field(ge=1, le=31)] = 2
    """Quantiser of mjpeg: 1 is the best, 31 the worst."""
    crf: Annotated[int, Field(ge=0, le=51)] = 18
    """Rate factor of h264: 0 is lossless, 51 the worst."""

    @property
    def suffix(self) -> Container:
        """Return the container of the clip."""
        return self.container or ("mp4" if self.codec == "h264" else "avi")

    @model_validator(mode="after")
    def _can_be_written(self) -> Camera:
        if self.codec != "ffv1" and any(side % 2 for side in self.size):
            raise ValueError(f"codec {self.codec} needs an even width and height")
        if self.codec == "ffv1" and self.container == "mp4":
            raise ValueError("container: mp4 cannot hold ffv1, use avi or mkv")
        if self.codec == "ffv1" and self.chroma is not None:
            raise ValueError("chroma: ffv1 stores red, green and blue, omit chroma")
        if self.codec == "h264" and self.suffix == "avi" and self.dropped:
            raise ValueError("dropped: h264 in avi cannot represent a gap, use mp4 or mkv")
        if self.interval_jitter and self.suffix == "avi":
            raise ValueError("interval_jitter: avi has a fixed frame rate, use mp4 or mkv")
        if self.declared_fps is not None and self.interval_jitter:
            raise ValueError("declared_fps: cannot be combined with interval_jitter")
        if self.exposure_s >= (1 - self.interval_jitter) / self.fps:
            raise ValueError("exposure_s: must be shorter than the time between two frames")
        return self


class Render(Section):
    """Rendering of the picture."""

    engine: Literal["raster", "pyrender"] = "raster"
    """``raster``: rasteriser of this package with exact areas at edges; ``pyrender``: pyrender through EGL."""
    quality: Literal["draft", "standard", "metrology"] = "standard"
