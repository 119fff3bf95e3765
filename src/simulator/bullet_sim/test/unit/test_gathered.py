# SPDX-License-Identifier: BSD-3-Clause
"""Links with more shapes than PyBullet takes: every one of them collides."""
import struct

import numpy as np
import pytest

from bullet_sim import BulletSimError, Pose, World
from bullet_sim.gathered import MAX_SHAPES
from urdf_model import parse_urdf

STEP_M = 0.3
SHAPES = {"box": '<box size="0.1 0.1 0.1"/>', "cylinder": '<cylinder radius="0.05" length="0.1"/>',
          "sphere": '<sphere radius="0.05"/>', "mesh": '<mesh filename="{cube}" scale="0.05 0.05 0.05"/>'}


@pytest.fixture
def world(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    world = World()
    yield world
    world.close()


@pytest.fixture
def cube(tmp_path):
    """A file with a cube from -1 to 1: two triangles for each side."""
    path, corners = tmp_path / "cube.stl", []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for ends in (((-1, -1), (1, -1), (1, 1)), ((-1, -1), (1, 1), (-1, 1))):
                corners.append([np.insert(np.array(end, dtype=float), axis, side) for end in ends])
    triangles = b"".join(struct.pack("<12fH", 0, 0, 0, *np.array(triangle).ravel(), 0) for triangle in corners)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(corners)) + triangles)
    return path


def row(kinds, cube, moves):
    """A robot with one link, its shapes in a row along x, turned about x by a right angle; all are 0.1 m high."""
    shapes = "".join('<collision><origin xyz="%g 0 0" rpy="1.5707963267948966 0 0"/><geometry>%s</geometry></collision>'
                     % (STEP_M * k, SHAPES[kind].format(cube=cube)) for k, kind in enumerate(kinds))
    link = '<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>' \
           "</inertial>%s</link>" % ("row" if moves else "world", shapes)
    return parse_urdf('<robot name="row">%s</robot>' % link)


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("kinds", [
    [kind] * 40 for kind in SHAPES] + [["mesh", "box", "cylinder", "sphere"] * 10, ["box"] * (MAX_SHAPES + 1)],
    ids=["boxes", "cylinders", "balls", "meshes", "mixed", "one_more"])
def test_every_shape_of_many_is_where_it_belongs_and_as_large(world, cube, kinds, moves):
    world.spawn(row(kinds, cube, moves), "row", Pose((0.0, 0.0, 1.0)))
    x = STEP_M * np.arange(len(kinds))
    for way in (np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])):
        centre = np.stack([x, np.zeros(len(x)), np.ones(len(x))], axis=1)
        reach = 1.0 - world.ray_test_batch(centre + way, centre)
        np.testing.assert_allclose(reach, 0.05, atol=1.1e-3)  # Bullet's margin around meshes is 1 mm
    between = np.stack([x + STEP_M / 2.0, np.zeros(len(x)), np.full(len(x), 2.0)], axis=1)
    np.testing.assert_array_equal(world.ray_test_batch(between, between - [0.0, 0.0, 2.0]), 1.0)


def test_something_rests_on_a_shape_that_was_gathered(world, cube):
    world.spawn(row(["box"] * 40, cube, moves=False), "row", Pose((0.0, 0.0, 1.0)))
    balls = [world.spawn(row(["sphere"], cube, moves=True), "ball%d" % k, Pose((k * STEP_M, 0.0, 1.11)))
             for k in range(40)]
    for _ in range(500):
        world.step()
    np.testing.assert_allclose([ball.base_pose().position[2] for ball in balls], 1.1, atol=1e-3)


def test_few_shapes_stay_what_they_are(world, cube, tmp_path):
    world.spawn(row(["box", "sphere"] * (MAX_SHAPES // 2), cube, moves=True), "row")
    assert not list(tmp_path.rglob("*.obj"))


def test_the_same_many_shapes_are_gathered_once(world, cube, tmp_path):
    for name in ("a", "b"):
        world.spawn(row(["box"] * 20, cube, moves=True), name)
    file, = tmp_path.rglob("*.obj")
    written = file.stat().st_mtime_ns
    again = World()
    again.spawn(row(["box"] * 20, cube, moves=True), "a")
    again.close()
    assert [file] == list(tmp_path.rglob("*.obj")) and file.stat().st_mtime_ns == written


def test_more_than_can_be_made_in_time_are_refused_with_the_limit(world, cube):
    with pytest.raises(BulletSimError, match="link 'row', with what is fixed to it, has 1001 .* at most 1000"):
        world.spawn(row(["box"] * 1001, cube, moves=True), "row")
    assert not world.models


@pytest.mark.parametrize(("kind", "half_m"), [("continuous", 0.05), ("fixed", 0.051)])
def test_a_wheel_of_a_mesh_is_as_large_as_its_mesh(world, cube, kind, half_m):
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    wheel = '<collision><origin xyz="0.2 0 0" rpy="0.5 0 0"/><geometry>%s</geometry></collision>' % (
        SHAPES["mesh"].format(cube=cube))
    world.spawn(parse_urdf(
        '<robot name="cart"><link name="base">%s</link><link name="wheel">%s%s</link><joint name="axle" type="%s">'
        '<parent link="base"/><child link="wheel"/><axis xyz="1 0 0"/></joint></robot>' % (body, body, wheel, kind)),
        "cart", Pose((0.0, 0.0, 1.0)))
    middle, along = np.array([0.2, 0.0, 1.0]), np.array([0.0, -np.sin(0.5), np.cos(0.5)])
    rays = np.array([along, -along, (1.0, 0.0, 0.0)])
    reach = 1.0 - world.ray_test_batch(middle + rays, np.tile(middle, (3, 1)))
    np.testing.assert_allclose(reach, half_m, atol=2e-4)
