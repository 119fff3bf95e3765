# SPDX-License-Identifier: BSD-3-Clause
"""Models that come and go a thousand times, and models whose meshes are missing."""

import gc
import math
import os
import weakref

import numpy as np
import pytest

from bullet_sim import MeshFiles, Pose, World, with_stand_ins
from urdf_model import Box, Cylinder, Mesh, Sphere, merge_fixed, parse_urdf

LINK = """<link name="%s">%s<visual><geometry><mesh filename="package://gone/%s.stl"/></geometry>
  <material name="m"><color rgba="1 0 0 1"/></material></visual>
  <collision><geometry><mesh filename="package://gone/%s.stl"/></geometry></collision></link>"""
INERTIAL = '<inertial><mass value="%g"/><inertia ixx="%g" iyy="%g" izz="%g"/></inertial>'
JOINT = """<joint name="%s" type="continuous"><parent link="%s"/><child link="%s"/><origin xyz="%s"/></joint>"""
LEAK_BYTES = 20e6


def resident_bytes():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize("static", [False, True])
def test_a_deleted_model_is_freed_without_a_garbage_collection(world, static):
    """/gazebo freezes the objects of models: a collection never sees them again."""
    links = "".join('<link name="%s">%s<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
                    % (name, INERTIAL % (1.0, 0.01, 0.01, 0.01)) for name in ("base", "arm"))
    xml = '<robot name="r">%s%s</robot>' % (links, JOINT % ("j", "base", "arm", "0 0 0.2"))
    gc.disable()
    try:
        model = weakref.ref(world.spawn(parse_urdf(xml, source="r"), "r", static=static))
        world.step()
        model().set_damping(0, 0.5)
        model().drive_position(np.array([0]), np.array([0.3]), np.array([5.0]))
        world.step()
        world.delete("r")
        world.step()
        assert model() is None
    finally:
        gc.enable()


def write_ball(path, rings=40):
    """Write a ball of 1 m radius with some thousand triangles as ASCII STL."""

    def point(ring, turn):
        polar, round_ = math.pi * ring / rings, math.pi * turn / rings
        return (
            math.sin(polar) * math.cos(round_),
            math.sin(polar) * math.sin(round_),
            math.cos(polar),
        )

    lines = ["solid ball"]
    for ring in range(rings):
        for turn in range(2 * rings):
            a, b = point(ring, turn), point(ring + 1, turn)
            c, d = point(ring + 1, turn + 1), point(ring, turn + 1)
            for corners in ((a, b, c), (a, c, d)):
                vertices = "\n".join("vertex %.6g %.6g %.6g" % corner for corner in corners)
                lines.append("facet normal 0 0 0\nouter loop\n%s\nendloop\nendfacet" % vertices)
    path.write_text("\n".join(lines + ["endsolid ball"]))


def of_one_link(geometry):
    return parse_urdf(
        '<robot name="r"><link name="l">%s<collision><geometry>%s</geometry></collision></link></robot>'
        % (INERTIAL % (1, 0.01, 0.01, 0.01), geometry)
    )


