# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with known sizes, places and colours."""
import subprocess
import sys
import weakref

import numpy as np
import pybullet
import pytest
import trimesh

from lab_testing.meshes import sphere
from sensor_renderer import triangles
from sensor_renderer.errors import SensorError
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import MAX_UNUSED, Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.shadows import Shadows
from sensor_renderer.tiny_renderer import TinyRenderer
from urdf_model import Box, Cylinder, Sphere
from urdf_model.transforms import inverse, pose_matrix
from world_picture.drawing import DrawingCache

CUBE_M = 0.1
CUBE = """<robot name="cube"><link name="link"><visual><geometry><box size="0.1 0.1 0.1"/></geometry>
<material name="r"><color rgba="0.9 0 0 1"/></material></visual></link></robot>"""
FLOOR = ("floor", None, [], [0, 0, 0, 0, 0, 0, 1])
TURN = (0.0, 0.0, 0.3827, 0.9239)  # by 45 degrees about z
CUBE_ON_FLOOR = ("cube", CUBE, [], [0.7, 0.1, 0.05, *TURN])
ARM = """<robot name="arm">
<link name="base"><visual><geometry><box size="0.2 0.2 0.05"/></geometry></visual></link>
<link name="slide"/><link name="tip"><visual><geometry><sphere radius="0.05"/></geometry>
<material name="g"><color rgba="0 0.9 0 1"/></material></visual></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="slide"/><origin xyz="0 0 0.1"/>
<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="turn" type="continuous"><parent link="slide"/><child link="tip"/><origin xyz="0 0 0" rpy="0 0 0"/>
<axis xyz="0 1 0"/></joint>
<joint name="hold" type="fixed"><parent link="tip"/><child link="camera"/><origin xyz="0.3 0 0"/></joint>
<link name="camera"><visual><origin xyz="0.05 0 0"/><geometry><cylinder radius="0.02" length="0.1"/></geometry>
</visual></link></robot>"""


BALL = """<robot name="ball"><link name="link"><visual><geometry><mesh filename="%s"/></geometry>
<material name="r"><color rgba="0.9 0 0 1"/></material></visual></link></robot>"""


@pytest.fixture(params=[GlRenderer, TinyRenderer])
def renderer(request):
    made = request.param()
    yield made
    made.close()


def world(bodies, tmp_path):
    """A Mirror of [(name, urdf or None, joint names, values)]."""
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": name, "urdf": urdf, "joints": joints} for name, urdf, joints, _ in bodies])
    mirror.set_state(np.concatenate([values for *_, values in bodies]))
    return mirror


def looking_down_on(x, y, height):
    """Optical pose (4, 4), slanted, that looks at about (x, y, 0)."""
    return pose_matrix((x - 0.5 * height, y + 0.1, height), (0.0, 1.0, -0.1)) @ OPTICAL


def looking_at_origin(distance):
    """Optical pose (4, 4) on the x axis, `distance` [m] away."""
    return pose_matrix((-distance, 0.0, 0.0), (0.0, 0.0, 0.0)) @ OPTICAL


def reddish(picture):
    r, g, b = (picture[:, :, k].astype(int) for k in range(3))
    return (r > 60) & (g < r // 4) & (b < r // 4)


def test_a_red_cube_is_where_its_corners_project(renderer, tmp_path):
    mirror = world([FLOOR, CUBE_ON_FLOOR], tmp_path)
    pinhole = Pinhole.from_field_of_view(640, 400, 1.0, 0.05, 20.0)
    pose = looking_down_on(0.7, 0.1, 1.0)
    picture, _ = renderer.render(mirror, pinhole, pose)
    rows, columns = np.nonzero(reddish(picture))

    signs = np.array([[x, y, z, 1.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = signs * [CUBE_M / 2, CUBE_M / 2, CUBE_M / 2, 1.0]
    corners = corners @ mirror.bodies["cube"].link_matrix("link").T @ inverse(pose).T
    pixels = pinhole.project(corners[:, :3])
    expected = [pixels[:, 0].min(), pixels[:, 0].max(), pixels[:, 1].min(), pixels[:, 1].max()]
    assert expected[1] - expected[0] > 40  # it is large enough to say something
    assert np.abs(np.array([columns.min(), columns.max(), rows.min(), rows.max()]) - expected).max() < 2.0


def test_depth_agrees_with_rays(renderer, tmp_path):
    mirror = world([FLOOR, CUBE_ON_FLOOR], tmp_path)
    pinhole = Pinhole.from_field_of_view(640, 480, 1.047, 0.1, 100.0)
    pose = looking_down_on(0.7, 0.1, 1.3)
    _, depth = renderer.render(mirror, pinhole, pose, depth=True)

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client),
                             physicsClientId=client)
    pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[CUBE_M / 2] * 3,
                                                              physicsClientId=client),
                             basePosition=[0.7, 0.1, 0.05], baseOrientation=TURN, physicsClientId=client)
    random = np.random.default_rng(1)
    pixels = np.concatenate([random.integers((200, 150), (440, 330), (35, 2)),
                             random.integers((0, 0), (640, 480), (25, 2))])
    hits = 0
    for u, v in pixels:
        far = np.array([(u - pinhole.cx) / pinhole.fx * 50.0, (v - pinhole.cy) / pinhole.fy * 50.0, 50.0, 1.0])
        hit = pybullet.rayTest(pose[:3, 3].tolist(), (pose @ far)[:3].tolist(), physicsClientId=client)[0]
        assert hit[0] >= 0, "every ray of this view ends on the floor or on the cube"
        at_edge = np.ptp(depth[max(v - 1, 0):v + 2, max(u - 1, 0):u + 2]) > 0.02
        if at_edge:
            continue  # half a pixel decides which of two surfaces is hit
        hits += 1
        assert depth[v, u] == pytest.approx(hit[2] * 50.0, abs=0.005)
    pybullet.disconnect(physicsClientId=client)
    assert hits >= 50


