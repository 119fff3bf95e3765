# SPDX-License-Identifier: BSD-3-Clause
"""What comes to stand in the way of a running trajectory is seen, however thin it is and wherever it stands."""
import numpy as np
import pytest
import rospy

from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.replanning import Redirection
from motion_planning.scene import WorldObject
from motion_planning.timing import time_path
from moveit_ros_move_group.rest_of_the_way import RestOfTheWay
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


def with_needle(scene, angle):
    """A tiny thing beside the arm, which is a box of 0.1 m: one of its edges is there at ``angle`` - 45 degrees."""
    place = rigid(np.eye(3), (0.06 * np.cos(angle), 0.06 * np.sin(angle), 0.5))
    return scene.with_object(WorldObject("needle", place, ((Box((0.001, 0.001, 0.001)), np.eye(4)),)))


def test_what_is_anywhere_in_the_way_is_named(model, scene, timed, clock):
    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, timed, [None, blocked])
    assert watch.hit() is None and not watch.contacts
    sentence = watch.hit()
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
        asked.append(running)
        clock.now += 0.04  # what it takes
        return Redirection(other, running.now + 0.1, None, 0.0)

    blocked = with_needle(scene, np.pi / 4)
    watch = look(model, scene, timed, [None, blocked, blocked], onward, lambda: clock.now - 0.3)
    watch.hit()
    new = watch.hit()
    # The controller's word counts: it began 0.3 s before.
    assert asked[0].now == pytest.approx(0.3) and 0.3 < asked[0].blocked_from < timed.duration
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
        clock.now += 2.0 * ahead_s
        return Redirection(timed, running.now + ahead_s, None, 0.0)

    watch = look(model, scene, timed, [with_needle(scene, np.pi / 4)], onward)
    assert sentence in watch.hit() and watch.contacts[0].b == "needle"
