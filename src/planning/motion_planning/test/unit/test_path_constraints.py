# SPDX-License-Identifier: BSD-3-Clause
"""Path constraints hold in every state that a controller plays."""
import itertools
import math
import time
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from motion_planning.constraints import (
    ConstraintSet,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    regions,
    sampler,
)
from motion_planning.constraints.manifold import Manifold
from motion_planning.exact import ExactChecker
from motion_planning.kinematics import ik
from motion_planning.model import PlanningModel
from motion_planning.pipeline import Code, PlanningFailure, PlanQuery, Tools, plan
from motion_planning.planners import NoPath, SearchOptions, plan_path
from motion_planning.scene import AttachedBody, Scene, WorldObject
from motion_planning.shapes import Cone, TriangleMesh
from urdf_model import Box, Cylinder, Sphere
from urdf_model.transforms import axis_rotation, inverse, rigid

# As long as a slow machine may need: what is tested is the answer.
PATIENCE_S = 120.0
DOWN, AHEAD = np.diag([1.0, -1.0, -1.0]), np.eye(3)
ORIGIN = (0.0, 0.0, 0.0)


class Lab(NamedTuple):
    """A robot at rest in a scene, one of its groups and the link that the constraints are on."""

    scene: Scene
    exact: ExactChecker
    group: str
    link: str

    @property
    def indices(self):
        return self.scene.model.groups[self.group].indices

    def posture(self, position, turn=DOWN, scene=None):
        """A free posture (k,) with the link there."""
        scene = scene or self.scene

        def accept(q):
            return None if self.exact.free(scene, scene.state.with_q(q)) else "it touches"

        return ik(scene.model, self.group, {self.link: rigid(turn, position)}, scene.state, 5.0, accept)

    def at(self, q):
        return self._replace(scene=self.scene.with_state(self.scene.state.with_q(q)))

    def plan(self, goal, constraints, clock=time.monotonic, **options):
        query = PlanQuery(self.scene, self.group, [goal], constraints, allowed_time=PATIENCE_S, **options)
        return plan(query, Tools(self.exact, plan_path, sampler, clock, seed=3))

    def poses(self, timed):
        """Poses (n, 4, 4) of the link every 2 ms as controllers play a trajectory; nothing touches on the way."""
        states = timed.sampled(np.linspace(0.0, timed.duration, max(500, int(timed.duration / 0.002))))[0]
        assert self.exact.first_blocked(self.scene, states, self.group) is None
        model, base = self.scene.model, self.scene.state
        return np.array([model.frame_of(base.with_q(q, self.indices).q, self.link) for q in states])


def at_pose(link, pose, tolerance=1e-3):
    return ConstraintSet(positions=[PositionTarget(link, [(Sphere(tolerance), pose)])],
                         orientations=[OrientationTarget(link, pose[:3, :3], (tolerance,) * 3)])


def box(scene, name, position, size):
    return scene.with_object(WorldObject(name, rigid(np.eye(3), position), ((Box(size), np.eye(4)),)))


def tilts(poses, axis):
    """Angles (n,) between a link's z axis and ``axis``."""
    return np.arccos(np.clip(poses[:, :3, 2] @ axis, -1.0, 1.0))


@pytest.fixture(scope="module")
def cup(baxter, meshes):
    """Baxter's left arm over a table with a box on it, in the way."""
    scene = Scene(baxter, baxter.state({"left_s1": -0.55, "left_e1": 0.75, "left_w1": 1.26, "right_s1": -0.55,
                                        "right_e1": 0.75, "right_w1": 1.26, "right_s0": -0.8}))
    scene = box(box(scene, "table", (0.85, 0.2, -0.35), (0.7, 1.4, 0.3)), "crate", (0.75, 0.3, -0.05), (0.3, 0.1, 0.3))
    # What its parts do to each other is for others to test.
    own = {(a, b): True for k, a in enumerate(baxter.links) for b in baxter.links[:k]}
    scene = scene.with_allowed(scene.allowed.with_entries(own))
    lab = Lab(scene, ExactChecker(baxter, meshes), "left_arm", "left_gripper")
    return lab.at(lab.posture((0.7, 0.55, 0.05)))


