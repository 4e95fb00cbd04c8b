"""The moving picture at the top of the README: a clip's overlay above its angle, as far as the film has run.

    .venv/bin/python docs/moving_picture.py CLIP OUT.webp

The README's clip is path-traced, and measured without a rig file (see ``benchmarks/foreign/render.py``):

    build/mitsuba/bin/python benchmarks/foreign/render.py build/foreign ruler
    .venv/bin/python docs/moving_picture.py build/foreign/ruler.avi docs/swing.webp
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from anglecam.data.series import AngleSeries
from anglecam.video.open_film import open_film
from anglecam.video.overlay import draw_frame
from anglecam.workflow.clip import measure_source, open_source

EVERY = 2
"""Every second frame is shown, as long as two frames last."""
CURVE_IN, DPI = 1.4, 100
"""Height of the curve, inches, and its pixels per inch."""
QUALITY = 55
"""Of WebP, 0 to 100."""
COVERAGE = 1.96
"""Standard uncertainties that the shaded interval reaches to each side."""


def curve(series: AngleSeries, shown: int, width_px: int) -> Image.Image:
    """Return the angle up to a frame, with its interval of 95 %.

    Parameters
    ----------
    series : AngleSeries
        Of the whole clip; it sets the axes.
    shown : int
        Number of the last frame to show.
    width_px : int
        Width of the picture, px.
    """
    angle, sigma = np.degrees(series.angle), np.degrees(series.sigma)
    time, angle_shown, reach = series.time[: shown + 1], angle[: shown + 1], COVERAGE * sigma[: shown + 1]
    figure, axes = plt.subplots(figsize=(width_px / DPI, CURVE_IN), dpi=DPI, layout="constrained")
    axes.fill_between(time, angle_shown - reach, angle_shown + reach, alpha=0.3)
    axes.plot(time, angle_shown)
    axes.plot(time[-1:], angle_shown[-1:], "o")
    margin = 0.08 * np.ptp(angle[series.ok])
    axes.set(
        xlim=(series.time[0], series.time[-1]),
        ylim=(np.nanmin(angle) - margin, np.nanmax(angle) + margin),
        xlabel="time, s",
        ylabel="angle, °",
    )
    stored = BytesIO()
    figure.savefig(stored, format="png")
    plt.close(figure)
    return Image.open(stored).convert("RGB")


def main() -> None:
    """Measure the clip and write the picture."""
    clip, out = Path(sys.argv[1]), Path(sys.argv[2])
    measured = measure_source(open_source(clip))
    pictures = []
    for frame in open_film(clip).frames():
        if frame.index % EVERY or frame.image is None:
            continue
        above = Image.fromarray(draw_frame(frame.image, measured, frame.index)[..., ::-1])
        below = curve(measured.series, frame.index, above.width)
        whole = Image.new("RGB", (above.width, above.height + below.height))
        whole.paste(above, (0, 0))
        whole.paste(below, (0, above.height))
        pictures.append(whole)
    lasts_ms = round(1000.0 * EVERY * float(np.median(np.diff(measured.series.time))))
    pictures[0].save(out, save_all=True, append_images=pictures[1:], duration=lasts_ms, loop=0, quality=QUALITY)
    print(f"{out}: {len(pictures)} pictures, {out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
