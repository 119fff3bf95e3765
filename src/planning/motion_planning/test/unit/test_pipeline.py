# SPDX-License-Identifier: BSD-3-Clause
"""Requests to timed trajectories; each way to fail has its code and its sentence."""
import time
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from motion_planning.constraints import ConstraintSet, JointTarget
from motion_planning.exact import ExactChecker
from motion_planning.pipeline import Code, PlanningFailure, PlanQuery, Tools, plan
from motion_planning.planners import NoPath, plan_path, warm_up
from motion_planning.scene import Scene, TriangleMesh, WorldObject
from urdf_model import Box
from urdf_model.transforms import rigid

BENT = (0.0, 0.3, 0.4, 0.0, 0.6, 0.0)
ASIDE = (1.2, 0.3, 0.4, 0.0, 0.6, 0.5)
# Joints 2 to 6, the tool far out.
FORWARD = (-0.6, 0.4, 0.0, 0.4, 0.0)
GROUP = "manipulator"


@dataclass
class Goal:
    """A constraint set that one posture meets, or none."""

    q: np.ndarray | None
    tolerance: float = 1e-3

    def merged(self, other):
        return other

    def evaluate(self, model, state, scene, exact=None):
        off = np.inf if self.q is None else float(np.abs(state.q - self.q).max())
        return [(off <= self.tolerance, off, "the arm is off by %.3f" % off)]


def upright(least):
    """A path constraint: joint_2 stays above a bound."""
    return ConstraintSet(joints=[JointTarget("joint_2", least, above=10.0, below=0.0)])


@dataclass
class Samples:
    """Goal postures as constraints.sampler gives them."""

    scene: Scene
    goal: Goal
    exact: ExactChecker | None
    reason: str | None = None

    def __iter__(self):
        if self.goal.q is None:
            self.reason = "out of reach: the arm is too short"
        elif self.exact is None or self.exact.free(self.scene, self.scene.state.with_q(self.goal.q), GROUP):
            yield self.goal.q


def sampler(model, group, goal, scene, exact, seed, stop=None):
    return Samples(scene, goal, exact)


@dataclass
class Lab:
    """A robot in a scene, and its checker."""

    scene: Scene
    exact: ExactChecker
    plan_path: object = plan_path
    stop: object = field(default=lambda: False)

    def query(self, *goals, **options):
        return PlanQuery(self.scene, options.pop("group", GROUP), [Goal(np.array(q)) for q in goals], **options)

    def plan(self, *goals, **options):
        return self.run(self.query(*goals, **options))

    def run(self, query):
        return plan(query, self.tools())

    def tools(self):
        return Tools(self.exact, self.plan_path, sampler, time.monotonic, 1, self.stop)

    def refused(self, *goals, **options):
        with pytest.raises(PlanningFailure) as failure:
            self.plan(*goals, **options)
        return failure.value

    def with_box(self, name, position, size):
        pose = rigid(np.eye(3), position)
        return replace(self, scene=self.scene.with_object(WorldObject(name, pose, ((Box(size), np.eye(4)),))))

    def tip(self, q):
        return self.scene.model.frame_of(np.array(q), "tool0")[:3, 3]


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """The time that a plan may take is none for the compiler."""
    warm_up()


@pytest.fixture(scope="module")
def checker(probot, meshes):
    return ExactChecker(probot, meshes)


@pytest.fixture
def lab(probot, checker):
    return Lab(Scene(probot, probot.state(np.array(BENT))), checker)


def assert_valid(lab, found, resolution=0.01):
    """The trajectory for a controller goes from the start to rest, within the limits, and touches nothing."""
    model, timed = lab.scene.model, found.timed
    q, v, a = timed.sampled(np.linspace(0.0, timed.duration, max(500, int(timed.duration / 0.002))))
    assert (np.abs(v) <= model.velocity * 1.001).all() and (np.abs(a) <= model.acceleration * 1.001).all()
    assert (q >= model.bounds[:, 0] - 1e-6).all() and (q <= model.bounds[:, 1] + 1e-6).all()
    assert np.allclose(v[[0, -1]], 0.0, atol=1e-6)
    last = q[0] + 1.0
    for state in q:
        if np.abs(state - last).max() > resolution:
            assert lab.exact.free(lab.scene, lab.scene.state.with_q(state)), state
            last = state


def test_a_free_way_is_planned(lab):
    found = lab.plan(ASIDE)
    assert np.allclose(found.timed.positions[0], BENT) and np.allclose(found.timed.positions[-1], ASIDE)
    assert found.planning_time > 0.0 and found.start is lab.scene.state
    assert_valid(lab, found)


