"""The spec of a session to render, section by section."""

from synth.section import Pixel, Rgb
from synth.spec.commands import (
    Chirp,
    Command,
    Free,
    Nod,
    PaperSeries,
    RandomSteps,
    Release,
    Stairs,
    Step,
    Triangle,
)
from synth.spec.effects import Effects
from synth.spec.picture import NEUTRAL_SERVO, Camera, Flicker, Render, Rig, Scene, Shake
from synth.spec.plant import Controller, LinearPlant, NeckPlant, Plant
from synth.spec.session import Recording, Spec, read_spec

__all__ = [
    "NEUTRAL_SERVO",
    "Camera",
    "Chirp",
    "Command",
    "Controller",
    "Effects",
    "Flicker",
    "Free",
    "LinearPlant",
    "NeckPlant",
    "Nod",
    "PaperSeries",
    "Pixel",
    "Plant",
    "RandomSteps",
    "Recording",
    "Release",
    "Render",
    "Rgb",
    "Rig",
    "Scene",
    "Shake",
    "Spec",
    "Stairs",
    "Step",
    "Triangle",
    "read_spec",
]
