# SPDX-License-Identifier: BSD-3-Clause
"""Planned motions: what is planned, what is told, what a stop ends. The planner is the test's own."""
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from lab_testing.waiting import wait_until
from lab_web.lab import PageLab
from lab_web.motion import PageJointLimits
from lab_web.planning import SAMPLE_S, PagePlan, PagePlanning, PlanFailed, tape_of
from lab_web.task_queue import TaskQueue
from loop_ros.faults import Faults

START = {"left_s0": 0.0, "left_s1": 0.5}
GOAL = {"left_s0": 0.4, "left_s1": 0.1}


class Robot:
    def __init__(self):
        self.positions = dict(START)
        self.limits = dict.fromkeys(START, PageJointLimits(-1.0, 1.0, 2.0))
        self.poses = {"neutral": dict(GOAL)}
        self.enabled = True

    def measured(self):
        return dict(self.positions)

    def why_not_ready(self):
        return "" if self.enabled else "not enabled"

    time_s = 0.0

    def command(self, setpoints):
        self.positions.update(setpoints)

    def stop(self):
        self.enabled = False


class Planner:
    """Plans a curve at once, or waits until it may."""

    def __init__(self, robot):
        self._robot = robot
        self.may_answer, self.began, self.error = threading.Event(), threading.Event(), None
        self.may_answer.set()
        self.asked = []

    def plan(self, targets):
        self.asked.append(targets)
        self.began.set()
        assert self.may_answer.wait(60.0)
        if self.error is not None:
            raise self.error
        names = list(targets)
        begin, end = ([row[name] for name in names] for row in (self._robot.positions, targets))
        middle = [value + 0.1 for value in begin]
        return PagePlan(names, [0.0, 0.5, 1.0], [begin, middle, end], [[0.0] * len(names)] * 3)

    def cancel(self):
        self.error = PlanFailed("preempted", "the planning was stopped")
        self.may_answer.set()


class Served:
    def __init__(self):
        self.robot, self.told, self.answers = Robot(), [], []
        self.planner = Planner(self.robot)
        self.lab = PageLab(self.robot, lambda: None, lambda *told: self.told.append(told), silence_s=60.0)
        tasks = TaskQueue(lambda *told: self.told.append(told), Faults(SimpleNamespace(error=pytest.fail)))
        planning = PagePlanning(self.lab, self.robot, self.planner, tasks, lambda _,
                                answer: self.answers.append(answer))
        self.lab.add("plan", planning.plan)
        self.lab.when_lost(planning.cancel, when_silent=False)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=tasks.run, args=(self._ended.is_set,))
        self._thread.start()
        self.do("take")

    def do(self, op, client=1, **values):
        self.lab.serve(client, True, {"op": op, **values})

    def said(self):
        return [answer["why"] for answer in self.answers]

    def end(self):
        self._ended.set()
        self._thread.join()


@pytest.fixture
def served():
    made = Served()
    yield made
    made.end()


@pytest.mark.parametrize("goal", [{"joints": GOAL}, {"name": "neutral"}])
def test_the_arms_follow_the_plan_to_its_end(served, goal):
    served.do("plan", **goal)
    wait_until(lambda: served.said() == ["busy", "found"], lambda: str(served.answers))
    assert served.planner.asked == [GOAL] and served.answers[1]["seconds"] == 1.0 and served.told == []
    highest = 0.0
    while served.lab.is_moving:
        served.lab.tick(0.01)
        highest = max(highest, served.robot.positions["left_s1"])
    assert served.robot.positions == pytest.approx(GOAL) and highest == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("goal", [
    {}, {"name": "elsewhere"}, {"name": [1]}, {"joints": [1]}, {"joints": {}}, {"joints": {"left_s0": 3.0}},
    {"joints": {"tail": 0.0}}, {"joints": {"left_s0": 10 ** 400}}, {"joints": {"left_s0": None}}])
def test_what_no_motion_could_do_is_refused_before_it_is_planned(served, goal):
    served.do("plan", **goal)
    ((_, code, text),) = served.told
    assert code == "refused" and len(text) > 10 and served.planner.asked == []


def test_a_page_without_the_control_plans_nothing(served):
    served.do("plan", client=2, joints=GOAL)
    assert served.told[0][:2] == (2, "not_in_control") and served.planner.asked == []