def test_a_near_mesh_is_drawn_finely_and_a_far_one_coarsely(tmp_path, monkeypatch):
    """A ball of many triangles: near, its outline is round within a pixel; of coarse triangles it is not."""
    vertices, faces = sphere(120)
    trimesh.Trimesh(0.3 * vertices, faces).export(str(tmp_path / "ball.stl"))
    urdf = BALL % (tmp_path / "ball.stl")
    mirror = Mirror(DrawingCache(tmp_path / "cache"), lambda uri: uri, pytest.fail)
    mirror.set_scene([{"name": "ball", "urdf": urdf, "joints": []}])
    mirror.set_state(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    renderer = GlRenderer()
    pinhole = Pinhole.from_field_of_view(600, 600, 1.0, 0.05, 100.0)

    def roundness(distance):
        """The largest difference from a disc of the same area [pixels]."""
        rows, columns = np.nonzero(reddish(renderer.render(mirror, pinhole, looking_at_origin(distance))[0]))
        away = np.hypot(rows - rows.mean(), columns - columns.mean())
        return away.max() - np.sqrt(len(rows) / np.pi)

    roundness(20.0)
    link, = renderer._links._links.values()
    counts = []
    for distance in (20.0, 5.0, 1.0):
        assert roundness(distance) < 1.5
        drawn = renderer._links.arrays(link, distance - link.radius, pinhole)
        counts.append(drawn[0].vertices // 3)
    assert counts[0] < counts[1] < counts[2]
    monkeypatch.setattr(renderer._links, "arrays", lambda *_: link.by_level[max(link.by_level)])
    assert roundness(1.0) > 3.0, "coarse triangles would show"
    renderer.close()


def test_the_camera_looks_along_z_with_x_to_the_right_and_y_down(renderer, tmp_path):
    pose = pose_matrix((0.2, -0.3, 1.0), (0.3, -0.4, 0.5))  # any
    pinhole = Pinhole.from_field_of_view(320, 240, 1.0, 0.05, 20.0)
    for place, column, row in (((0.0, 0.0, 1.5), 159.5, 119.5), ((0.4, 0.0, 1.5), 239.0, 119.5),
                               ((0.0, 0.3, 1.5), 159.5, 179.0)):
        x, y, z, _ = pose @ [*place, 1.0]
        mirror = world([("cube", CUBE, [], [x, y, z, 0, 0, 0, 1])], tmp_path)
        picture, depth = renderer.render(mirror, pinhole, pose, depth=True)
        rows, columns = np.nonzero(reddish(picture))
        assert columns.mean() == pytest.approx(column, abs=4.0) and rows.mean() == pytest.approx(row, abs=4.0)
        assert np.isnan(depth[5, 5]), "nothing is there"


def test_models_that_come_and_go_leave_little_behind(tmp_path):
    """As in a data set with other sizes and colours in each picture."""
    renderer, mirror = GlRenderer(), Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    pinhole = Pinhole.from_field_of_view(40, 30, 1.0, 0.05, 20.0)
    first = None
    for number in range(MAX_UNUSED + 30):
        urdf = CUBE.replace("0.1 0.1 0.1", "%g 0.1 0.1" % (0.11 + 0.001 * number)).replace("0.9 0 0", "0.9 %g 0" % (
            0.001 * number))
        mirror.set_scene([{"name": name, "urdf": text, "joints": []} for name, text in (
            ("stays", CUBE), ("cube%d" % number, urdf))])
        mirror.set_state(np.array([5.0, 0, 0, 0, 0, 0, 1] + [0, 0, 0, 0, 0, 0, 1.0]))
        picture, _ = renderer.render(mirror, pinhole, pose_matrix((-0.5, 0, 0)) @ OPTICAL)
        assert picture[15, 20, 0] > 50
        first = first or weakref.ref(mirror.bodies["cube0"].parts[0][0].triangles)
        shown = {part.key for body in mirror.bodies.values() for parts in body.parts for part in parts}
        assert shown <= mirror._parts.keys()
    assert first() is None and len(mirror._parts) <= MAX_UNUSED + 2 >= len(renderer._links._links) - 1
    renderer.close()


def test_forward_kinematics_and_camera_links(tmp_path):
    half = np.sqrt(0.5)
    mirror = world([("arm", ARM, ["lift", "turn"], [1.0, 2.0, 0.0, 0, 0, half, half, 0.4, -np.pi / 2])], tmp_path)
    tip = mirror.bodies["arm"].link_matrix("tip")
    # The arm stands turned to y, 0.5 above the floor; its tip is turned up, so that its x points to z.
    assert tip[:3, 3] == pytest.approx([1.0, 2.0, 0.5])
    assert tip[:3, 0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert tip[:3, 1] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)


def test_what_stands_still_is_not_posed_again(tmp_path):
    values = np.array([1.0, 2.0, 0.0, 0, 0, 0, 1.0])
    mirror = world([("cube", CUBE, [], values)], tmp_path)
    before = mirror.version
    mirror.set_state(values)
    assert mirror.version == before
    mirror.set_state(values + [0.1, 0, 0, 0, 0, 0, 0])
    assert mirror.version == before + 1


def test_bodies_come_and_go(renderer, tmp_path):
    pinhole = Pinhole.from_field_of_view(160, 120, 1.0, 0.05, 20.0)
    pose = looking_down_on(0.7, 0.1, 1.0)
    mirror = world([("cube", CUBE, [], [0.7, 0.1, 0.05, 0, 0, 0, 1])], tmp_path)
    seen = [reddish(renderer.render(mirror, pinhole, pose)[0]).any()]
    mirror.set_scene([])
    mirror.set_state(np.empty(0))
    seen.append(reddish(renderer.render(mirror, pinhole, pose)[0]).any())
    mirror.set_scene([{"name": "cube", "urdf": CUBE, "joints": []}])
    mirror.set_state(np.array([0.7, 0.1, 0.05, 0, 0, 0, 1]))
    seen.append(reddish(renderer.render(mirror, pinhole, pose)[0]).any())
    assert seen == [True, False, True]


@pytest.mark.parametrize("shift_m", [0.0005, 0.001, 0.0015])
def test_small_pictures_of_a_state_share_one_map_of_shadows_which_is_exactly_of_it(tmp_path, monkeypatch, shift_m):
    """Pictures for learning: a state that returns looks the same to the last bit, whatever was drawn before."""
    drawn = []
    draw_from = Shadows._draw_from
    monkeypatch.setattr(Shadows, "_draw_from", lambda self, *given: drawn.append(1) or draw_from(self, *given))
    pinhole = Pinhole.from_field_of_view(84, 84, 1.0, 0.05, 20.0)
    views = [looking_down_on(0.7, 0.1, height) for height in (0.5, 1.0, 2.0)]
    mirror, renderer = world([FLOOR, CUBE_ON_FLOOR], tmp_path), GlRenderer()
    for view in views:
        renderer.render(mirror, pinhole, view)
    assert len(drawn) == 1
    mirror.set_state(np.array([0, 0, 0, 0, 0, 0, 1, 0.7 + shift_m, 0.1, 0.05, *TURN]))
    after = [np.array(renderer.render(mirror, pinhole, view)[0]) for view in views]
    assert len(drawn) == 2
    renderer.close()
    fresh = GlRenderer()
    np.testing.assert_array_equal(after, [np.array(fresh.render(mirror, pinhole, view)[0]) for view in views])
    fresh.close()


def test_a_shadow_falls_on_the_floor(tmp_path):
    """Worlds are drawn in turn. Each is deleted before the next is made, which often gets the same address."""
    renderer = GlRenderer()
    pinhole = Pinhole.from_field_of_view(320, 240, 0.6, 0.05, 20.0)
    pose = pose_matrix((0.3, 0.0, 2.0), (0.0, np.pi / 2, 0.0)) @ OPTICAL
    flying = ("cube", CUBE, [], [0.3, 0.0, 0.3, 0, 0, 0, 1])
    for _ in range(10):
        bare, _ = renderer.render(world([FLOOR], tmp_path), pinhole, pose)
        shaded, _ = renderer.render(world([FLOOR, flying], tmp_path), pinhole, pose)
        darker = (shaded.astype(int).sum(axis=2) < 0.8 * bare.astype(int).sum(axis=2)) & ~reddish(shaded)
        assert 200 < darker.sum() < 5000
    renderer.close()


@pytest.mark.parametrize("radius", [0.03, 0.3, 3.0])
@pytest.mark.parametrize("geometry", ['<sphere radius="%g"/>', '<cylinder radius="%g" length="20"/>'])
def test_the_depth_of_round_things_is_that_of_their_formula(tmp_path, geometry, radius):
    away = 4.0 * radius
    pinhole = Pinhole.from_field_of_view(320, 320, 0.6, 0.01, 100.0)
    ball = "<robot name='b'><link name='l'><visual><geometry>%s</geometry></visual></link></robot>" % geometry % radius
    renderer = GlRenderer()
    _, depth = renderer.render(world([("ball", ball, [], [0, 0, 0, 0, 0, 0, 1])], tmp_path), pinhole,
                               looking_at_origin(away), colour=False, depth=True)
    renderer.close()
    down, right = np.mgrid[0:320, 0:320]
    rays = np.stack([(right - pinhole.cx) / pinhole.fx, (down - pinhole.cy) / pinhole.fy, np.ones((320, 320))], axis=2)
    if "cylinder" in geometry:
        rays[..., 1] = 0.0  # its axis is upright in the picture, and so long that its ends are outside
    # |t ray - (0, 0, away)| = radius, the nearer one; t is the depth, since rays have z = 1.
    square = (rays ** 2).sum(axis=2)
    inside = away ** 2 - square * (away ** 2 - radius ** 2)
    expected = (away - np.sqrt(np.where(inside > 0.0, inside, np.nan))) / square
    both = np.isfinite(depth) & np.isfinite(expected)
    assert both.sum() > 0.98 * np.isfinite(expected).sum()
    assert np.mean(np.abs(depth - expected)[both] < 0.003 * max(1.0, away)) >= 0.99


@pytest.mark.parametrize(("geometry", "volume"), [
    (Box((0.1, 0.2, 0.3)), 0.006), (Sphere(0.5), 4 / 3 * np.pi * 0.125), (Cylinder(0.1, 0.4), np.pi * 0.004)])
def test_primitives_are_closed_and_face_outwards(geometry, volume):
    rows = triangles.of_primitive(geometry)
    corners = rows[:, :3].reshape(-1, 3, 3).astype(float)
    six_volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    assert six_volumes.sum() / 6.0 == pytest.approx(volume, rel=0.02)
    assert (np.einsum("ij,ij->i", rows[:, :3], rows[:, 3:]) > 0).all()
    assert np.linalg.norm(rows[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-5)


def test_the_field_of_view_ends_at_the_outer_edges_of_the_outer_pixels():
    pinhole = Pinhole.from_field_of_view(640, 400, 1.2, 0.1, 10.0)
    edge = np.tan(0.6)
    found = pinhole.project([[-edge, 0.0, 1.0], [0.0, 0.0, 1.0], [edge, edge * 400 / 640, 1.0]])
    assert found == pytest.approx(np.array([[-0.5, 199.5], [319.5, 199.5], [639.5, 399.5]]))


@pytest.mark.parametrize(("arguments", "text"), [
    ((0, 480, 1.0, 0.1, 10.0), "0 x 480"), ((640, 99999, 1.0, 0.1, 10.0), "99999"),
    ((640, 480, 3.2, 0.1, 10.0), "3.2"), ((640, 480, 1.0, 1.0, 0.5), "clip")])
def test_impossible_cameras_are_refused(arguments, text):
    with pytest.raises(SensorError, match=text):
        Pinhole.from_field_of_view(*arguments)


def test_the_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'sensor_msgs'))); "
    modules = "import sensor_renderer.gl_renderer, sensor_renderer.tiny_renderer, sensor_renderer.mirror"
    subprocess.run([sys.executable, "-c", block + modules], check=True)
