import numpy as np
import pytest

from anglecam.neck import FourBar
from synth.inflate import inflate
from synth.mesh import HALF_WIDTH, build, mouth_centre, poses
from synth.profile import MM, circle, head_profile
from synth.spec import Rig


def test_the_head_is_a_closed_body_of_human_size():
    import trimesh

    body = inflate(head_profile(), HALF_WIDTH, 3 * MM, [])
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert 0.0015 < mesh.volume < 0.004  # m³; the normals point outwards, or it were negative


def test_a_circle_blown_up_is_a_ball():
    from synth.profile import Profile

    radius = 50 * MM
    body = inflate(Profile(circle((0.0, 0.0), radius, 1 * MM), {}), radius, 3 * MM, [])
    # φ = (R² − r²)/4 on a disc, so that sqrt(φ/φ_max) is the ball itself
    np.testing.assert_allclose(np.linalg.norm(body.vertices, axis=1), radius, atol=0.2 * MM)


def test_the_lips_touch_the_outline_and_stand_in_front_of_the_shaft():
    x, y = mouth_centre(build(Rig()), 1.5)
    assert 0.1 < x < 0.125
    assert abs(np.degrees(np.arctan2(y, x))) < 5


@pytest.mark.parametrize("angle_deg", [-23.0, 0.0, 12.5, 30.0])
def test_every_link_is_in_its_place_at_every_angle(angle_deg):
    linkage = FourBar()
    placed = poses(linkage, np.radians(angle_deg))

    def point(body: str, x: float, y: float = 0.0) -> np.ndarray:
        return (placed[body] @ [x, y, 0.0, 1.0])[:2]

    np.testing.assert_allclose(point("crank", 0.0), [-linkage.ground, 0.0], atol=1e-12)
    np.testing.assert_allclose(point("crank", linkage.crank), point("coupler", 0.0), atol=1e-9)
    at_neutral = poses(linkage, 0.0)["coupler"] @ [linkage.coupler, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(point("coupler", linkage.coupler), point("head", *at_neutral[:2]), atol=1e-9)


def test_without_a_marker_the_shaft_end_is_plain():
    assert {
        kind: any(part.name == "marker" for part in build(Rig(marker=kind))) for kind in ("disc", "ring", "none")
    } == {"disc": True, "ring": True, "none": False}
