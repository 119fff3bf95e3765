# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles in the way of joints that move: another way without a stop, or the reason why they have to stop."""
import itertools
from dataclasses import replace

import numpy as np
import pytest

from motion_planning.constraints import ConstraintSet, JointTarget, sampler
from motion_planning.exact import ExactChecker
from motion_planning.pipeline import Code, PlanningFailure, PlanQuery, Tools
from motion_planning.planners import plan_path
from motion_planning.replanning import Running, last_stop, redirected, stopped
from motion_planning.scene import Scene, WorldObject
from motion_planning.timing import time_path
from urdf_model import Box
from urdf_model.transforms import rigid

GROUP = "manipulator"
FROM, TO = np.array([-1.2, 0.3, 0.4, 0.0, 0.6, 0.0]), np.array([1.2, 0.3, 0.4, 0.0, 0.6, 0.0])
NOW_S = 1.2


class Lab:
    """The arm on its way from FROM to TO; things appear where its tool will be."""

    def __init__(self, model, exact, tick_s=1e-5):
        self.model, self.exact = model, exact
        ticks = itertools.count()
        self.clock = lambda: tick_s * next(ticks)
        self.tools = Tools(exact, plan_path, sampler, self.clock)
        self.group = model.groups[GROUP]
        self.timed = time_path([FROM, TO], np.full(6, 0.8), np.full(6, 1.0), "ruckig")
        self.scene = Scene(model)
        self.scene = self.scene.with_state(self.scene.state.with_q(self.at(NOW_S), self.group.indices))

    def at(self, moment):
        return self.timed.sampled([moment])[0][0]

    def place_ahead(self, seconds, size=0.05, name="thing"):
        tip = self.model.frame_of(self.scene.state.with_q(self.at(NOW_S + seconds), self.group.indices).q, "tool0")
        box = WorldObject(name, rigid(np.eye(3), tip[:3, 3]), ((Box((size, size, size)), np.eye(4)),))
        self.scene = self.scene.with_object(box)
        times = self.timed.spaced(0.02)
        times = times[times >= NOW_S]
        first = self.exact.first_blocked(self.scene, self.timed.sampled(times)[0], GROUP)
        self.running = Running(self.timed, lambda: NOW_S + self.clock(), float(times[first]))
        return self

    def redirected(self, **changes):
        goal = ConstraintSet(joints=[JointTarget(name, value, 1e-3, 1e-3)
                                     for name, value in zip(self.group.joints, TO.tolist(), strict=True)])
        return redirected(PlanQuery(self.scene, GROUP, [goal], **changes), self.tools, self.running)


@pytest.fixture(scope="module")
def exact(probot, meshes):
    return ExactChecker(probot, meshes)


def test_another_way_continues_the_motion_and_touches_nothing(probot, exact):
    lab = Lab(probot, exact).place_ahead(1.4)
    found = lab.redirected()
    assert NOW_S < found.begin < lab.running.blocked_from
    for new, old in zip(found.timed.sampled([0.0]), lab.timed.sampled([found.begin]), strict=True):
        np.testing.assert_allclose(new, old, atol=1e-6)
    np.testing.assert_allclose(found.timed.positions[-1], TO, atol=2e-3)
    states, velocities, _ = found.timed.sampled(found.timed.spaced(0.004))
    assert exact.first_blocked(lab.scene, states, GROUP) is None
    # Without a stop: some joint moves until shortly before the end.
    assert found.overlap > 0.0
    moving = found.timed.sampled(np.linspace(0.0, found.timed.duration - 0.4, 100))[1]
    assert np.abs(moving).max(axis=1).min() > 0.02
    speeds, accelerations = found.timed.peaks()
    assert (speeds <= probot.velocity[lab.group.indices] * 1.001).all()
    assert (accelerations <= probot.acceleration[lab.group.indices] * 1.001).all()


def test_path_constraints_hold_on_the_other_way(probot, exact):
    lab = Lab(probot, exact).place_ahead(1.4)
    low = ConstraintSet(joints=[JointTarget("joint_2", 0.3, above=2.0, below=0.02)])
    found = lab.redirected(path_constraints=low)
    assert found.timed.sampled(found.timed.spaced(0.01))[0][:, 1].min() > 0.3 - 0.02 - 1e-6


