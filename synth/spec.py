"""What is to be filmed: one YAML file, validated whole before anything moves.

The spec has six parts. ``plant`` and ``effects`` say how the head moves and stay secret; ``camera`` and ``rig`` say
what the film shows; ``recordings`` say what is commanded; ``declare`` is handed out word for word as the session's
``rig.yaml``, right or wrong, because a wrong declaration may be the very thing under test.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from anglecam.neck import FourBar, head_angle, reach

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Byte = Annotated[int, Field(ge=0, le=255)]
Rgb = tuple[Byte, Byte, Byte]
Rest = Annotated[float, Field(ge=0.5, allow_inf_nan=False)]
"""Rest before the first change, s: long enough to see the neutral and the noise."""
NEUTRAL_SERVO = math.radians(135.0)
"""Crank angle with the head upright, Table 3, rad."""


class SpecError(Exception):
    """The call or the spec is wrong; the text is the one line that the user reads."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Plant(_Part):
    """The base model θ̈ = c·u − a·θ̇ − b·θ, Eq. (30); u is the commanded head angle."""

    a: NotNegative = 26.0
    """1/s."""
    b: NotNegative = 524.0
    """1/s²."""
    c: Positive = 508.0
    """1/s²."""


class DeadTime(_Part):
    """The command acts later."""

    tau_s: NotNegative


class ActuatorLag(_Part):
    """A first-order lag between command and torque."""

    tau_s: Positive


class RateLimit(_Part):
    """The effective command moves no faster than this."""

    r_deg_per_s: Positive


class CoulombFriction(_Part):
    """Dry friction, as angular acceleration."""

    torque: NotNegative
    """While sliding, rad/s²."""
    breakaway: NotNegative | None = None
    """To leave rest, rad/s²; the same as ``torque`` where not given."""

    @model_validator(mode="after")
    def _breakaway_holds_more(self) -> CoulombFriction:
        if self.breakaway is not None and self.breakaway < self.torque:
            raise ValueError("breakaway must not be smaller than torque")
        return self


class QuadraticDrag(_Part):
    """−q·θ̇·|θ̇|."""

    q: NotNegative
    """1/rad."""


class StiffeningSpring(_Part):
    """−k3·θ³; negative k3 softens."""

    k3: Finite
    """1/(s²·rad²)."""


class PeriodicDisturbance(_Part):
    """A torque from elsewhere that swings by itself: amplitude·sin(2π·f·t + phase)."""

    amplitude: Positive
    """rad/s²."""
    frequency_hz: Positive
    phase: Finite = 0.0
    """rad, at time 0 of each recording."""


class Effects(_Part):
    """What the plant has beyond the base model; each absent unless named."""

    dead_time: DeadTime | None = None
    actuator_lag: ActuatorLag | None = None
    rate_limit: RateLimit | None = None
    coulomb_friction: CoulombFriction | None = None
    quadratic_drag: QuadraticDrag | None = None
    stiffening_spring: StiffeningSpring | None = None
    periodic_disturbance: PeriodicDisturbance | None = None


class Camera(_Part):
    """The camera, square to the plane of motion, and the file it writes."""

    size: tuple[Annotated[int, Field(ge=64, le=4096)], Annotated[int, Field(ge=64, le=4096)]] = (640, 480)
    fps: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 30.0
    codec: Literal["mjpeg", "ffv1", "h264"] = "mjpeg"
    quality: Annotated[int, Field(ge=1, le=31)] = 2
    """Quantiser of mjpeg: 1 is best, 31 worst."""
    crf: Annotated[int, Field(ge=0, le=51)] = 18
    """Rate factor of h264: 0 is lossless, 51 worst."""
    noise_grey: NotNegative = 2.0
    """Standard deviation of the noise on each of red, green and blue, grey levels."""

    @model_validator(mode="after")
    def _even(self) -> Camera:
        if self.codec != "ffv1" and any(side % 2 for side in self.size):
            raise ValueError(f"codec {self.codec} needs an even width and height")
        return self


class Rig(_Part):
    """What stands before the camera and where it appears in the picture."""

    lever_px: Positive = 200.0
    """Pivot to mouth."""
    pivot_px: tuple[Finite, Finite] = (240.0, 300.0)
    facing: Literal["right", "left"] = "right"
    marker: Literal["disc", "ring", "none"] = "disc"
    """On the end of the shaft."""
    lips_rgb: Rgb = (190, 35, 40)
    skin_rgb: Rgb = (222, 178, 150)
    linkage: FourBar = FourBar()
    """Link lengths, m."""

    @model_validator(mode="after")
    def _closes(self) -> Rig:
        if min(self.linkage.ground, self.linkage.coupler, self.linkage.rocker, self.linkage.crank) <= 0:
            raise ValueError("linkage: every link must be longer than zero")
        try:
            reach(self.linkage)
            head_angle(self.linkage, NEUTRAL_SERVO)
        except ValueError as error:
            raise ValueError(f"linkage: {error}") from error
        return self


