"""Measures the speed and the edge errors of `synth`'s two engines, of two peers, and the speed of writing frames.

Every renderer draws the same rig at the same poses on one core, in a separate process, and returns the picture as an
array. A frame's time is the median of many. The peers use their default shading: trimesh with embree gives each ray the
light of the triangle it hits, and rebuilds its tree for every frame because the rig moves; vtk computes the lighting
and takes four samples per pixel.

    .venv/bin/python benchmarks/rendering.py [frames]

The peers are not dependencies of the project: pip install --no-deps embreex vtk.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from statistics import median

os.environ["LP_NUM_THREADS"] = "1"  # for every renderer that uses Mesa
os.environ["OMP_NUM_THREADS"] = "1"

import av
import numpy as np
import trimesh

from synth.camera import Pinhole, aim
from synth.draw.edge_error import edge_error
from synth.draw.light import AMBIENT, LAMPS, TONE
from synth.mechanism import Part, build, mouth_centre, poses
from synth.spec import Spec

SIZES = ((640, 480), (1280, 720))
Draw = Callable[[dict[str, np.ndarray]], np.ndarray]


def scene(size: tuple[int, int]) -> tuple[list[Part], Pinhole, list[dict[str, np.ndarray]]]:
    """Set up the rig of the default spec, scaled to the picture's height, at poses of a slow nod."""
    rig = {"lever_px": size[1] / 2.4, "pivot_px": (size[0] * 0.375, size[1] * 0.625)}
    recording = {"name": "r", "duration_s": 1.0, "command": {"kind": "step"}}
    spec = Spec(camera={"size": size}, rig=rig, recordings=[recording])
    parts = build(spec)
    lever = float(np.hypot(*mouth_centre(parts, spec.camera.distance_m)))
    placed = [poses(spec.rig, angle) for angle in np.linspace(-0.2, 0.25, 16)]
    return parts, aim(spec, lever), placed


def with_raster(quality: str, parts: list[Part], camera: Pinhole) -> Draw:
    from synth.draw.raster import Raster

    engine = Raster(parts, camera, quality, 1.0)
    return lambda placed: engine.draw(camera, placed, slice(0, camera.size[1]))


def with_gl(quality: str, parts: list[Part], camera: Pinhole) -> Draw:
    from synth.draw.gl import Gl

    engine = Gl(parts, camera, quality, 1.0)
    return lambda placed: engine.draw(camera, placed, slice(0, camera.size[1]))


def with_embree(_: str, parts: list[Part], camera: Pinhole) -> Draw:
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    width, height = camera.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    seen = np.column_stack([x.ravel() - camera.principal_px[0], camera.principal_px[1] - y.ravel()])
    rays = np.column_stack([seen / camera.focal_px, np.full(len(seen), -1.0)]) @ camera.rotation
    eyes = np.tile(camera.rotation.T @ [0.0, 0.0, camera.distance_m], (len(rays), 1))
    firsts = np.cumsum([0, *(len(part.mesh.vertices) for part in parts)])
    faces = np.vstack([part.mesh.faces + first for part, first in zip(parts, firsts, strict=False)])
    colours = np.vstack([part.colours for part in parts])[faces].mean(axis=1) / 255

    def draw(placed: dict[str, np.ndarray]) -> np.ndarray:
        vertices = np.vstack([p.mesh.vertices @ placed[p.body][:3, :3].T + placed[p.body][:3, 3] for p in parts])
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        falling = AMBIENT + sum(s * np.maximum(mesh.face_normals @ lamp, 0.0) for lamp, s in LAMPS)
        light = np.vstack([colours * falling[:, None] ** (1 / TONE), np.zeros(3)]).astype(np.float32)
        return light[RayMeshIntersector(mesh).intersects_first(eyes, rays)].reshape(height, width, 3)

    return draw


def with_vtk(_: str, parts: list[Part], camera: Pinhole) -> Draw:
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

    width, height = camera.size
    window, stage = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetSize(width, height)
    window.SetMultiSamples(4)
    window.AddRenderer(stage)
    matrices = {}
    for body in sorted({part.body for part in parts}):
        mesh = trimesh.util.concatenate([part.mesh for part in parts if part.body == body])
        data, cells, mapper, actor = vtk.vtkPolyData(), vtk.vtkCellArray(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk(mesh.vertices, deep=True))
        indices = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).astype(np.int64)
        cells.SetCells(len(mesh.faces), numpy_to_vtkIdTypeArray(indices.ravel(), deep=True))
        data.SetPoints(points)
        data.SetPolys(cells)
        colours = np.vstack([part.colours for part in parts if part.body == body]).astype(np.uint8)
        data.GetPointData().SetScalars(numpy_to_vtk(colours, deep=True))
        data.GetPointData().SetNormals(numpy_to_vtk(np.array(mesh.vertex_normals), deep=True))
        mapper.SetInputData(data)
        actor.SetMapper(mapper)
        matrices[body] = vtk.vtkMatrix4x4()
        actor.SetUserMatrix(matrices[body])
        stage.AddActor(actor)
    view = stage.GetActiveCamera()
    view.SetPosition(0.0, 0.0, camera.distance_m)
    view.SetFocalPoint(0.0, 0.0, 0.0)
    view.SetViewAngle(float(np.degrees(2 * np.arctan(height / 2 / camera.focal_px))))
    view.SetWindowCenter(1 - 2 * camera.principal_px[0] / width, 2 * camera.principal_px[1] / height - 1)
    view.SetClippingRange(0.5, 6.0)
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.ShouldRerenderOff()

    def draw(placed: dict[str, np.ndarray]) -> np.ndarray:
        for body, matrix in matrices.items():
            matrix.DeepCopy(placed[body].ravel())
        window.Render()
        grab.Modified()
        grab.Update()
        return vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(height, width, 3)[::-1]

    return draw


