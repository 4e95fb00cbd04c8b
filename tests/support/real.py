"""Where measured data and films lie that are not shipped: beside the checkout. Tests skip where they are absent."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT.parent / "shared" / "real"
