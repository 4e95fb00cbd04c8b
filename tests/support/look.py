"""The appearance of a film, and the camera's constants."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

SIZE = (640, 480)
BLUR_PX = 0.55
"""Standard deviation of the camera's point spread function, including the pixel's aperture."""


@dataclass(frozen=True)
class Look:
    """Appearance of the film; it does not affect the true angle."""

    facing: str = "right"
    lever_px: float = 170.0
    """Distance from the pivot to the centroid of the lips' area, 120 to 220."""
    pivot_px: tuple[float, float] | None = None
    """None: a position at which the whole head stays in the picture."""
    neutral_deg: float = 8.0
    """Direction pivot→mouth at angle zero, up positive."""
    lips_rgb: tuple[int, int, int] = (190, 35, 40)
    skin: str = "pale"
    marker: str = "ring"
    """ring | ring_white | disc_dark | disc_bright | none."""
    marker_radius_px: float = 13.0
    background: str = "wallpaper"
    """wallpaper | gradient."""
    red_object: str | None = "mug"
    """mug | book | None: static, larger than the lips."""
    red_rgb: tuple[int, int, int] = (182, 40, 46)
    red_place: str = "far"
    """far | near: the lower corner in front of the face, or just outside the nose's circle at lip height."""
    distractor: str | None = None
    """pendulum | led | None: a small red object that moves independently, behind the head."""
    noise: float = 2.0
    """Standard deviation of the sensor noise, grey levels."""
    texture_seed: int = 7

    @property
    def sign(self) -> int:
        """Return the forward direction in the image: 1 to the right, −1 to the left."""
        return {"right": 1, "left": -1}[self.facing]

    @property
    def pivot(self) -> np.ndarray:
        """Return the centre of rotation, px."""
        if self.pivot_px is not None:
            return np.array(self.pivot_px)
        x = 319.5 + self.sign * (-0.62 * self.lever_px + 0.37)
        return np.array([x, 301.3])

    def mouth(self, angles_deg: np.ndarray) -> np.ndarray:
        """Return the centroid of the lips at each angle, px, shape (n, 2)."""
        line = np.radians(self.neutral_deg + np.asarray(angles_deg))
        return self.pivot + self.lever_px * np.column_stack([self.sign * np.cos(line), -np.sin(line)])


def relief(rng: np.random.Generator, shape: tuple[int, int], grain: float) -> np.ndarray:
    """Return a random relief of unit standard deviation whose bumps are `grain` samples wide."""
    coarse = rng.standard_normal((int(shape[0] / grain) + 3, int(shape[1] / grain) + 3)).astype(np.float32)
    bumps = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return bumps / bumps.std()