def test_a_reason_of_the_planner_is_told(served):
    served.planner.error = PlanFailed("goal_in_collision", "link 'left_hand' and object 'crate' overlap by 0.0113 m")
    served.do("plan", joints=GOAL)
    wait_until(lambda: len(served.answers) == 2, "an answer")
    assert served.answers[1]["why"] == "goal_in_collision" and "crate" in served.answers[1]["text"]
    assert not served.lab.is_moving


@pytest.mark.parametrize("end", [
    lambda served: served.do("stop"), lambda served: served.do("take", client=2), lambda served: served.lab.gone(1)])
def test_a_stop_ends_the_planning_and_nothing_moves(served, end):
    served.planner.may_answer.clear()
    served.do("plan", joints=GOAL)
    assert served.planner.began.wait(60.0)
    end(served)
    wait_until(lambda: served.said() == ["busy", "preempted"], lambda: str(served.answers))
    assert not served.lab.is_moving and served.robot.positions == START


def test_a_plan_that_comes_after_the_stop_moves_nothing(served):
    served.planner.may_answer.clear()
    served.planner.cancel = served.planner.may_answer.set
    served.do("plan", joints=GOAL)
    assert served.planner.began.wait(60.0)
    served.do("stop")
    served.robot.enabled = True
    wait_until(lambda: served.said() == ["busy", "preempted"], lambda: str(served.answers))
    assert not served.lab.is_moving


def test_a_newer_goal_ends_the_planning_of_the_one_before(served):
    served.planner.may_answer.clear()
    served.do("plan", joints=GOAL)
    assert served.planner.began.wait(60.0)
    served.planner.cancel = lambda: served.planner.may_answer.set()
    served.do("plan", joints={"left_s0": -0.5})
    wait_until(lambda: served.said() == ["busy", "preempted", "busy", "found"], lambda: str(served.answers))


def test_an_arm_that_has_moved_since_is_not_sent_along_the_plan(served):
    served.planner.may_answer.clear()
    served.do("plan", joints=GOAL)
    assert served.planner.began.wait(60.0)
    plan = PagePlan(["left_s0"], [0.0, 1.0], [[0.3], [0.4]], None)
    served.planner.plan = lambda _: plan
    served.planner.may_answer.set()
    wait_until(lambda: len(served.answers) == 2, "the first plan")
    served.do("plan", joints={"left_s0": 0.4})
    wait_until(lambda: served.said()[-1] == "refused", lambda: str(served.answers))
    assert "where the plan begins" in served.answers[-1]["text"]


def test_a_plan_is_sampled_as_controllers_interpolate_it():
    tape = tape_of(PagePlan(["a"], [1.0, 2.0], [[0.0], [1.0]], [[0.0], [0.0]]))
    assert tape.times_s[0] == 0.0 and tape.duration_s == 1.0 and max(np.diff(tape.times_s)) <= SAMPLE_S + 1e-9
    assert tape.at(0.5)["a"] == pytest.approx(0.5)
    assert tape.at(0.26)["a"] == pytest.approx(0.26 ** 2 * (3 - 0.52), abs=1e-3)
    assert tape_of(PagePlan(["a"], [0.0, 1.0], [[0.0], [1.0]], None)).at(0.26)["a"] == pytest.approx(0.26)


@pytest.mark.parametrize("plan", [
    PagePlan(["a"], [], [], None), PagePlan(["a"], [0.0], [[0.0]], None),
    PagePlan(["a"], [0.0, 0.0], [[0.0], [1.0]], None),
    PagePlan(["a", "b"], [0.0, 1.0], [[0.0], [1.0]], None), PagePlan(["a"], [0.0, 1.0], [[0.0], [float("nan")]], None),
    PagePlan(["a"], [0.0, 1.0], [[0.0], [1.0, 2.0]], None),
    PagePlan(["a"], [0.0, 1.0], [[0.0], [1.0]], [[0.0, 1.0], [0.0, 1.0]])])
def test_what_is_no_plan_is_refused(plan):
    with pytest.raises(PlanFailed) as failed:
        tape_of(plan)
    assert failed.value.code == "invalid"