@pytest.fixture(params=["box", "mesh"])
def robot(request, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    if request.param == "box":
        return of_one_link('<box size="0.1 0.2 0.3"/>')
    write_ball(tmp_path / "ball.stl")
    return of_one_link('<mesh filename="%s" scale="0.1 0.1 0.1"/>' % (tmp_path / "ball.stl"))


def come_and_go(world, robot, times):
    for turn in range(times):
        pose = Pose((0.001 * turn, -2.0, 0.5), (0.0, 0.0, math.sin(0.3), math.cos(0.3)))
        model = world.spawn(robot, "again", pose)
        assert model.base_pose().position == pytest.approx(pose.position, abs=1e-12)
        assert model.base_pose().quaternion == pytest.approx(pose.quaternion, abs=1e-12)
        world.step()
        world.delete("again")


@pytest.mark.parametrize(
    "times", [pytest.param(50, id="50 times"), pytest.param(1000, marks=pytest.mark.long, id="1000 times")]
)
def test_a_name_can_be_spawned_and_deleted_again_and_again_without_growing(robot, times):
    world = World()
    world.add_ground_plane()
    come_and_go(world, robot, 20)
    gc.collect()
    before = resident_bytes()
    come_and_go(world, robot, times)
    gc.collect()
    grown = resident_bytes() - before
    print("%d times: %+.1f MB" % (times, grown / 1e6))
    # A thousand may cost LEAK_BYTES; with fewer, a megabyte is noise of the allocator.
    assert grown < max(LEAK_BYTES * times / 1000, 1e6)
    world.close()


# -- missing meshes ---------------------------------------------------------------------------------------------


def fitted(robot):
    found, told = with_stand_ins(robot, MeshFiles(lambda uri: None))
    return {name: (link.visuals, link.collisions) for name, link in found.links.items()}, told


def robot_of(*parts):
    return parse_urdf('<robot name="r">%s</robot>' % "".join(parts))


def test_a_believable_inertia_gives_the_box_that_has_it():
    # 2 kg, 0.1 x 0.2 x 0.3 m: I_x = m (b^2 + c^2) / 12
    inertial = INERTIAL % (2, 2 * 0.13 / 12, 2 * 0.10 / 12, 2 * 0.05 / 12)
    shapes, told = fitted(robot_of(LINK % ("a", inertial, "a", "a")))
    visual, collision = shapes["a"][0][0], shapes["a"][1][0]
    extents = np.abs(visual.origin[:3, :3]) @ visual.geometry.size
    np.testing.assert_allclose(extents, (0.1, 0.2, 0.3), rtol=1e-5)
    assert visual.colour == (1, 0, 0, 1) and collision.geometry == visual.geometry
    assert told == "mesh package://gone/a.stl cannot be found; a box replaces it in link 'a'"


@pytest.mark.parametrize("mass, inertia", [(1e-5, 10), (1e3, 1e-6), (1, 1e-9), (0, 0)])
def test_an_inertia_that_nothing_has_is_not_believed(mass, inertia):
    """Shapes from the chain's lengths: a rod to the next joint, a ball at the end."""
    inertial = INERTIAL % (mass, inertia, inertia, inertia)
    links = [LINK % (name, inertial, name, name) for name in "abc"]
    shapes, told = fitted(robot_of(*links, JOINT % ("j", "a", "b", "0 0 0.3"), JOINT % ("k", "b", "c", "0.4 0 0")))
    rod, second, ball = (shapes[name][1][0] for name in "abc")
    assert rod.geometry == Cylinder(pytest.approx(0.045), pytest.approx(0.3))
    np.testing.assert_allclose(rod.origin[:3, 3], (0, 0, 0.15))
    assert second.geometry == Cylinder(pytest.approx(0.06), pytest.approx(0.4))
    np.testing.assert_allclose(second.origin[:3, 2], (1, 0, 0), atol=1e-12)
    assert ball.geometry == Sphere(pytest.approx(0.06))
    assert told.count("cannot be found") == 3


def test_a_links_own_shapes_come_first():
    mesh = '<geometry><mesh filename="gone.stl"/></geometry>'
    box = '<origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry>'
    inertial = INERTIAL % (1, 0.01, 0.01, 0.01)
    one_link = '<link name="a">%s<visual>%s</visual><collision>%s</collision></link>'
    unseen, lost, half = (
        fitted(robot_of(one_link % (inertial, v, c)))[0]["a"]
        for v, c in ((mesh, box), (box, mesh), (box + "</visual><visual>" + mesh, box))
    )
    for visuals, collisions in (unseen, lost, half):
        assert [shape.geometry for shape in (*visuals, *collisions)] == [Box((1, 2, 3))] * 2
        assert visuals[0].origin[2, 3] == collisions[0].origin[2, 3] == 1.0


def test_a_robot_whose_meshes_are_there_is_left_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_ball(tmp_path / "ball.stl", 4)
    robot = of_one_link('<mesh filename="ball"/>')
    assert with_stand_ins(robot, MeshFiles(lambda uri: str(tmp_path / "ball.stl"))) == (robot, "")


def test_a_mesh_that_cannot_be_read_is_stood_in_for_where_it_collides(tmp_path):
    (tmp_path / "bad.stl").write_text("nonsense")
    files = MeshFiles(lambda uri: str(tmp_path / "bad.stl"))
    found, told = with_stand_ins(of_one_link('<mesh filename="bad"/>'), files)
    assert not isinstance(found.links["l"].collisions[0].geometry, Mesh)
    assert "bad.stl cannot be used: it holds no triangles" in told


def test_a_chain_without_meshes_collides_after_one_warning():
    told = []
    world = World(warn=told.append)
    links = [LINK % (name, INERTIAL % (1e-5, 10, 10, 10), name, name) for name in "ab"]
    model = world.spawn(robot_of(*links, JOINT % ("j", "a", "b", "0 0 0.4")), "chain", static=True)
    assert len(told) == 1 and "a.stl" in told[0] and "b.stl" in told[0]
    assert world.ray_test_batch([(1, 0, 0.2)], [(0, 0, 0.2)])[0] == pytest.approx(0.94, abs=0.01)
    assert all(link.visuals for link in merge_fixed(model.robot).links.values())
    world.close()


def test_a_world_that_is_given_nothing_to_warn_with_says_what_it_replaces(caplog):
    world = World()
    world.spawn(robot_of(LINK % ("a", INERTIAL % (1, 1, 1, 1), "a", "a")), "chain", static=True)
    assert "a.stl" in caplog.text and "replaces it in link 'a'" in caplog.text
    world.close()


def test_a_moving_link_without_mass_is_one_line_and_falls_like_any_other():
    told = []
    world = World(warn=told.append)
    joint = JOINT.replace('type="continuous"', 'type="prismatic"').replace(
        "</joint>", '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="9"/></joint>'
    )
    xml = '<robot name="r"><link name="a">%s</link><link name="b">%s</link>%s</robot>' % (
        INERTIAL % (1, 1, 1, 1), INERTIAL % (0, 0, 0, 0), joint % ("j", "a", "b", "0 0 0"))
    model = world.spawn(parse_urdf(xml), "weightless", static=True)
    model.drive_effort(np.array([0]), np.zeros(1))
    for _ in range(100):
        world.step()
    assert len(told) == 1 and "'weightless'" in told[0] and "'b'" in told[0] and "positive <mass>" in told[0]
    assert model.read_joints()[0][0] == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=0.05)
    world.close()