@pytest.mark.parametrize("timing", ["time_optimal_trajectory_generation", "iterative_time_parameterization", "ruckig"])
def test_ways_around_a_wall_are_valid_as_played(lab, timing):
    left, right = (-0.9, *FORWARD), (0.9, *FORWARD)
    x, y, z = lab.tip((0.0, *FORWARD))
    lab = lab.with_box("wall", (x, y, z), (0.1, 0.04, 0.2))
    lab.scene = lab.scene.with_state(lab.scene.state.with_q(np.array(left)))
    found = lab.plan(right, timing=timing)
    assert len(found.path) > 2
    assert_valid(lab, found)


def test_scaling_slows(lab):
    whole, tenth = lab.plan(ASIDE), lab.plan(ASIDE, velocity_scaling=0.1, acceleration_scaling=0.1)
    assert tenth.timed.duration > 3.0 * whole.timed.duration


def test_a_goal_that_is_met_is_one_point(lab):
    found = lab.plan(BENT)
    assert len(found.timed.times) == 1 and np.allclose(found.timed.positions[0], BENT)


def test_one_goal_of_several_is_enough(lab):
    query = replace(lab.query(ASIDE), goals=[Goal(None), Goal(np.array(ASIDE))])
    assert np.allclose(lab.run(query).timed.positions[-1], ASIDE)


def test_unknown_groups(lab):
    failure = lab.refused(ASIDE, group="legs")
    assert failure.code == Code.INVALID_GROUP_NAME and "'legs'" in str(failure) and "manipulator" in str(failure)


def test_requests_without_goals_or_time(lab):
    assert lab.refused().code == Code.INVALID_GOAL_CONSTRAINTS
    for allowed in (0.0, float("nan"), -1.0):
        assert lab.refused(ASIDE, allowed_time=allowed).code == Code.FAILURE


def test_a_start_in_collision_names_the_pair(lab):
    lab = lab.with_box("crate", lab.tip(BENT), (0.3, 0.3, 0.3))
    failure = lab.refused(ASIDE)
    assert failure.code == Code.START_STATE_IN_COLLISION
    assert "'crate'" in str(failure) and "link_6" in str(failure)
    assert "crate" in [contact.b for contact in failure.contacts]


def test_a_start_that_just_touches_is_led_out(lab):
    """A small box comes towards the tip, along the tool's axis, until they touch."""
    pose = lab.scene.model.frame_of(np.array(BENT), "tool0")
    for ahead in np.arange(0.1, 0.0, -0.001):
        touching = lab.with_box("cube", pose[:3, 3] + ahead * pose[:3, 2], (0.02, 0.02, 0.02))
        if touching.exact.contacts(touching.scene):
            break
    found = touching.plan(ASIDE, jiggle=0.05)
    assert np.allclose(found.timed.positions[0], BENT) and np.allclose(found.timed.positions[-1], ASIDE)
    last = touching.scene.state.with_q(found.timed.positions[-1])
    assert touching.exact.free(touching.scene, last)


def test_a_start_out_of_bounds_names_the_joint(lab, probot):
    beyond = np.array(BENT)
    beyond[1] = probot.bounds[1, 1] + 0.3
    lab.scene = lab.scene.with_state(lab.scene.state.with_q(beyond))
    failure = lab.refused(ASIDE)
    assert failure.code == Code.START_STATE_INVALID and "joint_2" in str(failure)
    assert failure.joints == {"joint_2": pytest.approx(beyond[1])}


def test_a_start_a_little_out_of_bounds_comes_back(lab, probot):
    beyond = np.array(BENT)
    beyond[4] = probot.bounds[4, 0] - 0.02
    lab.scene = lab.scene.with_state(lab.scene.state.with_q(beyond))
    found = lab.plan(ASIDE)
    assert found.timed.positions[0, 4] == pytest.approx(beyond[4])
    assert (found.timed.positions[5:, 4] > probot.bounds[4, 0] - 0.02).all()
    assert found.path[1, 4] == pytest.approx(probot.bounds[4, 0])


def test_a_goal_in_collision_names_the_pair(lab):
    lab = lab.with_box("crate", lab.tip(ASIDE), (0.06, 0.06, 0.06))
    failure = lab.refused(ASIDE)
    assert failure.code == Code.GOAL_IN_COLLISION and "'crate'" in str(failure)
    assert failure.contacts


def test_a_goal_out_of_reach_has_its_reason(lab):
    with pytest.raises(PlanningFailure) as refused:
        lab.run(replace(lab.query(), goals=[Goal(None)]))
    failure = refused.value
    assert failure.code == Code.NO_IK_SOLUTION and "the arm is too short" in str(failure)


