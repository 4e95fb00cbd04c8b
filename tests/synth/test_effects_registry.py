"""An effect with a separate state is one new file in `synth/effects/`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from synth.effects import REGISTRY
from synth.spec import Effects

ROOT = Path(__file__).parents[2]

EFFECT_WITH_A_STATE = '''
"""A torque that relaxes after every motion: ż = θ̇ − rate·z, torque −stiffness·z."""

from typing import ClassVar

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.section import Positive


class MaxwellElement(Effect):
    """A spring and a damper in series."""

    id: ClassVar[str] = "maxwell_element"
    order: ClassVar[int] = 300
    states: ClassVar[tuple[StateVariable, ...]] = (StateVariable("stretch", "rad"),)

    stiffness: Positive
    rate: Positive

    def dynamics(self) -> Dynamics:
        return _Maxwell(self.stiffness, self.rate)


EFFECT = MaxwellElement


class _Maxwell(Dynamics):
    def __init__(self, stiffness, rate):
        self.stiffness, self.rate = stiffness, rate

    def torque(self, theta, omega, own, above):
        return -self.stiffness * own[0]

    def rates(self, omega, acceleration, own):
        return [omega - self.rate * own[0]]
'''
MOVE_WITH_IT = """
import numpy as np
from scipy.integrate import solve_ivp

from synth.motion import move
from synth.spec import Spec

command = {"kind": "free", "initial_angle_deg": 10.0, "rest_s": 0.5}
spec = Spec.model_validate(
    {
        "plant": {"a": 2.0, "b": 500.0, "c": 500.0},
        "effects": {"maxwell_element": {"stiffness": 300.0, "rate": 8.0}},
        "recordings": [{"name": "x", "duration_s": 2.0, "command": command}],
    }
)
motion = move(spec, spec.recordings[0], None, 2.0)
times = np.linspace(0.5, 2.0, 301)


def rates(t, x):
    theta, omega, z = x
    return [omega, -2.0 * omega - 500.0 * theta - 300.0 * z, omega - 8.0 * z]


expected = solve_ivp(rates, (0.5, 2.0), [np.radians(10.0), 0.0, 0.0], t_eval=times, rtol=1e-11, atol=1e-13).y
np.testing.assert_allclose(motion.angle(times), expected[0], atol=1e-9)
np.testing.assert_allclose(motion.state(times)[motion.places["maxwell_element"]][0], expected[2], atol=1e-9)
"""


def test_every_effect_of_the_registry_is_a_key_of_the_spec():
    assert {effect.id for effect in REGISTRY} == set(Effects.model_fields)
    assert all(effect.__module__ == f"synth.effects.{effect.id}" for effect in REGISTRY)


def test_effects_act_in_a_unique_order():
    orders = [effect.order for effect in REGISTRY]
    assert orders == sorted(set(orders))


def test_an_effect_with_a_separate_state_is_one_new_file(tmp_path):
    shutil.copytree(ROOT / "synth", tmp_path / "synth", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "synth" / "effects" / "maxwell_element.py").write_text(EFFECT_WITH_A_STATE)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    done = subprocess.run(
        [sys.executable, "-c", MOVE_WITH_IT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.fail(done.stderr)
