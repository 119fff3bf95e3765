# SPDX-License-Identifier: BSD-3-Clause
"""Objects in the way of a running trajectory are seen, however thin they are and wherever they stand."""
import threading

import numpy as np
import pytest
import rospy

from lab_testing.waiting import wait_until
from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.replanning import Redirection
from motion_planning.scene import WorldObject
from motion_planning.timing import time_path
from moveit_ros_move_group.rest_of_the_way import NewWay, Onward, RestOfTheWay
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
    """scenes: taken from the front, one at each look; None where there is no change."""
    return RestOfTheWay(ExactChecker(model, None), model.groups["arm"], timed,
                        lambda: scenes.pop(0) if scenes else None, *more)


def outcome(watch):
    """The end of a search: another way, or a stop."""
    return wait_until(watch.hit, "another way or a stop", 10.0, 0.001)


def why(found):
    """The sentence why the joints stop, gently or at once."""
    return found.stops if isinstance(found, NewWay) else found


def with_needle(scene, angle, name="needle"):
    """A tiny thing beside the arm, which is a box of 0.1 m: one of its edges is there at ``angle`` - 45 degrees."""
    place = rigid(np.eye(3), (0.06 * np.cos(angle), 0.06 * np.sin(angle), 0.5))
    return scene.with_object(WorldObject(name, place, ((Box((0.001, 0.001, 0.001)), np.eye(4)),)))


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
    asked, followed = [], []

    def search(_, running, stop):
        asked.append((running.now(), running.blocked_from))
        begin = running.now() + 0.1
        clock.now += 0.04  # what it takes
        return Redirection(other, begin, None, 0.0)

    blocked = with_needle(scene, np.pi / 4)
    scenes = [None, blocked]
    watch = look(model, scene, timed, scenes, Onward(search, follows=lambda found, _: followed.append(found.timed)),
                 lambda: 100.04 - 0.3)
    watch.hit()
    clock.now += 0.04
    new = outcome(watch)
    assert not new.stops and followed == [other] and not watch.searching
    # The controller's word counts: it began 0.3 s before.
    (asked_at, blocked_from), = asked
    assert asked_at == pytest.approx(0.3) and 0.3 < blocked_from < timed.duration
    assert new.begins == pytest.approx(clock.now + 0.06)
    message = new.trajectory.joint_trajectory
    assert message.header.stamp.to_sec() == pytest.approx(new.begins)
    # A controller leads to the first point from where it is.
    assert [point.time_from_start.to_sec() for point in message.points] == pytest.approx(other.times[1:].tolist())
    # From then on the new way is looked at.
    scenes.append(blocked)
    assert watch.hit() is None and not scenes


def raising(error):
    def search(*_):
        raise error
    return search


def late(clock, timed):
    def search(_, running, stop):
        begin = running.now() + 0.1
        clock.now += 0.2
        return Redirection(timed, begin, None, 0.0)
    return search


@pytest.mark.parametrize("error, sentence", [
    (PlanningError("a wall"), "no other way while the joints move: a wall"),
    (ZeroDivisionError("0"), "the search failed: ZeroDivisionError: 0"),
    (None, "another way was found 0.100 s too late")])
def test_without_another_way_in_time_the_sentence_says_why(model, scene, timed, clock, error, sentence):
    search = raising(error) if error else late(clock, timed)
    watch = look(model, scene, timed, [with_needle(scene, np.pi / 4)], Onward(search))
    assert sentence in why(outcome(watch)) and watch.contacts[0].b == "needle"


class Endless:
    """A search that only ends when the test lets it, whether or not it is given up."""

    def __init__(self, found=None):
        self.found, self.may_end, self.asked, self.stops = found, threading.Event(), [], []

    def __call__(self, scene, running, stop):
        self.asked.append(scene)
        self.stops.append(stop)
        assert self.may_end.wait(10.0)
        if self.found is None:
            raise PlanningError("a wall")
        return Redirection(self.found, running.now() + 0.1, None, 0.0)


@pytest.fixture
def endless():
    search = Endless()
    yield search
    search.may_end.set()


def test_a_search_that_does_not_end_does_not_hold_up_the_stop(model, scene, turning, clock, endless):
    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, turning, [None, blocked], Onward(endless))
    watch.hit()
    clock.now += 0.4
    assert watch.hit() is None and watch.searching and not endless.stops[0]()
    clock.now += 0.4
    rest = watch.hit()
    assert "no other way was found before the joints have to stop" in rest.stops
    assert endless.stops[0]() and not watch.searching
    state = scene.state.with_q(np.array(rest.trajectory.joint_trajectory.points[-1].positions),
                               model.groups["arm"].indices)
    assert ExactChecker(model, None).free(blocked, state, "arm")


def test_a_search_is_given_up_with_its_motion(model, scene, turning, clock, endless):
    watch = look(model, scene, turning, [None, with_needle(scene, np.pi / 4)], Onward(endless))
    watch.hit()
    assert watch.hit() is None and not endless.stops[0]()
    watch.end_search()
    assert endless.stops[0]() and not watch.searching


def test_what_changes_during_a_search_is_seen(model, scene, turning, clock, endless):
    far = with_needle(scene, np.pi / 4)
    near = with_needle(scene, 0.4 + np.pi / 4)
    scenes = [None, far]
    watch = look(model, scene, turning, scenes, Onward(endless))
    watch.hit()
    assert watch.hit() is None
    scenes.append(near)  # what was searched for ends too late for this
    assert watch.hit() is None and watch.searching
    assert endless.asked == [far, near] and [stop() for stop in endless.stops] == [True, False]
    scenes.append(scene)  # everything is gone
    assert watch.hit() is None and not watch.searching and endless.stops[1]()


def test_another_way_that_is_blocked_meanwhile_is_not_followed(model, scene, turning, clock, endless):
    endless.found = time_path(np.array([[0.6, 0.2], [1.5, 0.2]]), np.ones(2), np.ones(2))
    far = with_needle(scene, np.pi / 4)
    scenes = [None, far]
    watch = look(model, scene, turning, scenes, Onward(endless))
    watch.hit()
    clock.now += 0.2
    assert watch.hit() is None
    both = with_needle(far, 1.4 + np.pi / 4, "second")
    scenes.append(both)
    assert watch.hit() is None and endless.asked == [far]  # no nearer than what is there already
    endless.may_end.set()
    wait_until(lambda: watch.hit() or len(endless.asked) == 2, "a second search", 10.0, 0.001)
    assert endless.asked[1] is both


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
    def search(_, running, stop):
        asked.append(running)
        raise PlanningError("a wall")

    asked, first = [], with_needle(scene, np.pi / 4)
    scenes = [None, first]
    watch = look(model, scene, turning, scenes, Onward(search))
    watch.hit()
    clock.now += 0.5
    assert why(outcome(watch))
    scenes.append(with_needle(first, np.pi / 4 + 0.05))
    assert why(watch.hit()) is None and not scenes and len(asked) == 1


def test_what_is_too_near_for_any_braking_is_a_reason_to_stop_at_once(model, scene, turning, clock):
    watch = look(model, scene, turning, [None, with_needle(scene, 0.65 + np.pi / 4)])
    watch.hit()
    clock.now += 0.7
    assert "'needle'" in watch.hit()