def test_a_cup_stays_upright_around_a_box(cup):
    upright = ConstraintSet(orientations=[OrientationTarget(cup.link, DOWN, (0.1, 0.1, math.pi))])
    goal = at_pose(cup.link, rigid(DOWN, (0.7, 0.02, 0.05)))
    found = cup.plan(goal, upright)
    poses = cup.poses(found.timed)
    # Each of two tilts is at most 0.1.
    assert tilts(poses, np.array([0.0, 0.0, -1.0])).max() <= math.hypot(0.1, 0.1) + 1e-6
    assert np.linalg.norm(poses[-1, :3, 3] - (0.7, 0.02, 0.05)) < 2e-3
    end = cup.scene.state.with_q(found.timed.positions[-1], cup.indices)
    assert goal.broken(cup.scene.model, end, cup.scene) is None
    # By a clock that stands still, since a slow machine tries fewer postures of the goal, and takes another way.
    free = tilts(cup.poses(cup.plan(goal, None, clock=lambda: 0.0).timed), np.array([0.0, 0.0, -1.0])).max()
    assert free > 0.2, "the way is no harder with the constraint"


def test_a_goal_that_says_only_where_is_reached_upright(cup):
    upright = ConstraintSet(orientations=[OrientationTarget(cup.link, DOWN, (0.1, 0.1, math.pi))])
    goal = ConstraintSet(positions=[PositionTarget(cup.link, [(Sphere(0.005), rigid(np.eye(3), (0.7, 0.6, 0.25)))])])
    poses = cup.poses(cup.plan(goal, upright).timed)
    assert tilts(poses, np.array([0.0, 0.0, -1.0])).max() <= math.hypot(0.1, 0.1) + 1e-6


@pytest.fixture(scope="module")
def desk(probot, meshes):
    lab = Lab(Scene(probot), ExactChecker(probot, meshes), "manipulator", "tool0")
    return lab.at(lab.posture((0.25, -0.2, 0.2), AHEAD))


@pytest.mark.parametrize("timing", ["time_optimal_trajectory_generation", "iterative_time_parameterization", "ruckig"])
def test_a_tool_stays_in_a_thin_plane(desk, timing):
    thin = 0.001
    plane = ConstraintSet(positions=[PositionTarget(
        desk.link, [(Box((2.0, 2.0, thin)), rigid(np.eye(3), (0.0, 0.0, 0.2)))])])
    goal = at_pose(desk.link, rigid(AHEAD, (0.25, 0.2, 0.2)), 2e-4)
    poses = desk.poses(desk.plan(goal, plane, timing=timing).timed)
    assert np.abs(poses[:, 2, 3] - 0.2).max() <= 0.5 * thin + 1e-6
    assert np.abs(poses[-1, :3, 3] - (0.25, 0.2, 0.2)).max() < 1e-3


def test_joints_stay_within_their_constraints(desk):
    q = desk.scene.state.q
    narrow = ConstraintSet(joints=[JointTarget("joint_5", q[4], 0.05, 0.05)])
    goal = ConstraintSet(joints=[JointTarget("joint_1", q[0] + 1.0), JointTarget("joint_3", q[2] - 0.4)])
    timed = desk.plan(goal, narrow).timed
    states = timed.sampled(timed.spaced(0.001))[0]
    assert np.abs(states[:, 4] - q[4]).max() <= 0.05 + 1e-6
    assert timed.positions[-1, 0] == pytest.approx(q[0] + 1.0, abs=2e-4)


def test_a_start_that_breaks_them_is_told_with_the_numbers(desk):
    tilted = ConstraintSet(orientations=[OrientationTarget(desk.link, AHEAD @ axis_rotation((1.0, 0.0, 0.0), 0.5),
                                                           (0.1, 0.1, math.pi))])
    with pytest.raises(PlanningFailure) as failure:
        desk.plan(ConstraintSet(joints=[JointTarget("joint_1", 0.1)]), tilted)
    assert failure.value.code == Code.START_STATE_VIOLATES_PATH_CONSTRAINTS
    assert "'tool0' is turned" in str(failure.value)


