# SPDX-License-Identifier: BSD-3-Clause
"""Meshes cut into parts, each of which collides as its own convex hull."""

import numpy as np
import pytest

from bullet_sim import World
from bullet_sim.convex_parts import cut
from urdf_model import parse_urdf

# A table seen from the side, along y from -1 to 1: a plate on two legs, as rectangles and as an outline (x, z).
RECTANGLES = [(0.0, 0.2, 0.0, 0.8), (1.8, 2.0, 0.0, 0.8), (0.0, 2.0, 0.8, 1.0)]
CORNERS = [(0, 0), (0.2, 0), (0.2, 0.8), (1.8, 0.8), (1.8, 0), (2, 0), (2, 1), (0, 1)]
PLANES = (("z", 0.8), ("x", 1.0))
TABLE = """<robot name="table"><link name="%s"><collision><geometry><mesh filename="table.obj"/></geometry></collision>
</link></robot>"""


def table_triangles():
    triangles = []
    for i, (x, z) in enumerate(CORNERS):
        next_x, next_z = CORNERS[(i + 1) % len(CORNERS)]
        a, b = (x, -1.0, z), (x, 1.0, z)
        c, d = (next_x, 1.0, next_z), (next_x, -1.0, next_z)
        triangles += [(a, b, c), (a, c, d)]
    for y in (-1.0, 1.0):
        for left, right, low, high in RECTANGLES:
            a, b, c, d = (left, y, low), (right, y, low), (right, y, high), (left, y, high)
            triangles += [(a, b, c), (a, c, d)]
    return triangles


def write_obj(path):
    lines = []
    for triangle in table_triangles():
        lines += ["v %g %g %g" % corner for corner in triangle]
    lines += ["f %d %d %d" % (i, i + 1, i + 2) for i in range(1, 3 * len(table_triangles()) + 1, 3)]
    path.write_text("\n".join(lines) + "\n")


def test_parts_lie_on_their_side_and_meet_in_the_planes():
    parts = [np.array(part) for part in cut(table_triangles(), PLANES)]
    assert len(parts) == 4
    for part in parts:
        for axis, offset in ((2, 0.8), (0, 1.0)):
            assert (part[:, axis] <= offset).all() or (part[:, axis] >= offset).all()
    # Both legs, and the two halves of the plate with their new corners in the middle.
    bounds = sorted((tuple(part.min(axis=0)), tuple(part.max(axis=0))) for part in parts)
    assert bounds[0] == ((0.0, -1.0, 0.0), (0.2, 1.0, 0.8))
    assert bounds[1] == ((0.0, -1.0, 0.8), (1.0, 1.0, 1.0))


def test_a_cut_that_meets_nothing_leaves_one_part():
    parts = cut(table_triangles(), (("y", 5.0),))
    assert len(parts) == 1
    assert {(x, z) for x, _, z in parts[0]} >= set(CORNERS)


def test_a_plane_may_cut_only_what_lies_between_two_heights():
    parts = cut(table_triangles(), (("z", 0.8), ("x", 1.0, 0.0, 0.8)))
    assert len(parts) == 3  # the legs are parted, the plate is not


@pytest.mark.parametrize("cuts, fraction", [(None, 0.0), ({"table": PLANES}, 1.0)])
def test_a_ray_passes_between_the_legs_of_a_cut_table(tmp_path, monkeypatch, cuts, fraction):
    """A free body is its convex hull, unless it is cut."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_obj(tmp_path / "table.obj")
    world = World(find_mesh=lambda uri: str(tmp_path / uri))
    world.spawn(parse_urdf(TABLE % "table"), "table", mesh_cuts=cuts)
    through, plate = world.ray_test_batch([(0.9, -3, 0.4), (0.9, -3, 0.9)], [(0.9, 3, 0.4), (0.9, 3, 0.9)])
    assert plate == pytest.approx(1 / 3, abs=0.01)
    assert through == pytest.approx(fraction or 1 / 3, abs=0.01)
    world.close()


def test_the_cut_mesh_is_kept_beside_the_whole_one(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_obj(tmp_path / "table.obj")
    for cuts in (None, {"table": PLANES}, {"table": PLANES}):
        world = World(find_mesh=lambda uri: str(tmp_path / uri))
        world.spawn(parse_urdf(TABLE % "table"), "table", mesh_cuts=cuts)
        world.close()
    assert len(list((tmp_path / "cache").rglob("*.obj"))) == 2


def test_pairs_of_a_body_whose_mesh_is_missing_are_left_out():
    arm = """<robot name="arm">
      <link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
        <collision><geometry><mesh filename="gone.obj"/></geometry></collision></link>
      <link name="near"/>
      <link name="far"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
      <joint name="a" type="revolute"><parent link="base"/><child link="near"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="b" type="revolute"><parent link="near"/><child link="far"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    for cuts, meets in ((None, True), ({"base": PLANES}, False)):
        world = World(find_mesh=lambda uri: None)
        model = world.spawn(parse_urdf(arm), "arm", static=True, self_collision_pairs=[("base", "far")], mesh_cuts=cuts)
        world.step()
        assert bool(world.contacts(model)) == meets
        world.close()
