# SPDX-License-Identifier: BSD-3-Clause
"""Constraints: kept or not and by how much, and postures that keep to them."""
import itertools
import math

import numpy as np
import pytest

from motion_planning.constraints import (
    ConstraintError,
    ConstraintSet,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    VisibilityTarget,
    sampler,
)
from motion_planning.exact import ExactChecker
from motion_planning.kinematics import fk
from motion_planning.scene import Cone, Scene, TriangleMesh, WorldObject
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import axis_rotation, quaternion_from_matrix, rigid, rpy_matrix

NEUTRAL = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)


def at(x=0.0, y=0.0, z=0.0, turn=None):
    return rigid(np.eye(3) if turn is None else turn, (x, y, z))


@pytest.fixture(scope="module")
def scene(baxter):
    values = {"%s_%s" % (side, joint): value for side in ("left", "right")
              for joint, value in zip(("s0", "s1", "e0", "e1", "w0", "w1", "w2"), NEUTRAL, strict=True)}
    base = Scene(baxter).with_state(baxter.state(values, at(0.0, 0.0, 0.9)))
    # Of Baxter's own links these tests want to hear nothing: only of what they put there.
    names = list(baxter.links)
    return base.with_allowed(base.allowed.with_entries(
        {(a, b): True for k, a in enumerate(names) for b in names[:k]}))


@pytest.fixture(scope="module")
def exact(baxter, meshes):
    return ExactChecker(baxter, meshes)


def one(scene, constraint, exact=None):
    kind = {JointTarget: "joints", PositionTarget: "positions", OrientationTarget: "orientations",
            VisibilityTarget: "visibilities"}[type(constraint)]
    (result,) = ConstraintSet(**{kind: [constraint]}).evaluate(scene.model, scene.state, scene, exact)
    assert result.satisfied == (result.sentence == "")
    return result


# -- evaluation ---------------------------------------------------------------------------------------------------


def test_joints(scene):
    assert one(scene, JointTarget("left_s1", -0.5, 0.0, 0.1)).satisfied
    far = one(scene, JointTarget("left_s1", -0.5, 0.0, 0.01, weight=2.0))
    assert far.distance == pytest.approx(0.1)
    assert far.sentence == "joint 'left_s1' is at -0.5500; expected -0.5100 to -0.5000"
    with pytest.raises(ConstraintError, match="joint 'nose'"):
        one(scene, JointTarget("nose", 0.0))
    for bad in ((math.nan, 0.1, 0.1), (0.0, -0.1, 0.1), (0.0, 0.1, math.inf)):
        with pytest.raises(ConstraintError):
            JointTarget("left_s1", *bad)


def test_joints_that_turn_without_end(mix):
    scene = Scene(mix, mix.state({"turn": -3.1}))
    assert one(scene, JointTarget("turn", 3.1, 0.1, 0.1)).satisfied
    assert one(scene, JointTarget("turn", 3.1, 0.1, 0.1)).distance == pytest.approx(2 * math.pi - 6.2)


def test_positions(scene):
    tip = scene.frame("left_gripper")
    there = ((Sphere(0.01), tip @ at(0.0, 0.0, 0.1)),)
    assert one(scene, PositionTarget("left_gripper", there, (0.0, 0.0, 0.095))).satisfied
    off = one(scene, PositionTarget("left_gripper", there))
    assert not off.satisfied and off.distance == pytest.approx(0.1) and "0.1000 m from the middle" in off.sentence
    # One of several regions is enough; regions in the frame of a link.
    assert one(scene, PositionTarget("left_gripper", (*there, (Box((0.1, 0.1, 0.1)), tip)))).satisfied
    inside = np.linalg.inv(scene.frame("torso")) @ tip
    assert one(scene, PositionTarget("left_gripper", ((Sphere(1e-6), inside),), frame="torso")).satisfied


CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
MESH = TriangleMesh(CORNERS, [corners for a, b, c, d in SIDES for corners in ((a, b, c), (d, c, a))])


