# SPDX-License-Identifier: BSD-3-Clause
"""The gripper controllers on a finger that follows its commands, or does not."""
import pytest
from actionlib_msgs.msg import GoalID, GoalStatus
from control_msgs.msg import GripperCommandActionGoal

from controller_manager import EFFORT, POSITION, ControllerError
from controller_manager.testing import FakeHardware, fake_context
from ros_controllers.gripper import EffortGripperActionController, PositionGripperActionController

DT = 0.002
GAINS = {"gains": {"finger": {"p": 400.0, "d": 40.0}}}
BOTH = pytest.mark.parametrize("kind", [PositionGripperActionController, EffortGripperActionController])


class Gripper:
    def __init__(self, kind, start=True, **parameters):
        self.interface = kind.interface
        self.hardware = FakeHardware({"finger": (kind.interface,)}, lag=0.9)
        self.hardware.position[:] = 0.02
        context, self.ros = fake_context("hand", {"joint": "finger", **GAINS, **parameters})
        self.controller = kind("hand", self.hardware, context)
        self.running = start
        self.time_s = 10.0
        self.ids = 0
        if start:
            self.controller.starting(self.time_s)

    def goal(self, position, max_effort=50.0):
        self.ids += 1
        message = GripperCommandActionGoal(goal_id=GoalID(id="goal_%d" % self.ids))
        message.goal.command.position, message.goal.command.max_effort = position, max_effort
        self.ros.subscriptions["/robot/hand/gripper_cmd/goal"].put(message)

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            if self.running:
                self.controller.update(self.time_s, DT)
            else:
                self.controller.idle(self.time_s)
            self.hardware.step(DT)
            self.time_s += DT

    @property
    def results(self):
        """List of (goal id, state, result)."""
        return [(message.status.goal_id.id, message.status.status, message.result)
                for message in self.ros.publishers["/robot/hand/gripper_cmd/result"].messages]


@BOTH
def test_a_goal_that_is_reached_succeeds(kind):
    gripper = Gripper(kind)
    gripper.goal(0.0)
    gripper.run(1.0)
    (name, state, result), = gripper.results
    assert (name, state, result.reached_goal, result.stalled) == ("goal_1", GoalStatus.SUCCEEDED, True, False)
    assert abs(result.position) < 0.01


@BOTH
def test_a_finger_that_stands_still_is_a_stall(kind):
    gripper = Gripper(kind, stall_timeout=0.5)
    gripper.hardware.frozen = True
    gripper.goal(0.0)
    gripper.run(0.45)
    assert gripper.results == []
    gripper.run(0.2)
    (_, state, result), = gripper.results
    assert (state, result.reached_goal, result.stalled) == (GoalStatus.ABORTED, False, True)
    assert result.position == 0.02


def test_a_finger_that_moves_is_no_stall():
    gripper = Gripper(PositionGripperActionController, stall_timeout=0.05)
    gripper.hardware.lag = 0.995
    gripper.goal(-1.0)
    gripper.run(0.5)
    assert gripper.results == []


def test_the_effort_is_bounded_by_the_goal():
    gripper = Gripper(EffortGripperActionController)
    gripper.goal(-5.0, max_effort=3.0)
    gripper.run(DT)
    assert gripper.hardware.command[EFFORT].tolist() == [-3.0]


def test_before_a_goal_it_holds_with_the_default_effort():
    gripper = Gripper(EffortGripperActionController, max_effort=2.0)
    gripper.hardware.position[:] = 0.5
    gripper.run(DT)
    assert gripper.hardware.command[EFFORT].tolist() == [-2.0]
    gripper = Gripper(PositionGripperActionController)
    gripper.run(0.1)
    assert gripper.hardware.command[POSITION].tolist() == [0.02]


@BOTH
def test_a_new_goal_takes_the_place_of_the_old_one(kind):
    gripper = Gripper(kind)
    gripper.goal(-9.0)
    gripper.run(DT)
    gripper.goal(0.0)
    gripper.run(1.0)
    assert [(name, state) for name, state, _ in gripper.results] == [
        ("goal_1", GoalStatus.PREEMPTED), ("goal_2", GoalStatus.SUCCEEDED)]


def test_a_cancelled_goal_holds_where_the_finger_is():
    gripper = Gripper(PositionGripperActionController)
    gripper.goal(-9.0)
    gripper.run(0.01)
    gripper.ros.subscriptions["/robot/hand/gripper_cmd/cancel"].put(GoalID(id="goal_1"))
    gripper.run(DT)
    where = gripper.hardware.command[POSITION][0]
    gripper.run(0.5)
    assert gripper.results[0][1] == GoalStatus.PREEMPTED
    assert gripper.hardware.position[0] == pytest.approx(where) and where > -9.0


def test_goals_while_stopped_or_not_finite_are_rejected():
    gripper = Gripper(PositionGripperActionController, start=False)
    gripper.goal(0.0)
    gripper.run(DT)
    assert gripper.results[0][1] == GoalStatus.REJECTED
    gripper = Gripper(PositionGripperActionController)
    gripper.goal(float("nan"))
    gripper.run(DT)
    assert gripper.results[0][1] == GoalStatus.REJECTED


def test_stopping_cancels_the_goal():
    gripper = Gripper(PositionGripperActionController)
    gripper.goal(-9.0)
    gripper.run(DT)
    gripper.controller.stopping(gripper.time_s)
    assert gripper.results[0][1] == GoalStatus.PREEMPTED


@pytest.mark.parametrize(("kind", "parameters", "text"), [
    (PositionGripperActionController, {"joint": None}, "/robot/hand/joint is missing"),
    (EffortGripperActionController, {"gains": {}}, "/robot/hand/gains/finger/p is missing"),
    (PositionGripperActionController, {"stall_timeout": "long"}, "/robot/hand/stall_timeout is 'long'"),
])
def test_wrong_gripper_parameters_are_named(kind, parameters, text):
    with pytest.raises(ControllerError, match=text):
        Gripper(kind, **parameters)