def test_what_is_too_near_is_a_reason_to_stop(probot, exact):
    with pytest.raises(PlanningFailure, match="come to rest in time"):
        Lab(probot, exact).place_ahead(0.3, size=0.02).redirected()


def test_a_goal_that_is_blocked_too_is_a_reason_to_stop(probot, exact):
    lab = Lab(probot, exact)
    lab = lab.place_ahead(lab.timed.duration - NOW_S, name="at the goal").place_ahead(1.4)
    with pytest.raises(PlanningFailure) as failure:
        lab.redirected()
    assert failure.value.code == Code.GOAL_IN_COLLISION


def test_a_way_that_is_found_too_late_is_not_taken(probot, exact):
    with pytest.raises(PlanningFailure) as failure:
        Lab(probot, exact, tick_s=0.1).place_ahead(1.4).redirected()
    assert failure.value.code in (Code.TIMED_OUT, Code.PREEMPTED)


def test_what_is_far_is_worth_a_longer_search_on_a_slow_machine(probot, exact):
    lab = Lab(probot, exact, tick_s=0.0015).place_ahead(1.8)
    found = lab.redirected()
    assert found.begin > NOW_S + 0.3 and found.begin < lab.running.blocked_from
    states = found.timed.sampled(found.timed.spaced(0.004))[0]
    assert exact.first_blocked(lab.scene, states, GROUP) is None
    # Too late for what is near.
    with pytest.raises(PlanningFailure) as failure:
        Lab(probot, exact, tick_s=0.0015).place_ahead(0.8, size=0.02).redirected()
    assert failure.value.code in (Code.TIMED_OUT, Code.PREEMPTED)


def test_who_stops_the_planning_stops_every_search(probot, exact):
    lab = Lab(probot, exact).place_ahead(1.8)
    asked = []
    lab.tools = replace(lab.tools, stop=lambda: asked.append(True) or True)
    with pytest.raises(PlanningFailure) as failure:
        lab.redirected()
    assert failure.value.code == Code.PREEMPTED and len(asked) < 10


def test_joints_stop_as_gently_as_the_room_allows(probot, exact):
    multiples = []
    for seconds, size in ((1.6, 0.05), (0.6, 0.02), (0.3, 0.02)):
        lab = Lab(probot, exact).place_ahead(seconds, size)
        found = stopped(exact, lab.scene, lab.group, lab.running)
        if found is None:
            break
        multiples.append(found.harder)
        assert NOW_S < found.begin < lab.running.blocked_from
        for new, old in zip(found.timed.sampled([0.0]), lab.timed.sampled([found.begin]), strict=True):
            np.testing.assert_allclose(new, old, atol=1e-6)
        states, velocities, _ = found.timed.sampled(found.timed.spaced(0.004))
        assert exact.first_blocked(lab.scene, states, GROUP) is None and np.abs(velocities[-1]).max() < 1e-9
        accelerations = found.timed.peaks()[1]
        assert (accelerations <= found.harder * probot.acceleration[lab.group.indices] * 1.02).all()
    assert multiples[0] == 1.0 and len(multiples) >= 2 and multiples[1] > 1.0


def test_until_the_last_stop_there_is_room_to_rest(probot, exact):
    lab = Lab(probot, exact).place_ahead(1.6)
    until = last_stop(exact, lab.scene, lab.group, lab.running)
    assert NOW_S + 0.1 < until < lab.running.blocked_from
    then = lab.running._replace(now=lambda: until)
    assert stopped(exact, lab.scene, lab.group, then).harder == 1.0
    # What is near leaves no time for a search.
    lab = Lab(probot, exact).place_ahead(0.3, size=0.02)
    now = lab.running._replace(now=lambda: NOW_S)
    assert last_stop(exact, lab.scene, lab.group, now) == NOW_S


def test_joints_before_which_something_stands_already_are_stopped_by_whatever_can(probot, exact):
    lab = Lab(probot, exact).place_ahead(0.02, size=0.05)
    assert stopped(exact, lab.scene, lab.group, lab.running) is None