@pytest.mark.parametrize("shape, inside, outside", [
    (Box((0.2, 0.4, 0.6)), (0.1, -0.2, 0.3), (0.11, 0.0, 0.0)),
    (Cylinder(0.1, 0.4), (0.07, 0.07, 0.2), (0.08, 0.08, 0.0)),
    (Cylinder(0.1, 0.4), (0.0, 0.0, -0.2), (0.0, 0.0, 0.21)),
    (Cone(0.2, 0.4), (0.09, 0.0, 0.0), (0.11, 0.0, 0.0)),
    (Sphere(0.1), (0.0, 0.1, 0.0), (0.08, 0.08, 0.0)),
    (MESH, (0.99, -0.99, 0.99), (1.01, 0.0, 0.0)),
])
def test_regions(scene, shape, inside, outside):
    tip = scene.frame("left_gripper")
    for point, kept in ((inside, True), (outside, False)):
        assert one(scene, PositionTarget("left_gripper", ((shape, tip @ at(*(-np.array(point)))),))).satisfied is kept


def test_positions_that_are_none(scene):
    for make, words in ((lambda: PositionTarget("left_gripper", ()), "no region"),
                        (lambda: PositionTarget("left_gripper", ((Plane(), at()),)), "a Plane as region"),
                        (lambda: PositionTarget("left_gripper", ((Sphere(1.0), at(math.nan)),)), "not finite"),
                        (lambda: one(scene, PositionTarget("nose", ((Sphere(1.0), at()),))), "'nose' is not a frame"),
                        (lambda: one(scene, PositionTarget("torso", ((Sphere(1.0), at()),), frame="x")), "'x' is no"),):
        with pytest.raises(ConstraintError, match=words):
            make()


def test_orientations(scene):
    turn = scene.frame("left_gripper")[:3, :3]
    for wanted in (turn, quaternion_from_matrix(turn)):
        assert one(scene, OrientationTarget("left_gripper", wanted)).satisfied
    off = OrientationTarget("left_gripper", turn @ rpy_matrix(0.2, 0, 0).T, (0.1, 0.1, 0.1))
    assert one(scene, off).distance == pytest.approx(0.2)
    assert "turned by 0.2000 0.0000 0.0000 rad" in one(scene, off).sentence
    for bad in ((0, 0, 0, 0), (math.nan, 0, 0, 1), np.zeros((3, 3))):
        with pytest.raises(ConstraintError):
            OrientationTarget("left_gripper", bad)
    with pytest.raises(ConstraintError, match="three of 0 or more"):
        OrientationTarget("left_gripper", turn, (0.1, -0.1, 0.1))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle", [-3.0, -1.6, 0.4, 1.6, 3.1])
@pytest.mark.parametrize("rotation_vector", [False, True])
def test_one_axis_is_free(scene, axis, angle, rotation_vector):
    """However far it is turned about the free axis."""
    turn = scene.frame("left_gripper")[:3, :3]
    direction = np.eye(3)[axis]
    wanted = turn @ axis_rotation(direction, angle).T
    free = [0.01, 0.01, 0.01]
    free[axis] = math.pi
    assert one(scene, OrientationTarget("left_gripper", wanted, tuple(free), "", rotation_vector)).satisfied
    assert not one(scene, OrientationTarget("left_gripper", wanted, (0.01,) * 3, "", rotation_vector)).satisfied


def test_half_a_turn_has_a_rotation_vector(scene):
    turn = scene.frame("left_gripper")[:3, :3]
    for direction in ((1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.0, -0.6, 0.8)):
        result = one(scene, OrientationTarget("left_gripper", turn @ axis_rotation(direction, math.pi),
                                              rotation_vector=True))
        assert result.distance == pytest.approx(math.pi * np.abs(direction).sum())


def test_visibility(scene, exact):
    camera = at(2.0, 0.0, 1.2, rpy_matrix(0.0, -math.pi / 2, 0.0))  # looks along -x
    # A disc on the left gripper, facing the camera.
    tip = scene.frame("left_gripper")
    facing = np.linalg.inv(tip) @ at(*tip[:3, 3], rpy_matrix(0.0, math.pi / 2, 0.0))
    target = VisibilityTarget(0.02, facing @ at(0.0, 0.0, 0.2), camera, "left_gripper", "", max_view_angle=0.3)
    assert one(scene, target, exact).satisfied
    turned = VisibilityTarget(0.02, facing @ at(0.0, 0.0, 0.2, rpy_matrix(0.5, 0, 0)), camera, "left_gripper",
                              max_view_angle=0.3)
    assert "turned away from the sensor by 0.5" in one(scene, turned, exact).sentence
    beside = VisibilityTarget(0.02, facing @ at(0.0, 0.0, 0.2), camera, "left_gripper", max_range_angle=0.05)
    assert "off the sensor's axis" in one(scene, beside, exact).sentence
    behind = VisibilityTarget(0.02, at(-0.6, 0.0, 1.2), camera)
    assert "is between the sensor and the target" in one(scene, behind, exact).sentence
    assert one(scene, behind).satisfied  # without a checker nothing stands in the way
    along_x = VisibilityTarget(0.02, facing @ at(0.0, 0.0, 0.2), at(2.0, 0.0, 1.2, rpy_matrix(0, 0, math.pi)),
                               "left_gripper", view_axis=2, max_view_angle=0.3)
    assert one(scene, along_x, exact).satisfied
    assert not one(scene, VisibilityTarget(0.02, at(), at()), exact).satisfied
    with pytest.raises(ConstraintError):
        VisibilityTarget(0.02, at(), at(), cone_sides=2)