class Step(_Part):
    """One step to ``amplitude_deg``, held to the end."""

    kind: Literal["step"]
    amplitude_deg: Finite = 15.0
    rest_s: Rest = 0.71


class Stairs(_Part):
    """Level after level."""

    kind: Literal["stairs"]
    levels_deg: Annotated[list[Finite], Field(min_length=1)]
    tread_s: Positive = 0.9
    rest_s: Rest = 0.71


class Triangle(_Part):
    """Slowly up, down through zero and back."""

    kind: Literal["triangle"]
    amplitude_deg: Finite = 15.0
    period_s: Positive = 4.0
    rest_s: Rest = 0.71


class Chirp(_Part):
    """A sine whose frequency grows linearly until the recording ends."""

    kind: Literal["chirp"]
    amplitude_deg: Finite = 8.0
    from_hz: Positive = 0.3
    to_hz: Positive = 4.0
    rest_s: Rest = 0.71


class Release(_Part):
    """Command to ``amplitude_deg``, hold, and drop to zero."""

    kind: Literal["release"]
    amplitude_deg: Finite = 15.0
    hold_s: Positive = 2.0
    rest_s: Rest = 0.71


class RandomSteps(_Part):
    """Levels drawn evenly within ±``amplitude_deg``, each held for a time drawn between the two treads."""

    kind: Literal["random"]
    amplitude_deg: Finite = 15.0
    shortest_s: Positive = 0.2
    longest_s: Positive = 0.9
    rest_s: Rest = 0.71

    @model_validator(mode="after")
    def _ordered(self) -> RandomSteps:
        if self.longest_s < self.shortest_s:
            raise ValueError("longest_s must not be smaller than shortest_s")
        return self


class Free(_Part):
    """No command at all: the head is held at ``initial_angle_deg`` by hand and let go after ``rest_s``."""

    kind: Literal["free"]
    initial_angle_deg: Finite = 15.0
    rest_s: Rest = 0.71


Command = Annotated[Step | Stairs | Triangle | Chirp | Release | RandomSteps | Free, Field(discriminator="kind")]


class Recording(_Part):
    """One clip and what is commanded while it is taken."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]
    duration_s: Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
    command: Command


class Spec(_Part):
    """A whole session to be rendered."""

    seed: Annotated[int, Field(ge=0)] = 0
    plant: Plant = Plant()
    effects: Effects = Effects()
    camera: Camera = Camera()
    rig: Rig = Rig()
    declare: dict[str, Any] = {}
    recordings: Annotated[list[Recording], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_differ(self) -> Spec:
        names = [recording.name for recording in self.recordings]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"recordings: the name {twice[0]} stands twice")
        return self


def read_spec(path: Path) -> Spec:
    """Read and validate a spec.

    Parameters
    ----------
    path : Path
        A YAML file.

    Returns
    -------
    Spec
        With the defaults in place of what is not given.

    Raises
    ------
    SpecError
        One line that names the file, the key and the cause.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SpecError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise SpecError(f"{path}: not a UTF-8 text file") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "not valid YAML"
        mark = getattr(error, "problem_mark", None)
        raise SpecError(f"{path}: not YAML ({problem}{f', line {mark.line + 1}' if mark else ''})") from error
    if not isinstance(content, dict):
        raise SpecError(f"{path}: expected keys and values, found {type(content).__name__}")
    try:
        return Spec.model_validate(content)
    except ValidationError as error:
        raise SpecError(f"{path}: {_first_finding(error)}") from error


_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}


def _first_finding(error: ValidationError) -> str:
    """Say the most telling finding in one line; an unknown key explains most of the others."""
    findings = error.errors()
    unknown = [finding for finding in findings if finding["type"] in _UNKNOWN]
    finding = (unknown or findings)[0]
    kinds = {"step", "stairs", "triangle", "chirp", "release", "random", "free"}
    key = ".".join(
        str(part)
        for at, part in enumerate(finding["loc"])
        # the discriminator's own tag follows the key "command" and is no key of the file
        if not (part in kinds and at and finding["loc"][at - 1] == "command")
    )
    if unknown:
        return f"unknown key {key}"
    message = finding["msg"].removeprefix("Value error, ")
    got = "" if finding["type"] in {"missing", "value_error"} else f" (got {str(finding['input'])[:60]})"
    return f"{key + ': ' if key else ''}{message[0].lower()}{message[1:]}{got}"
