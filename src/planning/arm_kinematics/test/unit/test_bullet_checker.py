# SPDX-License-Identifier: BSD-3-Clause
"""Collision-free inverse kinematics, on a robot of boxes with obvious contacts."""
import itertools
import math

import numpy as np
import pytest

from arm_kinematics import Chain, NoSolution, Reason, Target, solve
from arm_kinematics.bullet_checker import BulletChecker, plausible_pairs
from bullet_sim import Pose
from urdf_model import parse_urdf
from urdf_model.transforms import rigid, rpy_matrix

_LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial> <collision><origin xyz="%s"/><geometry><box size="%s"/></geometry></collision></link>"""
_JOINT = """<joint name="%s" type="revolute"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="0 0 1"/>
<limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>"""
# Three links of 1 m in a plane, each a bar 0.1 thick and 0.1 short of its joints, on a foot.
_PLANAR = "<robot name='planar'>%s</robot>" % "".join((
    _LINK % ("foot", "0 0 -0.5", "0.2 0.2 0.5"),
    *(_LINK % ("l%d" % i, "0.5 0 0", "0.8 0.1 0.1") for i in (1, 2, 3)),
    "<link name='tip'/>",
    _JOINT % ("j1", "foot", "l1", "0 0 0"), _JOINT % ("j2", "l1", "l2", "1 0 0"), _JOINT % ("j3", "l2", "l3", "1 0 0"),
    "<joint name='end' type='fixed'><parent link='l3'/><child link='tip'/><origin xyz='1 0 0'/></joint>"))
_JOINTS = ("j1", "j2", "j3")


@pytest.fixture
def planar():
    return parse_urdf(_PLANAR, source="planar")


@pytest.fixture
def checker(planar):
    checker = BulletChecker.of_robot(planar)
    yield checker
    checker.close()


def box(name, size):
    return parse_urdf("<robot name='%s'>%s</robot>" % (name, _LINK % ("box", "0 0 0", size)), source=name)


def test_straight_arm_is_clear_and_folded_arm_touches(checker):
    assert checker.contact(_JOINTS, np.zeros(3)) is None
    # A triangle: the third link comes back to the first.
    touch = checker.contact(_JOINTS, np.array([0.0, 2 * math.pi / 3, 2 * math.pi / 3 + 0.12]))
    assert {touch.link_a, touch.link_b} == {"l1", "l3"}
    assert not touch.with_world and touch.depth_m > 0.0
    # Clear again: it keeps no state between calls.
    assert checker.contact(_JOINTS, np.zeros(3)) is None


def boxes_file(path, *boxes):
    """A mesh of boxes, ((x, y, z) of the middle, sizes) each, as a Wavefront file."""
    lines, corners = [], list(itertools.product((-0.5, 0.5), repeat=3))
    for number, (middle, size) in enumerate(boxes):
        lines += ["v %g %g %g" % tuple(np.array(middle) + np.array(corner) * size) for corner in corners]
        for face in ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)):
            a, b, c, d = (corner + 8 * number for corner in face)
            lines += ["f %d %d %d" % (a, b, c), "f %d %d %d" % (a, c, d)]
    path.write_text("\n".join(lines) + "\n")


_WALLS = (((0.0, 1.6, 0.0), (0.2, 0.2, 0.4)), ((0.0, -1.6, 0.0), (0.2, 0.2, 0.4)))


@pytest.mark.parametrize("count", [1, 2])
def test_meshes_of_a_fixed_link_count_as_drawn(tmp_path, monkeypatch, count):
    """One wall is its hull, which replaces its triangles. Two walls are not: their hull fills the room between them."""
    boxes_file(tmp_path / "walls.obj", *_WALLS[:count])
    mesh = "<collision><geometry><mesh filename='walls.obj'/></geometry></collision></link>"
    checker = BulletChecker.of_robot(parse_urdf(_PLANAR.replace("</link>", mesh, 1)),
                                     find_mesh=lambda name: str(tmp_path / name))
    triangles, asked = checker.world.touching, []
    monkeypatch.setattr(checker.world, "touching", lambda model: asked.append(model) or triangles(model))
    at_the_wall, between = ((math.pi / 2, 0.0, 0.0), (math.pi / 2, 2.9, -2.0))
    touch = checker.contact(_JOINTS, np.array(at_the_wall))
    assert {touch.link_a, touch.link_b} == {"foot", "l2"}
    assert checker.contact(_JOINTS, np.array(between)) is None
    assert len(asked) == (0 if count == 1 else 2)
    # Obstacles are in the world of triangles alone.
    checker.world.spawn(box("post", "0.2 0.2 1"), "post", Pose((2.5, 0.0, 0)), static=True)
    assert checker.contact(_JOINTS, np.zeros(3)).link_b == "post/box"
    checker.close()


def test_cause_is_the_last_link_where_no_other_posture_helps(checker):
    """A post at the end of the straight arm: the last link is there in every posture with this pose of the tip."""
    checker.world.spawn(box("post", "0.2 0.2 1"), "post", Pose((2.5, 0.0, 0)), static=True)
    touch, is_fixed = checker.contact_and_cause(_JOINTS, np.zeros(3))
    assert touch.link_b == "post/box" and is_fixed
    checker.world.delete("post")
    checker.world.spawn(box("post", "0.2 0.2 1"), "post", Pose((1.5, 0.0, 0)), static=True)
    touch, is_fixed = checker.contact_and_cause(_JOINTS, np.zeros(3))
    assert touch.link_b == "post/box" and not is_fixed
    # The last link on the first one, which another posture moves.
    touch, is_fixed = checker.contact_and_cause(_JOINTS, np.array([1.0, 2 * math.pi / 3, 2 * math.pi / 3 + 0.12]))
    assert {touch.link_a, touch.link_b} == {"l1", "l3"} and not is_fixed


def test_world_is_seen_and_named(checker):
    checker.world.spawn(box("post", "0.2 0.2 1"), "post", Pose((1.5, 0.6, 0)), static=True)
    assert checker.contact(_JOINTS, np.zeros(3)) is None
    touch = checker.contact(_JOINTS, np.array([math.atan2(0.6, 1.5), 0.0, 0.0]))
    assert (touch.link_a, touch.link_b, touch.with_world) == ("l2", "post/box", True)


def test_links_that_the_joints_do_not_move_do_not_count(checker):
    checker.world.spawn(box("post", "0.2 0.2 1"), "post", Pose((0.5, 0.0, 0)), static=True)
    assert checker.contact(_JOINTS, np.zeros(3)).link_b == "post/box"
    checker.set_posture(["j1"], [0.0])
    assert checker.contact(("j2", "j3"), np.zeros(2)) is None


def test_answer_bends_around_what_stands_there(planar, checker):
    """The tip on the x axis: the elbow may be on either side. A box stands on the side of the plain answer."""
    chain = Chain.from_robot(planar, "foot", "tip")
    target = rigid(np.eye(3), (1.8, 0.0, 0.0))
    seed = np.array([0.8, -0.8, -0.8])
    anyhow = Target(target, position_only=True)
    plain = solve(chain, anyhow, seed)
    elbow = chain.link_frames(plain.q)["l2"][:2, 3]
    checker.world.spawn(box("post", "0.3 0.3 1"), "post", Pose((*elbow, 0)), static=True)
    answer = solve(chain, anyhow, seed, checker=checker)
    assert checker.contact(_JOINTS, plain.q) is not None
    assert checker.contact(_JOINTS, answer.q) is None
    np.testing.assert_allclose(chain.fk(answer.q)[:3, 3], target[:3, 3], atol=2e-6)
    # Walls on both sides leave no solution, and the verdict names them.
    checker.world.spawn(box("wall", "0.3 9 1"), "wall", Pose((1.0, 0.0, 0)), static=True)
    with pytest.raises(NoSolution, match="wall/box") as caught:
        solve(chain, anyhow, seed, checker=checker)
    assert caught.value.reason is Reason.WORLD_COLLISION
    assert caught.value.pair[1] == "wall/box"


def test_pose_that_only_a_folded_arm_reaches_names_the_pair(checker):
    """With the heading given, an elbow that bends one way only leaves one posture."""
    one_way = _PLANAR.replace('lower="-3.1"', 'lower="0"').replace('lower="0"', 'lower="-3.1"', 1)
    chain = Chain.from_robot(parse_urdf(one_way, source="one way"), "foot", "tip")
    q = np.array([0.0, 2 * math.pi / 3, 2 * math.pi / 3 + 0.12])
    target = chain.fk(q)
    np.testing.assert_allclose(target[:3, :3], rpy_matrix(0, 0, 4 * math.pi / 3 + 0.12), atol=1e-9)
    np.testing.assert_allclose(solve(chain, target, np.zeros(3)).q, q, atol=1e-5)
    with pytest.raises(NoSolution) as caught:
        solve(chain, target, np.zeros(3), checker=checker)
    assert caught.value.reason is Reason.SELF_COLLISION
    assert set(caught.value.pair) == {"l1", "l3"}


def test_plausible_pairs_leave_out_neighbours_and_what_always_touches(planar):
    checker = BulletChecker.of_robot(planar)
    pairs = plausible_pairs(checker.world, checker.world.models["planar"])
    assert {frozenset(pair) for pair in pairs} == {
        frozenset(pair) for pair in (("foot", "l2"), ("foot", "l3"), ("l1", "l3"))}
    checker.close()
    thick = parse_urdf(_PLANAR.replace("0.8 0.1 0.1", "2.4 2.4 0.1"), source="thick")
    checker = BulletChecker.of_robot(thick)
    pairs = plausible_pairs(checker.world, checker.world.models["planar"])
    assert frozenset(("l1", "l3")) not in {frozenset(pair) for pair in pairs}
    checker.close()


def test_margin_lets_shallow_touches_pass(planar):
    q = np.array([0.0, 2 * math.pi / 3, 2 * math.pi / 3 + 0.12])
    strict = BulletChecker.of_robot(planar)
    depth = strict.contact(_JOINTS, q).depth_m
    strict.close()
    for margin, touches in ((depth + 1e-3, False), (depth - 1e-3, True)):
        checker = BulletChecker.of_robot(planar, margin_m=margin)
        assert (checker.contact(_JOINTS, q) is not None) == touches
        checker.close()
