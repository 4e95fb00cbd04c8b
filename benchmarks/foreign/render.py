"""Draws the films of `scenes` by path tracing, with their truth.

    python3 -m venv build/mitsuba
    build/mitsuba/bin/pip install -r benchmarks/foreign-requirements.txt
    build/mitsuba/bin/python benchmarks/foreign/render.py FOLDER [name ...]

Writes NAME.avi (FFV1) or NAME.h264.mp4, NAME.truth.csv and NAME.region.txt. The radiance of every frame is kept in
FOLDER/radiance, so that an interrupted run goes on where it stopped. The camera blurs, adds noise of 2 grey levels and
rounds: exposure is a single instant, the tone curve is sRGB's.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import Any

os.environ.setdefault("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1")

import av
import drjit as dr
import mitsuba as mi
import numpy as np
from scenes import RATE_HZ, SCENES, Scene
from scipy.ndimage import gaussian_filter

mi.set_variant("llvm_ad_rgb")

BLUR_PX = 0.5
"""Standard deviation of the lens's blur, besides the pixels' own area."""
NOISE_GREY = 2.0
WHITE = 1.1
"""Radiance that saturates the sensor."""
THREADS = 1
H264 = ("head_above", "ball_dark", "wheel")
"""Films that are also written as H.264, crf 18."""


def shaped(shape: dict[str, Any], folder: Path, body: Any) -> dict[str, Any]:
    """Return Mitsuba's dictionary of one shape, moved with the body."""
    rest = dict(shape)
    kind = rest["type"]
    if kind == "constant":
        return rest
    if kind == "lamp":
        place = mi.ScalarTransform4f().look_at(rest["place"], rest["target"], [0.0, 0.3, 1.0])
        light = {"type": "area", "radiance": {"type": "rgb", "value": [rest["radiance"]] * 3}}
        return {"type": "rectangle", "to_world": place.scale([rest["side"]] * 3), "emitter": light}
    bsdf = _material(rest["bsdf"])
    place = body @ mi.ScalarTransform4f().translate(list(rest["place"])).rotate([0, 0, 1], rest["turn_deg"])
    scale = list(rest["scale"])
    if kind == "rod":  # a cylinder from the place downwards
        place = place.rotate([1, 0, 0], 90.0)
        kind = "cylinder"
    made = {"type": kind, "to_world": place.scale(scale), "bsdf": {"type": "twosided", "inner": bsdf}}
    if kind == "ply":
        made["filename"] = str(folder / rest["filename"])
    return made


def _material(bsdf: dict[str, Any]) -> dict[str, Any]:
    made = dict(bsdf)
    for name, slot in bsdf.items():
        if isinstance(slot, dict) and slot.get("type") == "bitmap":
            made[name] = {**slot, "data": mi.TensorXf(slot["data"])}
    return made


def radiance(
    scene: Scene, moving: list[dict[str, Any]], still: list[dict[str, Any]], folder: Path, angle_deg: float, seed: int
) -> np.ndarray:
    """Render one frame: linear radiance (h, w, 3)."""
    camera, axis = scene.camera, scene.camera.place(scene.pivot_px)
    width, height = camera.size
    body = mi.ScalarTransform4f().translate(axis.tolist()).rotate([0, 0, 1], angle_deg)
    none = mi.ScalarTransform4f()
    shapes = [shaped(s, folder, body) for s in moving] + [shaped(s, folder, none) for s in still]
    world: dict[str, Any] = {f"shape{k}": shape for k, shape in enumerate(shapes)}
    world["type"] = "scene"
    world["integrator"] = {"type": "path", "max_depth": 3}
    world["sensor"] = {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(width / 2 / camera.focal_px))),
        "to_world": mi.ScalarTransform4f().look_at([0, 0, camera.distance], [0, 0, 0], [0, 1, 0]),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
        "sampler": {"type": "multijitter", "sample_count": scene.samples},
    }
    picture = np.array(mi.render(mi.load_dict(world), seed=seed))
    return picture[..., :3].astype(np.float16)


def exposed(light: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the picture (h, w, 3) uint8 that the camera makes of the radiance."""
    blurred = gaussian_filter(light.astype(float), (BLUR_PX, BLUR_PX, 0.0), mode="nearest")
    linear = np.clip(blurred / WHITE, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    noisy = 255.0 * encoded + rng.normal(0.0, NOISE_GREY, encoded.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def write_film(path: Path, pictures: list[np.ndarray], codec: str) -> None:
    """Encode pictures (h, w, 3), red first."""
    height, width = pictures[0].shape[:2]
    with av.open(str(path), "w") as container:
        options = {"crf": "18"} if codec == "libx264" else {}
        stream = container.add_stream(codec, rate=Fraction(RATE_HZ), options=options)
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuv420p" if codec == "libx264" else "bgr0"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


def write_truth(scene: Scene, folder: Path, times: np.ndarray, angles: np.ndarray) -> None:
    """Write angles and the places of mark and pivot in the plane of motion."""
    axis = scene.camera.place(scene.pivot_px)
    with (folder / f"{scene.name}.truth.csv").open("w", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(["frame", "time_s", "angle_deg", "mark_x_px", "mark_y_px", "pivot_x_px", "pivot_y_px"])
        for k, (t, angle) in enumerate(zip(times, angles, strict=True)):
            c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
            x, y, z = scene.mark_cm
            mark = scene.camera.project(axis + np.array([c * x - s * y, s * x + c * y, z]))
            rows.writerow([k, *(f"{v:.9g}" for v in (t, angle, *mark, *scene.pivot_px))])
    (folder / f"{scene.name}.region.txt").write_text(" ".join(map(str, scene.region_px)))


def draw(scene: Scene, folder: Path) -> None:
    """Render, expose and encode one film."""
    kept = folder / "radiance" / scene.name
    kept.mkdir(parents=True, exist_ok=True)
    times = np.arange(scene.frames) / RATE_HZ
    angles = np.asarray(scene.angle_deg(times))
    write_truth(scene, folder, times, angles)
    rng = np.random.default_rng(sum(scene.name.encode()))
    pictures = []
    with tempfile.TemporaryDirectory() as meshes:
        moving = scene.body(Path(meshes))
        still = [*scene.still(scene.camera.place(scene.pivot_px), Path(meshes)), *scene.lights]
        for k, angle in enumerate(angles):
            file = kept / f"{k:04d}.npy"
            if not file.exists():
                np.save(file, radiance(scene, moving, still, Path(meshes), float(angle), k))
            pictures.append(exposed(np.load(file), rng))
    write_film(folder / f"{scene.name}.avi", pictures, "ffv1")
    if scene.name in H264:
        write_film(folder / f"{scene.name}.h264.mp4", pictures, "libx264")


def main() -> None:
    """Draw the films that are named, or all."""
    folder, names = Path(sys.argv[1]), sys.argv[2:] or list(SCENES)
    dr.set_thread_count(THREADS)
    for name in names:
        draw(SCENES[name], folder)
        print(name, flush=True)


if __name__ == "__main__":
    main()