def test_a_set_answers_in_order_and_names_the_first_that_is_broken(scene):
    tip = scene.frame("left_gripper")
    both = ConstraintSet("goal", [JointTarget("left_s0", 0.0)], [PositionTarget("left_gripper", ((Sphere(0.1), tip),))],
                         [OrientationTarget("left_gripper", tip[:3, :3] @ rpy_matrix(0, 0, 1.0))])
    results = both.evaluate(scene.model, scene.state, scene)
    assert [result.satisfied for result in results] == [True, True, False] and len(both) == 3
    assert both.broken(scene.model, scene.state, scene) == results[2].sentence
    assert ConstraintSet().broken(scene.model, scene.state, scene) is None
    assert len(both.merged(both)) == 6 and both.merged(both).name == "goal"


def test_frames_are_looked_up_when_the_goal_is_set(scene):
    """A step of the gripper in its own frame, and a goal for a subframe of what it holds."""
    ahead = ConstraintSet("", (), [PositionTarget("left_gripper", ((Sphere(1e-3), at(0.0, 0.0, 0.05)),),
                                                  frame="left_gripper")])
    resolved = ahead.resolved(scene)
    wanted = scene.frame("left_gripper") @ at(0.0, 0.0, 0.05)
    np.testing.assert_allclose(resolved.positions[0].regions[0][1], wanted, atol=1e-12)
    cup = WorldObject("cup", at(0.0, 0.0, 0.1, rpy_matrix(0.3, 0, 0)), ((Sphere(0.02), np.eye(4)),),
                      {"rim": at(0.0, 0.05, 0.0, rpy_matrix(0, 0.2, 0))})
    held = scene.attach(cup, "left_gripper")
    rim = held.frame("cup/rim")
    goal = ConstraintSet("", (), [PositionTarget("cup/rim", ((Sphere(1e-6), rim),))],
                         [OrientationTarget("cup/rim", rim[:3, :3])])
    assert goal.broken(held.model, held.state, held) is None
    moved = goal.resolved(held)
    assert {one.link for one in moved.positions + moved.orientations} == {"left_gripper"}
    assert moved.broken(held.model, held.state, held) is None
    with pytest.raises(ConstraintError, match="'cup/rim', which is neither a link nor attached"):
        goal.resolved(scene)


# -- sampling -----------------------------------------------------------------------------------------------------


def take(samples, number):
    return list(itertools.islice(samples, number))


def kept(scene, group, constraints, q):
    state = scene.state.with_q(q, scene.model.groups[group].indices)
    return constraints.broken(scene.model, state, scene)


def pose_goal(link, pose, position=1e-4, orientation=1e-3):
    return ConstraintSet("", (), [PositionTarget(link, ((Sphere(position), pose),))],
                         [OrientationTarget(link, pose[:3, :3], (orientation,) * 3)])


def test_a_joint_goal_has_one_posture(scene, exact):
    group = scene.model.groups["left_arm"]
    goal = ConstraintSet("", [JointTarget(name, 0.2) for name in group.joints[:-1]] + [JointTarget("left_w2", 0.4)])
    samples = sampler(scene.model, "left_arm", goal, scene, exact, 0)
    (q,) = list(samples)
    np.testing.assert_allclose(q, [0.2] * 6 + [0.4], atol=1e-12)
    assert samples.reason is None


