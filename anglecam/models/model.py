"""The interface of a forward model that an estimator can fit."""

from __future__ import annotations

from typing import Protocol

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import Command
from anglecam.data.typing import Floats


class Model(Protocol):
    """A model that predicts a recording's angle from parameters, a command and an initial state.

    Implemented by `anglecam.models.plant.Plant`, `anglecam.models.third_order.ThirdOrder` and
    `anglecam.models.large_angle.LargeAngle`, where the members are documented.
    """

    states: int

    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102  # documented where implemented
    @property
    def lower(self) -> Floats: ...  # noqa: D102
    @property
    def upper(self) -> Floats: ...  # noqa: D102
    @property
    def scales(self) -> Floats: ...  # noqa: D102
    @property
    def to_file(self) -> Floats: ...  # noqa: D102
    def predict(  # noqa: D102
        self, parameters: Floats, time: Floats, command: Command | None, state: Floats, view: View = UNKNOWN_VIEW
    ) -> Floats: ...