def test_time_and_stop_end_the_search(cup):
    upright = ConstraintSet(orientations=[OrientationTarget(cup.link, DOWN, (0.1, 0.1, math.pi))])
    start, goal = cup.scene.state.q[cup.indices], cup.posture((0.7, 0.02, 0.05))[cup.indices]
    planned = plan_path(cup.scene, cup.group, start, goal, SearchOptions(cup.exact, 1, PATIENCE_S, time.monotonic,
                                                                         constraints=upright))
    assert len(planned.points) > 5 and np.array_equal(planned.points[-1], goal)

    def refused(goal, **more):
        # Time is the number of looks at the clock.
        with pytest.raises(NoPath) as failure:
            plan_path(cup.scene, cup.group, start, goal,
                      SearchOptions(cup.exact, 1, 8, itertools.count().__next__, constraints=upright, **more))
        return failure.value

    late = refused(goal)
    assert late.late and "keeps to the constraints was looked for" in str(late)
    looks = itertools.count()
    assert refused(goal, stop=lambda: next(looks) > 2).stopped
    tipped = np.array(goal)
    tipped[5] += 0.6
    assert "the goal does not keep to the path constraints" in str(refused(tipped))


# -- the manifold -----------------------------------------------------------------------------------------------

SHAPES = [Box((0.1, 0.02, 0.05)), Sphere(0.03), Cylinder(0.02, 0.1)]
TARGETS = {
    "turn": [OrientationTarget("tool0", AHEAD, (0.1, 0.2, math.pi))],
    "turn about x": [OrientationTarget("tool0", AHEAD, (math.pi, 0.05, 0.05))],
    "turn as a vector": [OrientationTarget("tool0", AHEAD, (0.1, 0.1, math.pi), rotation_vector=True)],
    **{type(shape).__name__: [PositionTarget("tool0", [(shape, rigid(axis_rotation((0.6, 0.0, 0.8), 0.4),
                                                                     (0.3, 0.1, 0.3)))], (0.02, 0.0, 0.05))]
       for shape in SHAPES}}


def constraint_set(targets):
    kinds = {PositionTarget: "positions", OrientationTarget: "orientations"}
    return ConstraintSet(**{kinds[type(targets[0])]: targets})


@pytest.mark.parametrize("name", TARGETS)
def test_postures_are_brought_onto_constraints(desk, name):
    constraints, model = constraint_set(TARGETS[name]), desk.scene.model
    manifold = Manifold(desk.scene, model.groups[desk.group], constraints, np.zeros(6))
    random, found = np.random.default_rng(5), 0
    for q in random.uniform(*model.bounds.T, (60, 6)):
        near = manifold.project(q)
        assert manifold.keeps(q) == (constraints.broken(model, desk.scene.state.with_q(q), desk.scene) is None)
        if near is not None:
            assert constraints.broken(model, desk.scene.state.with_q(near), desk.scene) is None
            assert not model.beyond_limits(near)
            found += 1
    assert found > 25


@pytest.mark.parametrize("name", TARGETS)
def test_residuals_change_as_their_derivatives_say(desk, name):
    manifold = Manifold(desk.scene, desk.scene.model.groups[desk.group], constraint_set(TARGETS[name]), np.zeros(6))
    part, tiny, looked = manifold._parts[0], 1e-6, 0
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (20, 6)):
        residual, derivatives = part.residual(q, margin=False)
        numbers = np.column_stack([(part.residual(q + step, margin=False)[0] - part.residual(q - step, margin=False)[0])
                                   / (2.0 * tiny) for step in tiny * np.eye(6)])
        beyond = residual != 0.0
        if name.startswith("turn") and np.abs(numbers).max() < 10.0:
            assert np.allclose(derivatives[beyond], numbers[beyond], atol=1e-4)
            looked += 1
        elif not name.startswith("turn"):
            # Newton's method does without what a region's nearest point moves: the direction is the same.
            assert ((derivatives @ -np.linalg.pinv(derivatives) @ residual) @ residual <= 1e-12).all()
            looked += 1
    assert looked > 10


