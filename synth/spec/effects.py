"""The section ``effects`` of a spec: one optional key for each effect of the registry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

from pydantic import create_model, model_validator

from synth.effects import REGISTRY, Effect
from synth.effects.camera_tilt import CameraTilt
from synth.effects.linkage_geometry import LinkageGeometry
from synth.effects.load_dependent_friction import LoadDependentFriction
from synth.effects.perspective import Perspective
from synth.effects.speed_dependent_torque import SpeedDependentTorque
from synth.effects.torque_saturation import TorqueSaturation
from synth.section import Section

AnyEffect = TypeVar("AnyEffect", bound=Effect)


class EffectsBase(Section):
    """What the section does, whichever effects there are."""

    def get(self, effect: type[AnyEffect]) -> AnyEffect | None:
        """Return the section of an effect; ``None`` where the effect is absent."""
        return cast("AnyEffect | None", getattr(self, effect.id))

    def present(self) -> tuple[Effect, ...]:
        """Return the effects that act, in their order."""
        return tuple(section for effect in REGISTRY if (section := self.get(effect)) is not None)

    @model_validator(mode="after")
    def _one_servo(self) -> EffectsBase:
        limited, linked = self.get(TorqueSaturation), self.get(LinkageGeometry)
        if limited and linked and limited.share != linked.share:
            raise ValueError("torque_saturation.share and linkage_geometry.share are the same servo's and must agree")
        if limited and self.get(SpeedDependentTorque):
            raise ValueError("torque_saturation and speed_dependent_torque are limits of the same servo")
        pressed = self.get(LoadDependentFriction)
        if pressed and any(other and other.share != 1 - pressed.spring_share for other in (limited, linked)):
            raise ValueError("load_dependent_friction.spring_share must be what the servo's share leaves of b")
        if self.get(CameraTilt) and self.get(Perspective):
            raise ValueError("camera_tilt and perspective are directions of the same camera")
        return self


if TYPE_CHECKING:
    Effects = EffectsBase
else:
    _keys: dict[str, Any] = {effect.id: (effect | None, None) for effect in REGISTRY}
    Effects = create_model(
        "Effects", __base__=EffectsBase, __module__=__name__, __doc__="Any number of effects.", **_keys
    )
