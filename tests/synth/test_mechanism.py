import itertools
import math

import numpy as np
import pytest
import trimesh

from anglecam.neck import FourBar, reach
from synth import mechanism
from synth.camera import Pinhole, aim
from synth.mechanism import Part, mouth_centre, neutral_rocker, poses, prop_poses, props, suspension
from synth.mechanism.curves import MM, ellipse
from synth.mechanism.head import head, lips_outline
from synth.mechanism.inflate import Lattice, inflate
from synth.mechanism.paint import texture
from synth.mechanism.profile import Profile
from synth.mechanism.scene import LENS_PX
from synth.mechanism.springs import SPRINGS
from synth.spec import Rig, Spec

SKINS = {"pale": (222, 178, 150), "olive": (186, 140, 104), "brown": (132, 88, 62), "dark": (82, 54, 40)}


def spec(**sections: object) -> Spec:
    human = sections.get("rig", {}).get("neck") == "human"
    command = {"kind": "nod"} if human else {"kind": "triangle", "amplitude_deg": 5, "period_s": 2}
    return Spec.model_validate({"recordings": [{"name": "a", "duration_s": 1, "command": command}], **sections})


_built: dict[str, list[Part]] = {}


def build(wanted: Spec) -> list[Part]:
    """Build each rig once."""
    key = wanted.model_dump_json()
    if key not in _built:
        _built[key] = mechanism.build(wanted)
    return _built[key]


def camera_of(wanted: Spec) -> Pinhole:
    return aim(wanted, float(np.hypot(*mouth_centre(build(wanted), wanted.camera.distance_m))))


def seen(part: Part, pose: np.ndarray, camera: Pinhole) -> np.ndarray:
    return camera.project(part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3])


def named(parts: list[Part], name: str) -> Part:
    return next(part for part in parts if part.name == name)


# The head


@pytest.mark.parametrize(
    ("whose", "neck"),
    [
        ("female", "linkage"),
        ("male", "human"),
        pytest.param("female", "human", marks=pytest.mark.sweep),
        pytest.param("male", "linkage", marks=pytest.mark.sweep),
    ],
)
def test_the_head_is_a_closed_body_of_human_size_and_its_regions_share_their_borders(whose, neck):
    rig = Rig(head=whose, neck=neck, marker="none")
    mesh = trimesh.util.concatenate([part.mesh for part in head(rig, np.random.default_rng(0))])
    vertices, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)  # bitwise, or there are gaps
    whole = trimesh.Trimesh(vertices, welded.ravel()[mesh.faces], process=False)
    assert whole.is_watertight
    assert whole.is_winding_consistent
    assert 0.0015 < whole.volume < 0.0045  # m³; positive because the normals point outwards
    width, height, depth = np.ptp(vertices, axis=0)
    assert 0.2 < width < 0.28
    assert 0.19 < height < 0.23
    assert 0.12 < depth < 0.16


def test_an_inflated_circle_is_a_ball():
    radius = 50 * MM
    body = inflate(Profile(ellipse((0, 0), (50, 50), 1 * MM), {}), radius, [Lattice(3 * MM)], [Lattice(4 * MM)])
    # φ = (R² − r²)/4 on a disc, so that sqrt(φ/φ_max) is exactly the ball
    np.testing.assert_allclose(np.linalg.norm(body.vertices, axis=1), radius, atol=0.2 * MM)


@pytest.mark.parametrize("whose", ["female", "male"])
def test_the_lips_touch_the_outline_and_stand_in_front_of_the_shaft(whose):
    parts = build(spec(rig={"head": whose}))
    x, y = mouth_centre(parts, 1.5)
    assert 0.1 < x < 0.125
    assert abs(np.degrees(np.arctan2(y, x))) < 5
    lips, skin = (named(parts, name).mesh.vertices for name in ("lips", "skin"))
    front = lips[(lips[:, 2] == 0) & (lips[:, 0] > 0.115)]
    assert np.ptp(front[:, 1]) > 0.02
    assert len(set(map(tuple, lips)) & set(map(tuple, skin))) > 40


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_texture_has_no_structure_finer_than_4_mm_and_an_amplitude_of_a_few_grey_levels(seed):
    side, step = 128, 1 * MM
    x, y = np.meshgrid(np.arange(side) * step, np.arange(side) * step)
    grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(side**2)])
    levels = texture(grid, np.random.default_rng(seed)).reshape(side, side)
    assert 2 < levels.std() < 4
    assert np.quantile(np.abs(levels - levels.mean()), 0.999) < 11
    window = np.hanning(side)[:, None] * np.hanning(side)
    power = np.abs(np.fft.fft2((levels - levels.mean()) * window)) ** 2
    number = np.hypot(*np.meshgrid(np.fft.fftfreq(side, step), np.fft.fftfreq(side, step)))
    assert power[number > 1 / (4 * MM)].sum() < 1e-3 * power.sum()