def test_what_is_held_keeps_its_own_axes(desk):
    """A held thing that is turned in the hand is free about its own axis, not about the hand's."""
    tip = desk.scene.frame("tool0")
    turned = rigid(axis_rotation((0.0, 1.0, 0.0), math.pi / 2.0), ORIGIN)
    body = AttachedBody(WorldObject("cup", turned, ((Sphere(0.001), np.eye(4)),)), "tool0", ("tool0", "link_6"), None)
    scene = desk.scene.with_state(desk.scene.state.with_attached({"cup": body}))
    held = (tip @ turned)[:3, :3]
    target = OrientationTarget("cup", held, (0.1, 0.1, math.pi)).resolved(scene)
    for axis, kept in (((0.0, 0.0, 1.0), True), ((1.0, 0.0, 0.0), False), ((0.0, 1.0, 0.0), False)):
        # The cup turned by 0.5 about one of its axes; the hand goes with it.
        hand = held @ axis_rotation(axis, 0.5) @ turned[:3, :3].T

        context = SimpleNamespace(link_pose=lambda link, pose=hand: rigid(pose, ORIGIN), frame=lambda name: np.eye(4))
        assert target.evaluate(context).satisfied == kept


def test_links_that_the_group_does_not_move_are_not_brought_anywhere(mix):
    scene = Scene(mix)
    still = ConstraintSet(orientations=[OrientationTarget("eye", np.eye(3))])
    manifold = Manifold(scene, mix.groups["arm"], still, np.zeros(2))
    inside = manifold.bounds.mean(axis=1)
    assert manifold.keeps(inside) and np.array_equal(manifold.project(inside), inside)


REACHER = """<robot name="reacher"><link name="base"/>%s</robot>""" % "".join(
    """<link name="l%d"/><joint name="j%d" type="revolute"><origin xyz="0 0 0.25"/><parent link="%s"/>
    <child link="l%d"/><axis xyz="%s"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>""" % (
        k, k, "l%d" % (k - 1) if k else "base", k, "1 0 0" if k % 2 else "0 1 0" if k % 4 else "0 0 1")
    for k in range(6))


@pytest.fixture(scope="module")
def reacher():
    """Six joints and nothing to touch."""
    model = PlanningModel.from_xml(REACHER, "<robot name='reacher'><group name='arm'><chain base_link='base' "
                                            "tip_link='l5'/></group></robot>")
    return Scene(model), ExactChecker(model, None)


def region_around(points, kind, size, choose):
    """(shape, pose) of about ``size`` [m] that just contains ``points`` (n, 3); None if it is too small."""
    turn = np.linalg.qr(choose.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shape = {"box": Box((size, 2.0 * size, size)), "sphere": Sphere(size), "cylinder": Cylinder(size, 2.0 * size),
             "cone": Cone(2.0 * size, 4.0 * size), "mesh": TriangleMesh(size * CORNERS, TETRAHEDRON)}[kind]
    middle = points.mean(axis=0)
    away = choose.normal(size=3)
    away /= np.linalg.norm(away)

    def holds(shift):
        pose = inverse(rigid(turn, middle + shift * away))
        return all(regions.holds(shape, pose[:3] @ np.append(point, 1.0)) for point in points)

    low, high = 0.0, 10.0 * size
    if not holds(low):
        return None
    while high - low > 1e-4:  # as far as the region goes
        low, high = (0.5 * (low + high), high) if holds(0.5 * (low + high)) else (low, 0.5 * (low + high))
    return shape, rigid(turn, middle + max(0.0, low - 2e-3) * away)


CORNERS = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])
TETRAHEDRON = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]


def straight(reacher, start, goal, constraints):
    """Whether the constraints are planned as the straight motion, with 2 mrad to spare."""
    scene, exact = reacher
    search = SearchOptions(exact, 1, PATIENCE_S, time.monotonic, constraints=constraints)
    path = plan_path(scene.with_state(scene.state.with_q(start)), "arm", start, [goal], search)
    return path.length <= float(np.linalg.norm(goal - start)) + 2e-3


KINDS, SIZES = ("box", "sphere", "cylinder", "cone", "mesh"), (0.3, 0.6, 1.0, 2.0, 4.0, 20.0)


