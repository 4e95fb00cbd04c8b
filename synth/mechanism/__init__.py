"""The rig and the scene as triangles with the spec's dimensions, and the poses of all moving bodies."""

from synth.mechanism.assembly import build, poses
from synth.mechanism.head import mouth_centre
from synth.mechanism.linkage import neutral_rocker
from synth.mechanism.part import Part
from synth.mechanism.scene import prop_poses, props
from synth.mechanism.springs import Suspension, suspension

__all__ = [
    "Part",
    "Suspension",
    "build",
    "mouth_centre",
    "neutral_rocker",
    "poses",
    "prop_poses",
    "props",
    "suspension",
]
