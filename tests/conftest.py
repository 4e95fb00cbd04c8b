"""Lets every test say `from support.drawn import draw_session`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