RENDERERS = {
    **{f"Raster, {quality}": (with_raster, quality, None) for quality in ("draft", "standard", "metrology")},
    **{f"Gl (pyrender), {quality}": (with_gl, quality, None) for quality in ("draft", "standard", "metrology")},
    "trimesh + embree, one ray a pixel": (with_embree, "", "embreex"),
    "vtk, 4 samples a pixel": (with_vtk, "", "vtk"),
}


def seconds_a_frame(name: str, size: tuple[int, int], frames: int) -> float:
    make, quality, _ = RENDERERS[name]
    parts, camera, placed = scene(size)
    draw = make(quality, parts, camera)
    draw(placed[0])
    return median(_timed(lambda k: draw(placed[k % len(placed)]), frames))


def seconds_to_write(size: tuple[int, int], frames: int) -> tuple[float, float]:
    """Return the median time to write a frame to a raw .npy file, and the mean time to write it as FFV1."""
    parts, camera, placed = scene(size)
    draw = with_raster("standard", parts, camera)
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 2.0, (*size[::-1], 3))  # without noise FFV1 would be unrealistically fast
    films = [np.clip(np.rint(255 * draw(pose) + noise), 0, 255).astype(np.uint8) for pose in placed]
    with tempfile.TemporaryDirectory() as folder:
        raw = median(_timed(lambda k: np.save(Path(folder) / f"{k}.npy", films[k % len(films)]), frames))
        began = time.perf_counter()
        with av.open(str(Path(folder) / "film.mkv"), "w") as container:
            stream = container.add_stream("ffv1", rate=30)
            stream.width, stream.height, stream.pix_fmt = *size, "bgr0"
            stream.codec_context.thread_count = 1
            for k in range(frames):
                frame = av.VideoFrame.from_ndarray(films[k % len(films)], format="rgb24")
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        return raw, (time.perf_counter() - began) / frames


def edge(name: str) -> float:
    """Return the RMS displacement of straight edges, px."""
    from synth.draw.gl import Gl
    from synth.draw.raster import Raster

    engine, quality = (Raster if name.startswith("Raster") else Gl), RENDERERS[name][1]
    return edge_error(engine, quality).half_plane_px


def alone(function: Callable, *arguments: object) -> object:
    """Call a function in a fresh process, so that two renderers' graphics libraries are never in the same process."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def _timed(work: Callable[[int], object], times: int) -> Iterator[float]:
    for k in range(times):
        began = time.perf_counter()
        work(k)
        yield time.perf_counter() - began


def main(frames: int) -> None:
    triangles = sum(len(part.mesh.faces) for part in scene(SIZES[0])[0])
    writing = {size: alone(seconds_to_write, size, frames) for size in SIZES}
    print(f"{date.today():%d %B %Y}, {triangles} triangles, one core, {frames} frames each\n")
    heads = [f"{w} × {h}, fps | × npy | × FFV1" for w, h in SIZES]
    print(f"| | straight edge, RMS px | {' | '.join(heads)} |")
    print("| --- | --- |" + " --- | --- | --- |" * len(SIZES))
    for name, (make, _, package) in RENDERERS.items():
        if package is not None and find_spec(package) is None:
            print(f"{name}: left out, needs pip install --no-deps {package}", file=sys.stderr)
            continue
        cells = [f"{alone(edge, name):.2g}" if make in (with_raster, with_gl) else "–"]
        for size in SIZES:
            drawing = alone(seconds_a_frame, name, size, frames)
            raw, ffv1 = writing[size]
            cells += [
                f"{1 / drawing:.2g}" if drawing > 0.1 else f"{1 / drawing:.0f}",
                f"{drawing / raw:.1f}",
                f"{drawing / ffv1:.1f}",
            ]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    rates = [f"{1 / raw:.0f}, FFV1 {1 / ffv1:.0f} fps | | " for raw, ffv1 in writing.values()]
    print(f"| writing: raw .npy | | {'| '.join(rates)}|")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