def test_joints_that_are_free_keep_their_value_first(scene, exact):
    goal = ConstraintSet("", [JointTarget("left_s0", 0.3, 0.1, 0.1)])
    samples = take(sampler(scene.model, "left_arm", goal, scene, exact, 0), 20)
    assert len(samples) == 20
    np.testing.assert_allclose(samples[0], (0.3, *NEUTRAL[1:]))
    assert all(0.2 <= q[0] <= 0.4 for q in samples) and np.std([q[1] for q in samples]) > 0.1


def test_joint_goals_that_cannot_be(scene, exact):
    for targets, words in (([JointTarget("left_s1", 5.0)], "limits and the other constraints leave"),
                           ([JointTarget("left_s1", 0.1), JointTarget("left_s1", 0.5)], "leave 0.0999 to 0.1001"),
                           ([JointTarget("right_s1", 0.3)], "joint 'right_s1' is at -0.55")):
        samples = sampler(scene.model, "left_arm", ConstraintSet("", targets), scene, exact, 0)
        assert list(samples) == [] and words in samples.reason
    at_limit = float(scene.model.bounds[scene.model.index["left_s1"], 1])
    for goal, tolerance in ((at_limit, 0.0), (at_limit + 5e-7, 1e-6), (at_limit + 5e-5, 1e-4)):
        assert list(sampler(scene.model, "left_arm", ConstraintSet("", [
            JointTarget(name, goal if name == "left_s1" else 0.1, tolerance, tolerance)
            for name in scene.model.groups["left_arm"].joints]), scene, exact, 0))


def test_joints_without_end_are_met_across_half_a_turn(mix):
    scene = Scene(mix)
    goal = ConstraintSet("", [JointTarget("turn", 9.3, 0.3, 0.3)])
    samples = take(sampler(mix, "arm", goal, scene, None, 0), 30)
    assert len(samples) == 30 and min(q[0] for q in samples) < -3.0 and max(q[0] for q in samples) > 3.0
    assert all(kept(scene, "arm", goal, q) is None for q in samples)


@pytest.mark.parametrize("group, link", [("left_arm", "left_gripper"), ("right_arm", "right_hand"),
                                         ("both_arms", "left_gripper")])
def test_pose_goals(scene, exact, group, link):
    generator = np.random.default_rng(4)
    for _ in range(5):
        q = generator.uniform(*scene.model.bounds.T)
        goal = pose_goal(link, fk(scene.model, q, [link], scene.state.base)[link])
        samples = take(sampler(scene.model, group, goal, scene, exact, 0), 5)
        assert len(samples) == 5
        assert all(kept(scene, group, goal, sample) is None for sample in samples)
        assert all(np.abs(a - b).max() > 1e-3 for a, b in itertools.combinations(samples, 2))


def test_poses_of_both_hands(scene, exact):
    q = np.random.default_rng(5).uniform(*scene.model.bounds.T)
    poses = fk(scene.model, q, ["left_gripper", "right_gripper"], scene.state.base)
    goal = pose_goal("left_gripper", poses["left_gripper"]).merged(pose_goal("right_gripper", poses["right_gripper"]))
    samples = take(sampler(scene.model, "both_arms", goal, scene, exact, 0), 3)
    assert len(samples) == 3 and all(kept(scene, "both_arms", goal, sample) is None for sample in samples)


@pytest.mark.parametrize("turned", [True, False])
def test_a_point_beside_the_links_origin_is_put_there(scene, exact, turned):
    point = np.array((0.02, -0.03, 0.12))
    pose = at(0.7, 0.3, 1.0, rpy_matrix(math.pi, 0, 0))
    goal = ConstraintSet("", (), [PositionTarget("left_gripper", ((Sphere(0.005), pose),), point)],
                         [OrientationTarget("left_gripper", pose[:3, :3])] if turned else ())
    samples = take(sampler(scene.model, "left_arm", goal, scene, exact, 0), 3)
    assert len(samples) == 3
    for sample in samples:
        state = scene.state.with_q(sample, scene.model.groups["left_arm"].indices)
        tip = scene.with_state(state).frame("left_gripper")
        assert np.linalg.norm((tip @ np.append(point, 1.0))[:3] - pose[:3, 3]) <= 0.005 + 1e-9


