"""Faulty inputs as they occur in practice: each function writes one file into a folder and returns its path."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np

from .drawn import Look, draw_frames, write_clip
from .head import SKIN


def empty_clip(folder: Path, name: str = "empty") -> Path:
    """Write an empty file."""
    path = folder / f"{name}.avi"
    path.write_bytes(b"")
    return path


def text_clip(folder: Path, name: str = "text") -> Path:
    """Write a text file that is named like a clip."""
    path = folder / f"{name}.avi"
    path.write_text("The camera's memory card was full; please see the other folder.\n" * 40)
    return path


def truncated_clip(folder: Path, good: Path, name: str = "truncated", share: float = 0.6) -> Path:
    """Write the first part of a good clip's bytes: it has frames but no index, which would be at the end."""
    path = folder / f"{name}.avi"
    whole = good.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    return path


def zero_frame_clip(folder: Path, name: str = "zero_frames") -> Path:
    """Write a valid AVI header without any picture."""
    path = folder / f"{name}.avi"
    with av.open(str(path), "w", format="avi") as container:
        stream = container.add_stream("mjpeg", rate=30)
        stream.width, stream.height, stream.pix_fmt = 640, 480, "yuvj420p"
        container.start_encoding()
    return path


def clip_without_mouth(folder: Path, name: str = "no_mouth", frames: int = 30) -> Path:
    """Write a clip of a nodding head without lipstick and with nothing red in the picture."""
    path = folder / f"{name}.avi"
    skin = tuple(int(0.93 * v) for v in SKIN["pale"][0])
    look = Look(lips_rgb=skin, red_object=None)
    write_clip(path, draw_frames(look, 8 * np.sin(np.arange(frames) / 4)))
    return path


def clip_of_an_empty_room(folder: Path, name: str = "empty_room", frames: int = 30) -> Path:
    """Write a clip of a wall."""
    path = folder / f"{name}.avi"
    rng = np.random.default_rng(2)
    wall = cv2.GaussianBlur(rng.uniform(60, 190, (480, 640, 3)).astype(np.float32), (0, 0), 6)
    noisy = (np.clip(wall + rng.normal(0, 2, wall.shape), 0, 255).astype(np.uint8) for _ in range(frames))
    write_clip(path, noisy)
    return path


def command_with_unreadable_rows(folder: Path, name: str) -> Path:
    """Write a command file in which two rows hold no numbers."""
    path = folder / f"{name}.command.csv"
    path.write_text("time_s,command_deg\n0.0,0.0\n1.0,ten\n2.0,5.0\n3.0;0.0\n")
    return path


def command_backwards(folder: Path, name: str) -> Path:
    """Write a command file whose times decrease once."""
    path = folder / f"{name}.command.csv"
    path.write_text("time_s,command_deg\n0.0,0.0\n1.0,10.0\n3.0,0.0\n2.0,-10.0\n4.0,0.0\n")
    return path


def rig_with_unknown_key(folder: Path) -> Path:
    """Write a rig file with a misspelt key."""
    path = folder / "rig.yaml"
    path.write_text("mouth: auto\nfacing: right\npivott: {near: [218, 298]}\n")
    return path


def rig_that_is_not_yaml(folder: Path) -> Path:
    """Write a rig file with unclosed brackets."""
    path = folder / "rig.yaml"
    path.write_text("mouth: {rgb: [190, 35\npivot: near: ][ 218\n\t- facing\n")
    return path


def angles_with_text(folder: Path, name: str = "words") -> Path:
    """Write an angle series with a word in place of a number."""
    path = folder / f"{name}.angles.csv"
    rows = [f"{k / 30:.6f},{'lost' if k == 20 else round(5 * np.sin(k / 5), 4)}\n" for k in range(60)]
    path.write_text("time_s,angle_deg\n" + "".join(rows))
    return path
