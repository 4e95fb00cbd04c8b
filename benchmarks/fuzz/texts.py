"""Read damaged rig, neck, calibration, command, series, track and model files: each is read, or refused in one line.

    PYTHONPATH=.:tests .venv/bin/python -m benchmarks.fuzz.texts [2000] [--seed 1] [--first 0] [--keep build/fuzz]

Valid files are damaged in their bytes (bits, cuts, zeros, other encodings) and in their meaning: absurd numbers and
words in place of numbers; keys and cells that are missing, doubled, moved or of another type; endless nesting and
aliases.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.fuzz.trial import Case, Reader, Trial, arguments, run_all

SECONDS, MOST_BYTES = 60.0, 400 * 2**20

RIG = """\
mouth: {rgb: [190, 35, 40]}
pivot: {near: [218, 298], marker: auto}
facing: right
neutral: 12.5
pixel_error_px: [6, 10]
held_out: [steps, "chirp"]
camera: {calibration: null, tilt_deg: 10.0, row_time_s: 3.0e-5, exposure_s: 0.01}
marks: {mouth: lips, pivot: ear, rate_hz: 30}
sync: {lamp: [12, 20]}
model:
  a: 26.0
  b: 524.0
  c: 508.0
  gravity_deg: null
"""
NECK = """\
linkage: {ground_m: 0.04, coupler_m: 0.05, rocker_m: 0.03, crank_m: 0.02}
head: {mass_kg: 2.31, centre_of_mass_m: 0.08, own_inertia_kg_m2: 0.0058, neutral_deg: 20}
spring:
  rate_N_per_m: 1000
  base_m: 0.05
damping_N_m_s: 0.1
gamma: -0.36
sigma: {mass_kg: 0.01, rate_N_per_m: 10}
"""
CALIBRATION = """\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 800., 0., 320., 0., 800., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.1e-01, 3.0e-02, 0., 0., 0. ]
avg_reprojection_error: 2.5e-01
nr_of_frames: 12
"""
CALIBRATION_XML = """\
<?xml version="1.0"?>
<opencv_storage>
<image_width>640</image_width>
<image_height>480</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>800. 0. 320. 0. 800. 240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>1</rows><cols>5</cols><dt>d</dt>
  <data>-0.21 0.03 0. 0. 0.</data></distortion_coefficients>
