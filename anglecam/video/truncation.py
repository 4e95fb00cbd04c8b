"""Detect a film whose file is shorter than its container states.

A decoder reads what is left of a cut file and ends without an error. The container states how long the file must be:
the RIFF size of AVI, the box sizes of MP4 and MOV, the segment size of Matroska. Frame counts in headers are not used,
because they are often wrong in files that are complete.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

_UNKNOWN_RIFF_SIZES = (0, 0xFFFFFFFF)
"""Sizes of a RIFF chunk written by programs that cannot seek back."""
_SEGMENT = 0x18538067


def is_cut_short(path: Path) -> bool:
    """Return whether bytes are missing at the end of an AVI, MP4, MOV or Matroska file.

    Parameters
    ----------
    path : Path
        The film.

    Returns
    -------
    bool
        False as well where the container does not state its length or is of another kind.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(12)
        stream.seek(0)
        if head[:4] == b"RIFF":
            return _riff_end(stream, size) > size
        if head[:4] == b"\x1a\x45\xdf\xa3":
            return _matroska_end(stream) > size
        if head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
            return _boxes_end(stream, size) > size
    return False


def _riff_end(stream: BinaryIO, size: int) -> int:
    """Follow the top-level RIFF chunks (OpenDML files have several) to the stated end of the last one."""
    position = 0
    while position < size:
        stream.seek(position)
        header = stream.read(8)
        if header[:4] != b"RIFF":
            break
        length = int.from_bytes(header[4:], "little")
        if length in _UNKNOWN_RIFF_SIZES:
            return size
        # A chunk of odd length is padded, but the last one of a file need not be.
        position += 8 + length
        if position < size:
            position += length % 2
    return position


def _boxes_end(stream: BinaryIO, size: int) -> int:
    """Follow the top-level boxes of an ISO base media file (ISO/IEC 14496-12, 4.2) to the end of the last one."""
    position = 0
    while position < size:
        stream.seek(position)
        header = stream.read(16)
        length = int.from_bytes(header[:4], "big")
        if length == 0:  # by definition: to the end of the file
            return size
        if length == 1:
            length = int.from_bytes(header[8:16], "big")
        if length < 8:
            return size
        position += length
    return position


def _matroska_end(stream: BinaryIO) -> int:
    """Return the stated end of a Matroska file's segment (RFC 8794, 4–6), 0 where its size is unknown."""
    for _ in range(2):
        element = _read_vint(stream, keep_marker=True)
        length = _read_vint(stream, keep_marker=False)
        if length is None:
            return 0
        if element == _SEGMENT:
            return stream.tell() + length
        stream.seek(length, 1)
    return 0


def _read_vint(stream: BinaryIO, *, keep_marker: bool) -> int | None:
    """Read one variable-length integer; all value bits set means an unknown size."""
    first = stream.read(1)
    if not first or first[0] == 0:
        return None
    more = 8 - first[0].bit_length()
    raw = int.from_bytes(first + stream.read(more), "big")
    if keep_marker:
        return raw
    value_bits = 7 * (more + 1)
    value = raw & ((1 << value_bits) - 1)
    return None if value == (1 << value_bits) - 1 else value