@pytest.mark.parametrize("goal", [
    ConstraintSet("", (), [PositionTarget("left_gripper", ((Box((0.2, 0.3, 0.1)), at(0.7, 0.2, 1.1)),))]),
    ConstraintSet("", (), [PositionTarget("left_gripper", ((Cylinder(0.1, 0.3), at(0.7, 0.2, 1.1)),), (0, 0, 0.1))]),
    ConstraintSet("", (), [PositionTarget("left_gripper", ((Sphere(1e-3), at(9.0)),
                                                           (Sphere(0.1), at(0.7, 0.2, 1.1))))]),
    ConstraintSet("", (), (), [OrientationTarget("left_gripper", rpy_matrix(math.pi, 0, 0), (0.1, 0.1, math.pi))]),
    ConstraintSet("", [JointTarget("left_w2", 0.5, 0.4, 0.4)],
                  [PositionTarget("left_gripper", ((Sphere(0.05), at(0.7, 0.3, 1.0)),))],
                  [OrientationTarget("left_gripper", rpy_matrix(math.pi, 0, 0), (0.2, 0.2, math.pi))]),
], ids=["box", "offset", "regions", "orientation", "mixed"])
def test_goals_that_leave_some_freedom(scene, exact, goal):
    samples = take(sampler(scene.model, "left_arm", goal, scene, exact, 0), 10)
    assert len(samples) == 10 and all(kept(scene, "left_arm", goal, sample) is None for sample in samples)
    assert len(set(map(tuple, np.round(samples, 2)))) > 3


def test_goals_out_of_reach_say_so(scene, exact):
    samples = sampler(scene.model, "left_arm", pose_goal("left_gripper", at(5.0)), scene, exact, 0)
    assert list(samples) == [] and "'left_gripper' cannot be put there: out of reach" in samples.reason
    samples = sampler(scene.model, "left_arm", pose_goal("right_gripper", at(0.5)), scene, exact, 0)
    assert list(samples) == [] and "does not move link 'right_gripper'" in samples.reason


def test_goals_in_collision_name_what_touches(scene, exact):
    pose = scene.frame("left_gripper")
    blocked = scene.with_object(WorldObject("wall", pose, ((Box((0.2, 0.2, 0.2)), np.eye(4)),)))
    samples = sampler(scene.model, "left_arm", pose_goal("left_gripper", pose), blocked, exact, 0)
    assert list(samples) == [] and "touches 'wall'" in samples.reason
    assert take(sampler(scene.model, "left_arm", pose_goal("left_gripper", pose), blocked, None, 0), 1)


def test_samples_avoid_what_stands_there(scene, exact):
    goal = ConstraintSet("", (), [PositionTarget("left_gripper", ((Sphere(0.15), at(0.8, 0.3, 1.1)),))])
    crowded = scene.with_object(WorldObject("post", at(0.8, 0.2, 1.0), ((Box((0.05, 0.05, 2.0)), np.eye(4)),)))
    samples = take(sampler(scene.model, "left_arm", goal, crowded, exact, 0), 10)
    assert len(samples) == 10
    indices = scene.model.groups["left_arm"].indices
    assert all(exact.free(crowded, crowded.state.with_q(q, indices), "left_arm") for q in samples)


def test_a_six_axis_arm_gives_each_of_its_postures_once(probot):
    scene = Scene(probot)
    q = np.array((0.3, -0.4, 0.5, 0.2, 0.8, -0.3))
    goal = pose_goal("tool0", fk(probot, q, ["tool0"])["tool0"])
    samples = list(sampler(probot, "manipulator", goal, scene, None, 0))
    assert 1 <= len(samples) <= 64 and all(kept(scene, "manipulator", goal, sample) is None for sample in samples)
    assert all(np.abs(a - b).max() > 1e-3 for a, b in itertools.combinations(samples, 2))


def test_stopping(scene, exact):
    asked = itertools.count()
    samples = sampler(scene.model, "left_arm", ConstraintSet(), scene, exact, 0, lambda: next(asked) >= 5)
    assert len(list(samples)) == 5 and samples.reason == "it was stopped"


def test_the_same_seed_gives_the_same_postures(scene, exact):
    goal = ConstraintSet("", (), [PositionTarget("left_gripper", ((Sphere(0.15), at(0.8, 0.3, 1.1)),))])
    first, second, other = (np.array(take(sampler(scene.model, "left_arm", goal, scene, exact, seed), 4))
                            for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first[1:], other[1:])


def test_names_that_nothing_has(scene, exact):
    for goal in (ConstraintSet("", [JointTarget("nose", 0.0)]), pose_goal("nose", at())):
        with pytest.raises(ConstraintError, match="'nose'"):
            sampler(scene.model, "left_arm", goal, scene, exact, 0)
