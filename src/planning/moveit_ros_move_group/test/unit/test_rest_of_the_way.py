# SPDX-License-Identifier: BSD-3-Clause
"""Objects in the way of a running trajectory are seen, however thin they are and wherever they stand."""
import numpy as np
import pytest
import rospy

from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.replanning import Redirection
from motion_planning.scene import WorldObject
from motion_planning.timing import time_path
from moveit_ros_move_group.rest_of_the_way import NewWay, RestOfTheWay
from urdf_model import Box
from urdf_model.transforms import rigid


class Clock:
    now = 100.0

    def get_time(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(rospy, "get_time", clock.get_time)
    return clock


@pytest.fixture
def timed(model):
    """The arm's turn goes to and fro a hundred times, and the box on it with it."""
    ends = np.array([[(-1.0) ** k, 0.2] for k in range(101)])
    return time_path(ends, np.ones(2), 10.0 * np.ones(2), tolerance=0.001)


def look(model, scene, timed, scenes, *more):
    return RestOfTheWay(ExactChecker(model, None), model.groups["arm"], timed, iter(scenes).__next__, *more)


def why(found):
    """The sentence why the joints stop, gently or at once."""
    return found.stops if isinstance(found, NewWay) else found


def with_needle(scene, angle):
    """A tiny thing beside the arm, which is a box of 0.1 m: one of its edges is there at ``angle`` - 45 degrees."""
    place = rigid(np.eye(3), (0.06 * np.cos(angle), 0.06 * np.sin(angle), 0.5))
    return scene.with_object(WorldObject("needle", place, ((Box((0.001, 0.001, 0.001)), np.eye(4)),)))


def test_what_is_anywhere_in_the_way_is_named(model, scene, timed, clock):
    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, timed, [None, blocked])
    assert watch.hit() is None and not watch.contacts
    sentence = why(watch.hit())
    assert "'needle'" in sentence and watch.contacts[0].b == "needle"


def test_what_is_left_behind_does_not_matter(model, scene, clock):
    timed = time_path(np.array([[0.9, 0.2], [-0.8, 0.2]]), np.ones(2), np.ones(2))
    blocked = with_needle(scene, np.pi / 4)  # touched where the arm is near 0
    watch = look(model, scene, timed, [blocked, blocked])
    assert watch.hit() is not None
    clock.now += timed.duration
    assert watch.hit() is None


def test_time_that_goes_back_restarts(model, scene, clock):
    timed = time_path(np.array([[0.9, 0.2], [-0.8, 0.2]]), np.ones(2), np.ones(2))
    watch = look(model, scene, timed, [None, with_needle(scene, np.pi / 4)])
    watch.hit()
    clock.now = 0.0
    assert watch.hit() is not None


def test_another_way_takes_the_place_at_a_time_ahead(model, scene, clock):
    timed, other = (time_path(np.array(ends), np.ones(2), np.ones(2)) for ends in (
        [[0.9, 0.2], [-0.8, 0.2]], [[0.5, 0.2], [0.7, 0.2]]))
    asked = []

    def onward(_, running):
        asked.append((running.now(), running.blocked_from))
        begin = running.now() + 0.1
        clock.now += 0.04  # what it takes
        return Redirection(other, begin, None, 0.0)

    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, timed, [None, blocked, blocked], onward, lambda: clock.now - 0.3)
    watch.hit()
    new = watch.hit()
    assert not new.stops
    # The controller's word counts: it began 0.3 s before.
    (asked_at, blocked_from), = asked
    assert asked_at == pytest.approx(0.3) and 0.3 < blocked_from < timed.duration
    assert new.begins == pytest.approx(clock.now + 0.06)
    message = new.trajectory.joint_trajectory
    assert message.header.stamp.to_sec() == pytest.approx(new.begins)
    # A controller leads to the first point from where it is.
    assert [point.time_from_start.to_sec() for point in message.points] == pytest.approx(other.times[1:].tolist())
    # From then on the new way is looked at.
    assert watch.hit() is None


@pytest.mark.parametrize("ahead_s, sentence", [(0.0, "no other way while the joints move: a wall"), (0.1, "too late")])
def test_without_another_way_in_time_the_sentence_says_why(model, scene, timed, clock, ahead_s, sentence):
    def onward(_, running):
        if not ahead_s:
            raise PlanningError("a wall")
        begin = running.now() + ahead_s
        clock.now += 2.0 * ahead_s
        return Redirection(timed, begin, None, 0.0)

    watch = look(model, scene, timed, [with_needle(scene, np.pi / 4)], onward)
    assert sentence in why(watch.hit()) and watch.contacts[0].b == "needle"


@pytest.fixture
def turning(model):
    """From 0.9 to -0.8 rad; the needle of the tests is touched near 0."""
    return time_path(np.array([[0.9, 0.2], [-0.8, 0.2]]), np.ones(2), np.ones(2))


def test_joints_with_room_come_to_rest_before_it_within_their_limits(model, scene, turning, clock):
    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, turning, [None, blocked, blocked])
    watch.hit()
    clock.now += 0.5
    rest = watch.hit()
    assert "in the way of what is left: " in rest.stops and "'needle'" in rest.stops
    assert rest.begins == pytest.approx(clock.now + 0.05)
    message = rest.trajectory.joint_trajectory
    assert message.header.stamp.to_sec() == pytest.approx(rest.begins)
    last = message.points[-1]
    assert last.velocities == pytest.approx([0.0, 0.0]) and last.accelerations == pytest.approx([0.0, 0.0])
    assert np.abs([point.accelerations for point in message.points]).max() <= 1.02 * model.acceleration.max()
    state = scene.state.with_q(np.array(last.positions), model.groups["arm"].indices)
    assert ExactChecker(model, None).free(blocked, state, "arm")
    # The braking touches nothing, so that it goes on.
    assert watch.hit() is None


def test_joints_that_stop_go_nowhere_else(model, scene, turning, clock):
    def onward(_, running):
        asked.append(running)
        raise PlanningError("a wall")

    asked, first = [], with_needle(scene, np.pi / 4)
    watch = look(model, scene, turning, [None, first, with_needle(first, np.pi / 4 + 0.05)], onward)
    watch.hit()
    clock.now += 0.5
    assert why(watch.hit()) and why(watch.hit()) is None and len(asked) == 1


def test_what_is_too_near_for_any_braking_is_a_reason_to_stop_at_once(model, scene, turning, clock):
    watch = look(model, scene, turning, [None, with_needle(scene, 0.65 + np.pi / 4)])
    watch.hit()
    clock.now += 0.7
    assert "'needle'" in watch.hit()
