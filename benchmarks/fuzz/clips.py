"""Measure damaged clips: none may affect anything but its own result.

    PYTHONPATH=.:tests .venv/bin/python -m benchmarks.fuzz.clips [2000] [--seed 1] [--first 0] [--keep build/fuzz]

A rig moves for ten frames of 160 × 120 px. It is filmed as FFV1 in Matroska, MJPEG in AVI, H.264 in MP4 and MJPEG in
MOV, and each film is damaged in a way that depends on seed and number alone. `measure_clip` reads the damaged film in a
separate process with limits on time and memory.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import av
import cv2
import numpy as np

from benchmarks.fuzz.trial import Case, Reader, Trial, arguments, run_all
from support.drawn import RATE_HZ, Look, draw_frames

SIZE, FRAMES = (160, 120), 10
FILMS = {
    "mkv": ("ffv1", "bgr0"),
    "avi": ("mjpeg", "yuvj420p"),
    "mp4": ("libx264", "yuv420p"),
    "mov": ("mjpeg", "yuvj420p"),
}
SECONDS, MOST_BYTES = 120.0, 1024 * 2**20
ABSURD = (0, 1, 2, 0x7FFF, 0x8000, 0xFFFF, 100_000_000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
BOXES = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"dinf", b"edts", b"udta")
"""Boxes of MP4 and MOV that contain other boxes."""
CHUNKS = (b"RIFF", b"LIST")
"""Chunks of AVI that contain other chunks."""

Damage = Callable[[np.random.Generator, str, bytes], bytes]


@cache
def films() -> dict[str, bytes]:
    """Return the undamaged film in every container, by its ending."""
    angles = 9 * np.cos(np.pi * np.arange(FRAMES) / (FRAMES - 1))
    drawn = [
        cv2.resize(f, SIZE, interpolation=cv2.INTER_AREA) for f in draw_frames(Look(marker="ring"), angles, seed=1)
    ]
    made = {}
    with tempfile.TemporaryDirectory() as folder:
        for ending, (codec, pixels) in FILMS.items():
            path = Path(folder) / f"film.{ending}"
            with av.open(str(path), "w") as container:
                stream = container.add_stream(codec, rate=RATE_HZ)
                stream.width, stream.height, stream.pix_fmt = *SIZE, pixels
                for frame in drawn:
                    container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, "bgr24")))
                container.mux(stream.encode())
            made[ending] = path.read_bytes()
    return made


def cases(count: int, seed: int, first: int = 0) -> Iterator[tuple[int, Case]]:
    """Yield numbered damaged clips; a number's clip is always the same."""
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, number])
        ending = list(FILMS)[number % len(FILMS)]
        name, damage = list(DAMAGES.items())[number // len(FILMS) % len(DAMAGES)]
        content = damage(rng, ending, films()[ending])
        if name == "wrong ending":
            ending = str(rng.choice([e for e in (*FILMS, "txt", "csv") if e != ending]))
        yield number, Case(name, f"clip.{ending}", content)


def flip_bits(rng: np.random.Generator, ending: str, film: bytes, within: slice = slice(None)) -> bytes:
    """Flip 1 to 64 bits."""
    data = np.frombuffer(film, np.uint8).copy()
    part = data[within]
    at = rng.integers(0, len(part), int(2 ** rng.uniform(0, 6)))
    np.bitwise_xor.at(part, at, (1 << rng.integers(0, 8, len(at))).astype(np.uint8))
    return data.tobytes()


def flip_header_bits(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Flip bits where a container describes its content: at the start, in MP4 and MOV at the end."""
    return flip_bits(rng, ending, film, slice(-1200, None) if ending in ("mp4", "mov") else slice(0, 600))


def cut(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Remove the end or the start."""
    at = int(rng.integers(0, len(film)))
    return film[:at] if rng.uniform() < 0.8 else film[at:]


def swap_header(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Replace the start by that of another film."""
    n = int(2 ** rng.uniform(2, 11))
    return _other(rng, ending)[:n] + film[n:]


def zero_bytes(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Overwrite a part, or all of it, with zeros or noise."""
    n = int(len(film) ** rng.uniform(0.1, 1.0))
    at = int(rng.integers(0, len(film) - n + 1))
    return film[:at] + (bytes(n) if rng.uniform() < 0.7 else rng.bytes(n)) + film[at + n :]


def keep(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Leave the content unchanged; the file gets another ending."""
    return film


def absurd_size(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Replace width and height by absurd ones wherever they are stored."""
    width, height = (int(rng.choice([0, 1, 33, 4096, 16_384, 32_768, 65_535, 2**31 - 1, 2**32 - 1])) for _ in range(2))
    if ending == "mkv":  # PixelWidth and PixelHeight; they overwrite the display's width and height
        start = film.index(bytes([0xB0, 0x81, SIZE[0], 0xBA, 0x81, SIZE[1]]))
        sizes = b"\xb0\x84" + width.to_bytes(4, "big") + b"\xba\x84" + height.to_bytes(4, "big") + b"\xec\x80"
        return film[:start] + sizes + film[start + len(sizes) :]
    for order, bytes_each in (("little", 4), ("big", 2), ("big", 4)):
        for true, claimed in zip(SIZE, (width, height), strict=True):
            if rng.uniform() < 0.8:
                claimed %= 256**bytes_each
                film = film.replace(true.to_bytes(bytes_each, order), claimed.to_bytes(bytes_each, order))
    return film


def absurd_number(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Write absurd numbers into a box or chunk: counts, times, lengths."""
    parts = _parts(ending, film)
    data = bytearray(film)
    for _ in range(int(rng.integers(1, 4))):
        start, end = parts[rng.integers(len(parts))]
        room = min(end - start, 128) // 4
        at = start + 4 * int(rng.integers(0, max(room, 1)))
        order = "little" if ending == "avi" else "big"
        data[at : at + 4] = int(rng.choice(ABSURD)).to_bytes(4, order)
    return bytes(data)


def splice(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Continue with a part of another film, or of the same film again."""
    other = _other(rng, ending) if rng.uniform() < 0.7 else film
    return film[: int(rng.integers(1, len(film)))] + other[int(rng.integers(0, len(other))) :]


def duplicate(rng: np.random.Generator, ending: str, film: bytes) -> bytes:
    """Repeat a box or chunk up to a thousand times; the lengths of the boxes around it are corrected or not."""
    parts = _parts(ending, film)
    start, end = parts[rng.integers(len(parts))]
    again = film[start:end] * max(1, min(int(10 ** rng.uniform(0, 3)), 2_000_000 // (end - start)))
    data = bytearray(film[:end] + again + film[end:])
    if rng.uniform() < 0.7 and ending in ("avi", "mp4", "mov"):
        for s, e in parts:
            if s <= start and end <= e and (s, e) != (start, end):
                at, order = (s + 4, "little") if ending == "avi" else (s, "big")
                size = int.from_bytes(data[at : at + 4], order) + len(again)
                data[at : at + 4] = (size % 2**32).to_bytes(4, order)
    return bytes(data)


DAMAGES: dict[str, Damage] = {
    "bits flipped": flip_bits,
    "bits of the header flipped": flip_header_bits,
    "cut off": cut,
    "header of another film": swap_header,
    "zeros or noise": zero_bytes,
    "wrong ending": keep,
    "absurd size of picture": absurd_size,
    "absurd counts and times": absurd_number,
    "two films spliced": splice,
    "boxes repeated": duplicate,
}


def _other(rng: np.random.Generator, ending: str) -> bytes:
    return films()[str(rng.choice([e for e in FILMS if e != ending]))]


def _parts(ending: str, film: bytes) -> list[tuple[int, int]]:
    """Return start and end of every box or chunk, including nested ones; in Matroska, of evenly spaced pieces."""
    if ending == "mkv":
        return [(at, at + 64) for at in range(0, min(len(film), 4096) - 64, 16)]
    found: list[tuple[int, int]] = []
    pending = [(0, len(film))]
    while pending:
        at, end = pending.pop()
        while at + 8 <= end:
            kind = film[at : at + 4] if ending == "avi" else film[at + 4 : at + 8]
            if ending == "avi":
                size = 8 + int.from_bytes(film[at + 4 : at + 8], "little")
            else:
                size = int.from_bytes(film[at : at + 4], "big")
            if size < 8 or at + size > end:
                break
            found.append((at, at + size))
            if kind in CHUNKS:
                pending.append((at + 12, at + size))
            elif kind in BOXES:
                pending.append((at + 8, at + size))
            at += size + (size % 2 if ending == "avi" else 0)
    return found


def readers() -> dict[str, Reader]:
    """Return the reader of clips."""
    from anglecam.io.rig import Rig
    from anglecam.measurement.clip import measure_clip
    from anglecam.video.open_film import open_film

    cv2.setNumThreads(1)
    av.logging.set_level(av.logging.PANIC)
    return {"clip": lambda path: measure_clip(open_film(path), Rig())}


def main() -> None:
    """Run the cases; exit status 1 if there is a finding."""
    options = arguments(__doc__)
    trial = Trial(readers, seconds=SECONDS, most_bytes=MOST_BYTES)
    sys.exit(1 if run_all(cases(options.cases, options.seed, options.first), trial, options.keep) else 0)


if __name__ == "__main__":
    main()