def test_path_constraints_at_both_ends(lab):
    failure = lab.refused(ASIDE, path_constraints=upright(0.5))
    assert failure.code == Code.START_STATE_VIOLATES_PATH_CONSTRAINTS and "joint 'joint_2' is at 0.3000" in str(failure)
    low = (1.2, -0.3, 0.4, 0.0, 0.6, 0.5)
    failure = lab.refused(low, path_constraints=upright(0.0))
    assert failure.code == Code.GOAL_VIOLATES_PATH_CONSTRAINTS and "joint 'joint_2' is at -0.3000" in str(failure)


def test_a_goal_that_breaks_the_path_constraints_leaves_the_others(lab):
    low = (1.2, -0.3, 0.4, 0.0, 0.6, 0.5)
    found = lab.plan(low, ASIDE, path_constraints=upright(0.0))
    assert np.allclose(found.timed.positions[-1], ASIDE)


def test_path_constraints_hold_on_the_way(lab):
    """A planner that does not know of them may not pass one that breaks them."""
    lab.plan_path = lambda scene, group, start, goals, search: np.array([start, np.array(BENT) - 0.5, goals[0]])
    failure = lab.refused(ASIDE, path_constraints=upright(0.2))
    assert failure.code in (Code.INVALID_MOTION_PLAN, Code.PLANNING_FAILED) and "joint_2" in str(failure)


def test_a_path_through_something_is_not_passed_on(lab):
    middle = 0.5 * (np.array(BENT) + np.array(ASIDE))
    lab = lab.with_box("post", lab.tip(middle), (0.05, 0.05, 0.05))
    lab.plan_path = lambda scene, group, start, goals, search: np.array([start, goals[0]])
    failure = lab.refused(ASIDE)
    assert failure.code == Code.INVALID_MOTION_PLAN and "'post'" in str(failure)


def test_planners_reasons_come_through(lab):
    def none(scene, group, start, goals, search):
        raise NoPath("the two trees did not meet")

    lab.plan_path = none
    failure = lab.refused(ASIDE)
    assert failure.code == Code.PLANNING_FAILED and "did not meet" in str(failure)


def test_stop_ends_planning(lab):
    lab.stop = lambda: True
    assert lab.refused(ASIDE).code == Code.PREEMPTED


def test_the_shortest_of_several_attempts_counts(lab):
    lengths = iter([3.0, 1.0, 2.0])

    def by_way(scene, group, start, goals, search):
        aside = np.array(start)
        aside[0] -= next(lengths) * 0.1
        return np.array([start, aside, goals[0]])

    lab.plan_path = by_way
    assert lab.plan(ASIDE, attempts=3).path[1, 0] == pytest.approx(-0.1)


def with_objects(lab, count):
    shapes = [Box((0.1 + 1e-6 * k, 0.1, 0.1)) for k in range(count)]
    return replace(lab, scene=lab.scene.with_objects([
        WorldObject("far_%d" % k, rigid(np.eye(3), (5.0 + k, 0.0, 0.0)), ((shape, np.eye(4)),))
        for k, shape in enumerate(shapes)]))


def test_preparing_a_scene_counts_against_the_time_and_what_is_made_is_kept(lab):
    """By a clock that goes on at each look."""
    many = with_objects(lab, 400)
    ticks = iter(range(10**9))
    tools = replace(many.tools(), clock=lambda: 4.0 * next(ticks))
    with pytest.raises(PlanningFailure, match="400 objects") as caught:
        plan(many.query(ASIDE, allowed_time=5.0), tools)
    assert caught.value.code == Code.TIMED_OUT
    # Most of the time is left for the search of another request.
    ticks = iter(range(10**9))
    found = plan(many.query(ASIDE, allowed_time=5.0), replace(many.tools(), clock=lambda: 1e-6 * next(ticks)))
    assert np.allclose(found.path[-1], ASIDE)


def test_preparing_a_scene_ends_when_the_request_is_cancelled(lab):
    many, looks = with_objects(lab, 400), iter([False] * 3)
    with pytest.raises(PlanningFailure) as caught:
        plan(many.query(ASIDE), replace(many.tools(), stop=lambda: next(looks, True)))
    assert caught.value.code == Code.PREEMPTED


def test_what_was_planned_around_more_coarsely_is_told(lab):
    rng = np.random.default_rng(1)
    soup = TriangleMesh(rng.random((300, 3)), rng.integers(300, size=(2000, 3)))
    messy = replace(lab, scene=lab.scene.with_object(WorldObject("soup", rigid(np.eye(3), (3.0, 0.0, 0.0)),
                                                                 ((soup, np.eye(4)),))))
    found = plan(messy.query(ASIDE, allowed_time=60.0), messy.tools())
    assert len(found.remarks) == 1 and "'soup'" in found.remarks[0]
    assert plan(lab.query(ASIDE), lab.tools()).remarks == ()
