"""The commands of a recording, and motions without a command."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from synth.section import Finite, NotNegative, Positive, Section

Rest = Annotated[float, Field(ge=0.5, allow_inf_nan=False)]
"""Rest before the first change, s: long enough to measure the neutral and the noise."""


class Step(Section):
    """One step to ``amplitude_deg``, held to the end; 22° in the paper."""

    kind: Literal["step"]
    amplitude_deg: Finite = 15.0
    rest_s: Rest = 0.71


class Stairs(Section):
    """A sequence of levels."""

    kind: Literal["stairs"]
    levels_deg: Annotated[list[Finite], Field(min_length=1)]
    tread_s: Positive = 0.9
    rest_s: Rest = 0.71


class PaperSeries(Section):
    """The paper's verification: steps of several heights, each from the end of the previous step (Figs. 11, 15)."""

    kind: Literal["paper_series"]
    tread_s: Positive = 1.5
    rest_s: Rest = 0.71


class Triangle(Section):
    """A slow triangle wave, beginning upwards."""

    kind: Literal["triangle"]
    amplitude_deg: Finite = 15.0
    period_s: Positive = 4.0
    rest_s: Rest = 0.71


class Chirp(Section):
    """A sine whose frequency increases linearly until the recording ends."""

    kind: Literal["chirp"]
    amplitude_deg: Finite = 8.0
    from_hz: Positive = 0.3
    to_hz: Positive = 4.0
    rest_s: Rest = 0.71


class Release(Section):
    """Command to ``amplitude_deg``, hold, and drop to zero."""

    kind: Literal["release"]
    amplitude_deg: Finite = 15.0
    hold_s: Positive = 2.0
    rest_s: Rest = 0.71


class RandomSteps(Section):
    """Levels drawn uniformly within ±``amplitude_deg``, each held for a time drawn uniformly between the two limits."""

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


class Free(Section):
    """No command: the head is held at ``initial_angle_deg`` by hand and released after ``rest_s``."""

    kind: Literal["free"]
    initial_angle_deg: Finite = 15.0
    rest_s: Rest = 0.71


class Nod(Section):
    """A human nod without a plant: up by ``rise_deg`` in ``rise_s`` with minimum jerk, hold, and back.

    The paper's subject took 0.3 s for 70° (Fig. 10 (b)). Only a neck without a linkage reaches that far.
    """

    kind: Literal["nod"]
    from_deg: Finite = 0.0
    rise_deg: Finite = 70.0
    rise_s: Positive = 0.3
    hold_s: NotNegative = 0.6
    rest_s: Rest = 0.71


Command = Annotated[
    Step | Stairs | PaperSeries | Triangle | Chirp | Release | RandomSteps | Free | Nod, Field(discriminator="kind")
]