</opencv_storage>
"""
COMMAND = "time_s,command_deg\n" + "".join(f"{0.5 * k:.6f},{10 * (k % 2):.5f}\n" for k in range(20))
SERIES = (
    "frame,time_s,angle_deg,sigma_deg,bound_6px_deg,bound_10px_deg,line_deg,mouth_x_px,mouth_y_px,pivot_x_px,"
    "pivot_y_px,status\n"
) + "".join(
    f"{k},{k / 30:.6f},,,,,,,,,,occluded\n"
    if k == 7
    else f"{k},{k / 30:.6f},{5 * np.sin(k / 5):.6f},0.01,1.7,2.8,{5 * np.sin(k / 5) + 30:.6f},400,200,220,300,ok\n"
    for k in range(40)
)
TRACKS = (
    "scorer,DLC,DLC,DLC,DLC,DLC,DLC\nbodyparts,lips,lips,lips,ear,ear,ear\ncoords,x,y,likelihood,x,y,likelihood\n"
) + "".join(f"{k},{400 - k},{200 + k},0.9,220,300,0.99\n" for k in range(30))
_PAIR = {"value": 1.0, "sigma": 0.1}
MODEL = json.dumps(
    {
        "estimator": "oe2",
        "parameters": {"a_per_s": _PAIR, "b_per_s2": _PAIR, "c_per_s2": _PAIR},
        "covariance": {"names": ["a_per_s", "b_per_s2", "c_per_s2"], "matrix": np.eye(3).tolist()},
        "transfer_function": {"numerator": [1.0], "denominator": [1.0, 1.0, 1.0]},
    },
    indent=1,
)
RESPONSES = json.dumps([{"rise_time_s": _PAIR, "overshoot": _PAIR}] * 3)

FILES = {
    "rig": ("rig.yaml", RIG),
    "neck": ("neck.yaml", NECK),
    "calibration": ("lens.yaml", CALIBRATION),
    "calibration in XML": ("lens.xml", CALIBRATION_XML),
    "command": ("steps.command.csv", COMMAND),
    "series": ("steps.angles.csv", SERIES),
    "tracks": ("steps.csv", TRACKS),
    "model": ("model.json", MODEL),
    "responses": ("steps.responses.json", RESPONSES),
}
VALUES = (
    *(
        "nan",
        ".nan",
        "inf",
        "-inf",
        "-.inf",
        "1e308",
        "-1e309",
        "1e-320",
        "0",
        "-1",
        "0x1F",
        "1_000",
        "1:99",
        "٣",
        "١٢",
    ),
    *("9" * 400, "9" * 5000, "0x" + "f" * 5000, "x" * 300, "2001-99-99", "", "null", "true", "<<", "=", "-", "- -"),
    *("!!timestamp x", "!!int ''", "!!bool 7", "!!binary x", "!!python/object/apply:os.system [ls]", "&a [*a]", "*a"),
    *('"\\0"', '"\\ud800"', "'", '"', "[[", "{", "{}", "[]", "[1]", "a\nb", "\x00", "\x1b[2J", "\u2028", "\ud800"),
    *("../../etc/passwd", "/dev/zero"),
)

Damage = Callable[[np.random.Generator, str], bytes]


def cases(count: int, seed: int, first: int = 0) -> Iterator[tuple[int, Case]]:
    """Yield numbered damaged texts; a number's text is always the same."""
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, number])
        reader = list(FILES)[number % len(FILES)]
        damage, done = list(DAMAGES.items())[number // len(FILES) % len(DAMAGES)]
        name, text = FILES[reader]
        yield number, Case(damage, name, done(rng, text), reader)


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def flip_bits(rng: np.random.Generator, text: str) -> bytes:
    """Flip 1 to 8 bits."""
    data = np.frombuffer(_bytes(text), np.uint8).copy()
    at = rng.integers(0, len(data), int(2 ** rng.uniform(0, 3)))
    np.bitwise_xor.at(data, at, (1 << rng.integers(0, 8, len(at))).astype(np.uint8))
    return data.tobytes()


def cut(rng: np.random.Generator, text: str) -> bytes:
    """Remove the end, the start or the middle."""
    a, b = sorted(int(v) for v in rng.integers(0, len(text), 2))
    return _bytes([text[:a], text[a:], text[:a] + text[b:]][rng.integers(3)])


def overwrite(rng: np.random.Generator, text: str) -> bytes:
    """Overwrite a part with zeros or noise."""
    data = _bytes(text)
    n = int(len(data) ** rng.uniform(0.0, 1.0))
    at = int(rng.integers(0, len(data) - n + 1))
    return data[:at] + (bytes(n) if rng.uniform() < 0.5 else rng.bytes(n)) + data[at + n :]


def recode(rng: np.random.Generator, text: str) -> bytes:
    """Write the text in another encoding, or with other line ends or separators."""
    words = re.sub("(?<=[a-z])e", "é", text)
    return [
        words.encode("latin-1", "replace"),
        text.encode("utf-16"),
        text.encode("utf-32"),
        b"\xef\xbb\xbf" * 2 + _bytes(text),
        _bytes(text.replace("\n", "\r")),
        _bytes(text.replace("\n", "\u2028")),
        _bytes(text.replace(",", ";").replace(".", ",")),
        _bytes(text.replace(" ", "\t")),
    ][rng.integers(8)]


def put_value(rng: np.random.Generator, text: str) -> bytes:
    """Replace one to three numbers or words by absurd values."""
    for _ in range(int(rng.integers(1, 4))):
        found = list(re.finditer(r"[\w.+-]+", text))
        one = found[rng.integers(len(found))]
        text = text[: one.start()] + VALUES[rng.integers(len(VALUES))] + text[one.end() :]
    return _bytes(text)


def other_digits(rng: np.random.Generator, text: str) -> bytes:
    """Replace one to eight digits by other digits, signs or exponents, so that most numbers remain numbers."""
    digits = [found.start() for found in re.finditer(r"\d", text)]
    for at in sorted(rng.permutation(digits)[: int(2 ** rng.uniform(0, 3))], reverse=True):
        text = text[:at] + str(rng.choice([*"0123456789", "-", "e5"])) + text[at + 1 :]
    return _bytes(text)


def shuffle(rng: np.random.Generator, text: str) -> bytes:
    """Double, remove, move or indent lines, or shuffle the cells of a line."""
    lines = text.splitlines(keepends=True)
    for _ in range(int(rng.integers(1, 4))):
        i, j = rng.integers(0, len(lines), 2)
        how = rng.integers(5)
        if how == 0:
            lines.insert(int(i), lines[j])
        elif how == 1 and len(lines) > 1:
            lines.pop(int(i))
        elif how == 2:
            lines[i], lines[j] = lines[j], lines[i]
        elif how == 3:
            lines[i] = " " * int(rng.integers(1, 5)) + lines[i]
        else:
            lines[i] = ",".join(rng.permutation(lines[i].rstrip("\n").split(",")).tolist()) + "\n"
    return _bytes("".join(lines))


def other_kind(rng: np.random.Generator, text: str) -> bytes:
    """Replace the text by a file of another kind, or put the start of such a file before it."""
    other = list(FILES.values())[rng.integers(len(FILES))][1]
    return _bytes(other if rng.uniform() < 0.5 else other[: int(rng.integers(1, 200))] + text)


def too_much(rng: np.random.Generator, text: str) -> bytes:
    """Make the text far too large, too deeply nested or too repetitive."""
    n = int(10 ** rng.uniform(2, 5.5))
    laughs = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}' if k else 'x'] * 9)}]\n" for k in range(12))
    brackets = str(rng.choice(["[", "{", "[{", '{"a":', "<a>", "- ", "a: ", "? ", "&a [*a, ", "!!map {"]))
    lines = text.splitlines(keepends=True)
    entity = '<!DOCTYPE a [<!ENTITY l "lol">' + "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 9}">' for k in range(1, 9))
    return _bytes(
        [
            laughs + text,
            text + brackets * n,
            brackets * n,
            lines[0] + lines[-1] * n,
            lines[0].rstrip("\n") + ",x" * n + "\n" + text,
            re.sub(r"\d+", "7" * n, text, count=int(rng.integers(1, 4))),
            text + "".join(f"key{k}: {k}\n" for k in range(n)),
            text.replace("\n", "\n" * (n // 100 + 1)),
            f'<?xml version="1.0"?>{entity}]><opencv_storage>&l8;</opencv_storage>' if "<" in text else text + "\n" * n,
            "\ufeff" + '"' + text * (n // 1000 + 1),
        ][rng.integers(10)]
    )


DAMAGES: dict[str, Damage] = {
    "bits flipped": flip_bits,
    "cut": cut,
    "zeros or noise": overwrite,
    "another encoding": recode,
    "absurd values": put_value,
    "other digits": other_digits,
    "lines and cells moved": shuffle,
    "another kind of file": other_kind,
    "too large or too deep": too_much,
}


def readers() -> dict[str, Reader]:
    """Return the reader of each kind of file, the same as the commands use."""
    from anglecam.camera.calibration import read_calibration
    from anglecam.camera.lens import lens_from_rig
    from anglecam.data.record import record_from_series
    from anglecam.identification.export import read_model
    from anglecam.io.command_csv import read_command
    from anglecam.io.neck_file import read_neck
    from anglecam.io.responses_json import nod_from_responses
    from anglecam.io.rig import Rig, RigKeypoints, read_rig
    from anglecam.io.series_csv import read_series
    from anglecam.measurement.tracks import measure_tracks

    marks = Rig(marks=RigKeypoints(mouth="lips", pivot="ear", rate_hz=30))

    def calibration(path: Path) -> object:
        read_calibration(path)
        return lens_from_rig(Rig.model_validate({"camera": {"calibration": str(path)}}), (640, 480), path)

    return {
        "rig": read_rig,
        "neck": read_neck,
        "calibration": calibration,
        "calibration in XML": calibration,
        "command": read_command,
        "series": lambda path: record_from_series(read_series(path), None, zero_known=False),
        "tracks": lambda path: measure_tracks(path, marks),
        "model": read_model,
        "responses": nod_from_responses,
    }


def main() -> None:
    """Run the cases; exit status 1 if there is a finding."""
    options = arguments(__doc__)
    trial = Trial(readers, seconds=SECONDS, most_bytes=MOST_BYTES)
    sys.exit(1 if run_all(cases(options.cases, options.seed, options.first), trial, options.keep) else 0)


if __name__ == "__main__":
    main()
