"""Lets every test say `from support.drawn import draw_session`, and gives every test process a single core."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
# before NumPy is loaded: there are as many test processes as cores, and libraries whose threads wait in a loop for a
# core that another process has are a thousand times slower
os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