def test_the_vertices_of_the_cheek_sample_the_texture_fully():
    parts = build(spec())
    mesh = named(parts, "skin").mesh
    centres = mesh.triangles_center
    cheek = np.hypot(centres[:, 0] - 0.06, centres[:, 1]) < 0.025
    cheek &= centres[:, 2] > 0
    at = texture(mesh.vertices, np.random.default_rng(5))
    left = at[mesh.faces[cheek]].mean(axis=1) - texture(centres[cheek], np.random.default_rng(5))
    assert left.std() < 0.2 * at[mesh.faces[cheek]].std()


def test_the_texture_depends_on_the_seed_and_applies_to_the_skin_only():
    first, again, other = (mechanism.build(spec(seed=seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(named(first, "skin").colours, named(again, "skin").colours)
    assert np.abs(named(first, "skin").colours - named(other, "skin").colours).mean() > 1
    np.testing.assert_array_equal(named(first, "lips").colours, named(other, "lips").colours)


@pytest.mark.parametrize("skin", SKINS)
def test_skin_and_lips_have_the_specified_colours(skin):
    parts = build(spec(rig={"skin": skin, "lips": (150, 56, 42)}))
    assert np.abs(np.median(named(parts, "skin").colours, axis=0) - SKINS[skin]).max() < 8
    lips = named(parts, "lips").colours
    assert (np.abs(lips - (150, 56, 42)).max(axis=1) < 20).mean() > 0.6


# The linkage


def angles_of(linkage: FourBar) -> np.ndarray:
    """Return angles over the linkage's reach, without a tiny margin at the ends."""
    low, high = reach(linkage)
    return neutral_rocker(linkage) - np.linspace(low + 1e-3, high - 1e-3, 25)


@pytest.mark.parametrize("linkage", [FourBar(), FourBar(ground=0.06, coupler=0.045, rocker=0.055, crank=0.022)])
def test_every_link_is_in_its_place_at_every_angle(linkage):
    rig = Rig(linkage=linkage)

    def point(placed: dict, body: str, x: float, y: float = 0.0) -> np.ndarray:
        return (placed[body] @ [x, y, 0.0, 1.0])[:2]

    at_neutral = point(poses(rig, 0.0), "coupler", linkage.coupler)
    for angle in angles_of(linkage):
        placed = poses(rig, angle)
        np.testing.assert_allclose(point(placed, "head", 0.0), [0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(point(placed, "crank", 0.0), [-linkage.ground, 0.0], atol=1e-9)
        np.testing.assert_allclose(point(placed, "crank", linkage.crank), point(placed, "coupler", 0.0), atol=1e-9)
        rocker_end = point(placed, "head", *at_neutral)
        np.testing.assert_allclose(point(placed, "coupler", linkage.coupler), rocker_end, atol=1e-9)
        assert np.hypot(*rocker_end) == pytest.approx(linkage.rocker, abs=1e-9)


def test_links_that_cannot_close_are_an_error():
    low, _ = reach(FourBar())
    with pytest.raises(ValueError, match="cannot close"):
        poses(Rig(), neutral_rocker(FourBar()) - low + 0.01)


@pytest.mark.parametrize("plant", [{"kind": "linear"}, {"kind": "neck", "spring_base": 0.04, "spring_arm": 0.065}])
def test_the_springs_hang_between_hook_and_rod_at_every_angle(plant):
    wanted = spec(plant=plant)
    hung, parts = suspension(wanted), build(wanted)
    rod = named(parts, "spring rod").mesh.vertices
    rod = np.unique(np.round(rod[rod[:, 2] > 80 * MM], 12), axis=0)  # its end, about its axis
    assert (hung.anchor, hung.arm) == ((0.04, 0.065) if plant["kind"] == "neck" else (0.048, 0.059))
    for angle in angles_of(wanted.rig.linkage):
        placed = poses(wanted.rig, angle, hung=hung)
        theta = neutral_rocker(wanted.rig.linkage) - angle
        length = math.sqrt(hung.anchor**2 + hung.arm**2 - 2 * hung.anchor * hung.arm * math.cos(theta))  # Eq. (17)
        at_rod = placed["head"][:2, :2] @ rod[:, :2].mean(axis=0)
        for name in SPRINGS:
            wire = np.unique(np.round(named(parts, name).mesh.vertices, 12), axis=0)  # by x, its axis
            first, last = (
                placed[name][:2, :2] @ end[:, :2].mean(axis=0) + placed[name][:2, 3] for end in (wire[:6], wire[-6:])
            )
            np.testing.assert_allclose(first, [-hung.anchor, 0.0], atol=1e-9)
            np.testing.assert_allclose(last, at_rod, atol=1e-9)
            pose = placed[name][:2]
            along = pose[:, 0] * np.ptp(wire[:, 0])
            assert np.hypot(*along) == pytest.approx(length, rel=1e-9)


def test_marker_and_shaft_end_turn_about_the_axis_and_their_area_is_a_circles():
    for kind, inner in (("disc", 0.0), ("ring", 4.5 * MM)):
        mesh = named(build(spec(rig={"marker": kind})), "marker").mesh
        assert mesh.area == pytest.approx(math.pi * ((8.5 * MM) ** 2 - inner**2), rel=1e-4)
        np.testing.assert_allclose(mesh.face_normals, np.tile([0.0, 0.0, 1.0], (len(mesh.faces), 1)), atol=1e-12)
        np.testing.assert_allclose(np.average(mesh.triangles_center, axis=0, weights=mesh.area_faces)[:2], 0, atol=1e-9)
        assert named(build(spec(rig={"marker": kind})), "shaft end").mesh.bounds[1, 2] == pytest.approx(
            mesh.bounds[0, 2] - 0.3 * MM
        )
    assert not any(part.name == "marker" for part in build(spec(rig={"marker": "none"})))


def test_with_a_pivot_offset_the_marker_is_on_the_bearing_and_off_the_axis():
    offset = (4 * MM, -3 * MM)
    parts = mechanism.build(spec(effects={"pivot_offset": {"dx_px": 1, "dy_px": 1}}), offset)
    for name in ("marker", "shaft end"):
        assert named(parts, name).body == "ground"
        mesh = named(parts, name).mesh
        np.testing.assert_allclose(mesh.bounds.mean(axis=0)[:2], offset, atol=1e-9)
    assert named(build(spec()), "marker").body == "head"


def test_the_antenna_turns_about_its_hinge_on_the_head():
    parts = build(spec(effects={"elastic_coupling": {"frequency_hz": 4}}))
    assert {part.body for part in parts if part.name.startswith("antenna")} == {"appendage", "head"}
    rest, swung = (poses(Rig(), 0.2, appendage)["appendage"] for appendage in (0.0, 0.3))
    np.testing.assert_allclose(rest[:3, 3], swung[:3, 3], atol=1e-12)
    np.testing.assert_allclose((rest[:2, :2].T @ swung[:2, :2])[1, 0], math.sin(0.3), atol=1e-12)
    assert not any(part.name.startswith("antenna") for part in build(spec()))


def test_a_persons_neck_has_no_mechanism_and_reaches_further():
    parts = build(spec(rig={"neck": "human", "marker": "none"}))
    assert {part.body for part in parts} == {"head", "ground"} == set(poses(Rig(neck="human", marker="none"), 1.2))
    assert not {part.name for part in parts} & {"shaft", "shaft end", "marker", "rocker", "crank", "servo", "base"}
    assert {"shirt", "lips", "wall"} <= {part.name for part in parts}


# All of it


@pytest.mark.parametrize("rig", [{"head": "female"}, {"head": "male"}, {"neck": "human", "marker": "none"}])
def test_the_number_of_triangles_is_bounded_and_every_part_has_a_pose(rig):
    wanted = spec(
        rig=rig,
        scene={"lamp_px": [600, 40], "occluders": [{"from_s": 1, "for_s": 1}], "distractor": {"at_px": [560, 400]}},
        effects={"elastic_coupling": {"frequency_hz": 4}},
    )
    camera = camera_of(wanted)
    parts = build(wanted) + props(wanted, camera)
    assert sum(len(part.mesh.faces) for part in parts) <= 45_000
    placed = {**poses(wanted.rig, 0.1), **prop_poses(wanted, camera, 0.0, False)}
    assert {part.body for part in parts} <= set(placed)
    for part in parts:
        assert part.colours.shape == part.mesh.vertices.shape
        assert part.colours.min() >= 0
        assert part.colours.max() <= 255
        np.testing.assert_allclose(np.linalg.norm(part.mesh.vertex_normals, axis=1), 1, atol=1e-6)
        # the winding must agree with the normals, or a renderer with culling would show the inside
        facing = (part.mesh.face_normals * part.mesh.vertex_normals[part.mesh.faces].mean(axis=1)).sum(axis=1)
        assert (facing > 0).mean() > 0.99, part.name


def test_no_two_colours_lie_in_one_plane():
    flat = []
    for part in build(spec()):
        for axis, sign in itertools.product(range(3), (-1, 1)):
            faces = part.mesh.face_normals[:, axis] * sign > 0.9999
            for plane in np.unique(np.round(part.mesh.triangles_center[faces, axis], 5)):
                on = faces & (np.abs(part.mesh.triangles_center[:, axis] - plane) < 1e-5)
                corners = np.delete(part.mesh.triangles[on].reshape(-1, 3), axis, axis=1)
                flat.append((axis, sign, plane, part, corners.min(axis=0), corners.max(axis=0)))
    moving = {"crank", "coupler", "appendage"}
    for one, other in itertools.combinations(flat, 2):
        if one[:2] != other[:2] or abs(one[2] - other[2]) > 2e-5 or (one[3].colours[0] == other[3].colours[0]).all():
            continue
        if one[3].name in ("skin", "hair") or (one[3].body != other[3].body and {one[3].body, other[3].body} & moving):
            continue
        overlap = np.minimum(one[5], other[5]) - np.maximum(one[4], other[4])
        assert overlap.min() < 1e-5, (one[3].name, other[3].name, one[0], one[2])


def test_no_step_along_a_machined_edge_is_long():
    for part in build(spec()):
        if part.body != "head" and part.name != "wall":
            assert part.mesh.edges_unique_length.max() < 13 * MM, part.name


@pytest.mark.parametrize(
    "camera",
    [
        {},
        {"size": [1280, 720]},
        {"azimuth_deg": 35, "elevation_deg": -35},
        {"azimuth_deg": -35, "elevation_deg": 35},
        {"distance_m": 0.4},
        {"distance_m": 20},
    ],
)
def test_the_wall_fills_the_picture_in_every_view(camera):
    wanted = spec(camera=camera, effects={"lens_distortion": {"k1": -0.15}})
    eye = camera_of(wanted)
    parts = build(wanted)
    wall = named(parts, "wall").mesh.vertices
    pixels, depth = eye.draw(wall)
    rim = trimesh.Trimesh(np.column_stack([pixels, np.zeros(len(pixels))]), named(parts, "wall").mesh.faces)
    low, high = rim.bounds[:, :2]
    assert (low < -0.5).all()
    assert (high > np.array(wanted.camera.size) - 0.5).all()
    for part in parts:
        if part.name != "wall":
            assert eye.draw(part.mesh.vertices)[1].max() < depth.min()


# The scene

VIEWS = [
    {},
    {"rig": {"facing": "left", "pivot_px": [400, 300]}},
    {"camera": {"azimuth_deg": 30}},
    {"camera": {"distance_m": 0.6}, "effects": {"lens_distortion": {"k1": -0.1}}},
]


@pytest.mark.parametrize("view", VIEWS)
def test_lamp_and_mug_stand_at_their_pixels(view):
    scene = {"lamp_px": [600, 40], "distractor": {"at_px": [560, 400], "width_px": 50, "sway_px": 20}}
    wanted = spec(scene=scene, **view)
    camera = camera_of(wanted)
    parts = props(wanted, camera)
    rest, swung = (prop_poses(wanted, camera, time, True) for time in (0.0, 0.5))
    lamp = seen(named(parts, "lamp"), rest["lamp"], camera)
    np.testing.assert_allclose((lamp.min(axis=0) + lamp.max(axis=0)) / 2, [600, 40], atol=0.1)
    assert np.ptp(lamp, axis=0) == pytest.approx([2 * LENS_PX] * 2, rel=0.12)
    for placed, x in ((rest, 560), (swung, 580)):
        centre = camera.project(placed["mug"][:3, 3])
        np.testing.assert_allclose(centre, [x, 400], atol=1e-6)
    mug = named(parts, "mug")
    cup = np.abs(mug.mesh.vertices[:, 0]) <= -mug.mesh.bounds[0, 0] + 1e-12
    across = seen(mug, rest["mug"], camera)[cup]
    assert np.ptp(across[:, 0]) == pytest.approx(50, rel=0.12)  # its rim is nearer than its axis
    assert (mug.colours == wanted.rig.lips_rgb).all()


def test_the_lamp_is_behind_the_wall_until_it_is_lit():
    wanted = spec(scene={"lamp_px": [600, 40]})
    camera = camera_of(wanted)
    wall = camera.draw(named(build(wanted), "wall").mesh.vertices)[1].max()
    lamp = named(props(wanted, camera), "lamp").mesh.vertices
    for lit in (True, False):
        pose = prop_poses(wanted, camera, 0.0, lit)["lamp"]
        depth = camera.draw(lamp @ pose[:3, :3].T + pose[:3, 3])[1]
        assert (depth.max() < wall) if lit else (depth.min() > wall)


@pytest.mark.parametrize("view", VIEWS)
def test_an_occluder_covers_the_mouth_at_and_for_the_specified_time(view):
    wanted = spec(scene={"occluders": [{"from_s": 3.0, "for_s": 0.4, "width_px": 60}]}, **view)
    camera = camera_of(wanted)
    bar = named(props(wanted, camera), "occluder-0")
    mouth = camera.project(lips_outline(wanted.rig))

    def edges(time: float, row: float) -> np.ndarray:
        pixels = seen(bar, prop_poses(wanted, camera, time, False)["occluder-0"], camera)
        sides = np.array_split(
            pixels[np.argsort(bar.mesh.vertices[:, 0], kind="stable")], len(set(bar.mesh.vertices[:, 0]))
        )
        return np.sort([np.interp(row, *side[np.argsort(side[:, 1])][:, ::-1].T) for side in (sides[0], sides[-1])])

    left, right = (mouth[pick(mouth[:, 0])] for pick in (np.argmin, np.argmax))
    assert edges(3.0, left[1])[1] == pytest.approx(left[0], abs=0.1)
    assert edges(3.4, right[1])[0] == pytest.approx(right[0], abs=0.1)
    assert edges(3.1, left[1])[0] > edges(3.0, left[1])[0]  # from left to right
    nearest = min(camera.draw(part.mesh.vertices)[1].min() for part in build(wanted))
    pose = prop_poses(wanted, camera, 3.2, False)["occluder-0"]
    pixels, depth = camera.draw(bar.mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
    assert depth.max() < nearest
    assert pixels[:, 1].min() < 0
    assert pixels[:, 1].max() > wanted.camera.size[1]
    wall = camera.draw(named(build(wanted), "wall").mesh.vertices)[1].max()
    for time in (0.0, 10.0):
        pose = prop_poses(wanted, camera, time, False)["occluder-0"]
        pixels, depth = camera.draw(bar.mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
        assert depth.min() > wall or not ((pixels[:, 0] > 0) & (pixels[:, 0] < wanted.camera.size[0])).any()