def motions_in_region(model, kind, size, choose):
    """Endlessly (start, goal, ConstraintSet): the straight motion keeps to a region that goes no further than it."""
    while True:
        start = choose.uniform(-1.5, 1.5, 6)
        goal = start + choose.uniform(-0.6, 0.6, 6)
        points = np.array([model.frame_of(q, "l5")[:3, 3] for q in np.linspace(start, goal, 60)])
        region = region_around(points, kind, size, choose)
        if region is not None:
            yield start, goal, ConstraintSet(positions=[PositionTarget("l5", [region])])


def motions_in_tolerance(model, choose):
    """Endlessly (start, goal, ConstraintSet): the straight motion turns as far as the tolerances go."""
    while True:
        start = choose.uniform(-1.0, 1.0, 6)
        goal = start + choose.uniform(-0.3, 0.3, 6)
        turns = [model.frame_of(q, "l5")[:3, :3] for q in np.linspace(start, goal, 60)]
        wanted = turns[0] @ axis_rotation((1.0, 0.0, 0.0), choose.uniform(-1.2, 1.2))
        free = OrientationTarget("l5", wanted, (math.pi,) * 3)
        angles = np.abs([free.angles(wanted.T @ turn) for turn in turns]).max(axis=0)
        if angles[1] < 1.2 and angles.max() < 2.5:
            yield start, goal, ConstraintSet(orientations=[OrientationTarget("l5", wanted, tuple(angles + 2e-3))])


def assert_straight_within_a_second(reacher, motions):
    straight(reacher, *next(motions))  # compiled code is loaded
    for number, motion in enumerate(itertools.islice(motions, 100)):
        begin = time.process_time()
        assert straight(reacher, *motion), number
        assert time.process_time() - begin < 1.0, number


@pytest.mark.parametrize("kind", KINDS)
def test_a_region_of_any_size_may_be_used_up_to_its_edge(reacher, kind):
    """A hand just above the bottom of a large box: the straight motion keeps to it, so nothing else is planned."""
    choose = np.random.default_rng(5)
    for size in SIZES:
        for start, goal, constraints in itertools.islice(motions_in_region(reacher[0].model, kind, size, choose), 5):
            assert straight(reacher, start, goal, constraints), size


def test_a_wide_tolerance_may_be_used_up_to_its_edge(reacher):
    for start, goal, constraints in itertools.islice(
            motions_in_tolerance(reacher[0].model, np.random.default_rng(6)), 20):
        assert straight(reacher, start, goal, constraints)


@pytest.mark.long
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_regions_of_each_shape_and_size(reacher, kind, size):
    assert_straight_within_a_second(
        reacher, motions_in_region(reacher[0].model, kind, size, np.random.default_rng(8)))


@pytest.mark.long
def test_a_hundred_tolerances(reacher):
    assert_straight_within_a_second(reacher, motions_in_tolerance(reacher[0].model, np.random.default_rng(9)))


def test_a_goal_for_two_links_of_one_arm_is_sampled(reacher):
    """The hand's position and a region for the elbow: so one chooses among the postures that put the hand there."""
    scene, exact = reacher
    choose = np.random.default_rng(7)
    for number in range(10):
        q = choose.uniform(-1.0, 1.0, 6)
        hand, elbow = (scene.model.frame_of(q, link) for link in ("l5", "l2"))
        goal = ConstraintSet(
            positions=[PositionTarget("l2", [(Sphere(0.05), rigid(np.eye(3), elbow[:3, 3]))]),
                       PositionTarget("l5", [(Sphere(0.005), rigid(np.eye(3), hand[:3, 3]))])],
            orientations=[OrientationTarget("l5", hand[:3, :3], (0.2, 0.2, math.pi))])
        found = next(iter(sampler(scene.model, "arm", goal, scene, exact, number)), None)
        assert found is not None, number
        assert goal.broken(scene.model, scene.state.with_q(found), scene) is None
        if number > 1:
            continue  # that there is none takes all tries
        far = goal.merged(ConstraintSet(positions=[
            PositionTarget("l2", [(Sphere(0.05), rigid(np.eye(3), elbow[:3, 3] + 1.0))])]))
        samples = sampler(scene.model, "arm", far, scene, exact, number)
        assert next(samples, None) is None and samples.reason
