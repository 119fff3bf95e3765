# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories are followed to their end, or everything that moves is stopped."""
import contextlib
import threading
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryFeedback, FollowJointTrajectoryResult
from moveit_msgs.msg import MoveItErrorCodes, RobotTrajectory
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lab_testing.waiting import wait_until
from moveit_ros_move_group import execution, handles, node
from moveit_ros_move_group.controllers import read_list
from moveit_ros_move_group.execution import ExecutionSettings, Executor, part_of
from moveit_ros_move_group.rest_of_the_way import NewWay

# As long as a slow machine may need: what is tested is the answer.
PATIENCE_S = 90.0
JOINTS = ["turn", "reach"]
LONG_S = 1000.0


def trajectory(seconds, **changes):
    points = [JointTrajectoryPoint(positions=[0.0, 0.0], time_from_start=rospy.Duration(0.0)),
              JointTrajectoryPoint(positions=[1.0, 0.5], time_from_start=rospy.Duration(seconds))]
    for name, value in changes.items():
        setattr(points[1], name, value)
    return RobotTrajectory(joint_trajectory=JointTrajectory(joint_names=JOINTS, points=points))


class Joints:
    """The monitor's part: joints that rest at 0. silent: why they say nothing; late: they are heard of when somebody
    waits for them."""

    continuous = ()

    def __init__(self, silent=None, late=False):
        self._updates, self._silent, self._is_known = 0, silent, not (silent or late)

    def wait_for_state(self, after, timeout_s, joints=(), given_up=lambda: False):
        self._is_known = not self._silent
        return self._silent if joints else None

    def joint_values(self):
        return dict.fromkeys(JOINTS, 0.0) if self._is_known else {}

    def joint_update(self):
        self._updates += 1
        return self._updates, self.joint_values()


class Handle:
    """A controller as the executor sees it: ends when it is told to."""

    def __init__(self, there=True):
        self.there, self.done, self.sent, self.cancelled = there, threading.Event(), [], False
        self.text, self.preempted, self.begins = "", False, None

    def began(self):
        return self.begins

    def connected(self, timeout_s, given_up=lambda: False):
        with contextlib.suppress(AssertionError):
            wait_until(lambda: self.there or given_up(), "the controller", timeout_s, 0.001)
        return self.there

    def send(self, part):
        self.done = threading.Event()
        self.sent.append(part)

    def end(self, text=""):
        self.text = text
        self.done.set()

    def cancel(self):
        self.cancelled = True
        self.done.set()

    def was_preempted(self):
        return self.preempted

    def error(self):
        return self.text


class Lab:
    """Two controllers, a joint each, and who executes on them. run(...) returns the Outcome that comes in the end."""

    def __init__(self, joints=None, **settings):
        entries = [{"name": joint, "action_ns": "follow", "type": "FollowJointTrajectory", "joints": [joint]}
                   for joint in JOINTS]
        controllers, _ = read_list(entries)
        self.handles = {joint: Handle() for joint in JOINTS}
        self.executor = Executor(lambda: controllers, ExecutionSettings(**settings), joints or Joints(),
                                 lambda controller: self.handles[controller.name])

    def start(self, seconds=LONG_S, **hooks):
        self.outcomes = []

        def run():
            try:
                self.outcomes.append(self.executor.execute(trajectory(seconds), **hooks))
            except Exception as error:
                self.outcomes.append(error)

        self.thread = threading.Thread(target=run, daemon=True)
        self.thread.start()
        return self

    def outcome(self):
        self.thread.join(PATIENCE_S)
        return self.outcomes[0]

    def wait_until_sent(self):
        until(lambda: all(handle.sent for handle in self.handles.values()))


def until(condition):
    wait_until(condition, timeout_s=PATIENCE_S, interval_s=0.001)


def test_each_controller_gets_its_joints():
    lab = Lab().start()
    lab.wait_until_sent()
    for joint in JOINTS:
        assert lab.handles[joint].sent[0].joint_names == [joint]
        assert len(lab.handles[joint].sent[0].points[1].positions) == 1
        lab.handles[joint].end()
    assert lab.outcome().code == MoveItErrorCodes.SUCCESS


def test_a_part_has_everything_of_its_joints_alone():
    whole = trajectory(2.0, velocities=[1.0, 2.0], accelerations=[3.0, 4.0], effort=[5.0, 6.0]).joint_trajectory
    point = part_of(whole, ["reach"]).points[1]
    assert (point.positions, point.velocities, point.accelerations, point.effort) == ([0.5], [2.0], [4.0], [6.0])
    assert point.time_from_start == rospy.Duration(2.0)


def test_the_first_execution_waits_for_the_first_joint_state():
    lab = Lab(Joints(late=True)).start()
    lab.wait_until_sent()
    for joint in JOINTS:
        lab.handles[joint].end()
    assert lab.outcome().code == MoveItErrorCodes.SUCCESS


def test_joints_that_are_never_heard_of_are_named():
    outcome = Lab(Joints(silent="no joint state has come for turn")).start().outcome()
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED
    assert "no joint state has come for turn" in outcome.text


def test_joints_that_are_never_heard_of_matter_only_where_the_start_is_checked():
    lab = Lab(Joints(silent="no joint state has come for turn"), start_tolerance=0.0, wait_for_rest=False).start()
    lab.wait_until_sent()
    for joint in JOINTS:
        lab.handles[joint].end()
    assert lab.outcome().code == MoveItErrorCodes.SUCCESS


def test_one_that_fails_stops_the_others():
    lab = Lab().start()
    lab.wait_until_sent()
    lab.handles["turn"].end("controller 'turn' ended with ABORTED")
    outcome = lab.outcome()
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED and "'turn'" in outcome.text
    assert lab.handles["reach"].cancelled


def test_one_that_somebody_else_cancels_counts_as_preempted():
    lab = Lab().start()
    lab.wait_until_sent()
    lab.handles["turn"].preempted = True
    lab.handles["turn"].end("controller 'turn' ended with PREEMPTED")
    assert lab.outcome().code == MoveItErrorCodes.PREEMPTED and lab.handles["reach"].cancelled


def test_a_look_that_raises_leaves_nothing_moving():
    def look():
        raise ValueError("broken")

    lab = Lab().start(invalidated=look)
    assert isinstance(lab.outcome(), ValueError)
    assert all(handle.cancelled for handle in lab.handles.values())
    assert not lab.executor._busy.locked()


@pytest.mark.parametrize("hooks, code", [
    ({"preempted": lambda: True}, MoveItErrorCodes.PREEMPTED),
    ({"invalidated": lambda: "a box"}, MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE)])
def test_executions_end_early(hooks, code):
    lab = Lab().start(**hooks)
    assert lab.outcome().code == code and all(handle.cancelled for handle in lab.handles.values())


def test_a_new_way_is_followed_in_the_place_of_the_old_one():
    new = trajectory(2.0)
    new.joint_trajectory.header.stamp = rospy.Time.from_sec(rospy.get_time() + 0.05)
    ways = iter([None, NewWay(new, new.joint_trajectory.header.stamp.to_sec())])
    lab = Lab(wait_for_rest=False).start(seconds=0.2, invalidated=lambda: next(ways, None))
    until(lambda: all(len(handle.sent) == 2 for handle in lab.handles.values()))
    for joint, handle in lab.handles.items():
        assert handle.sent[1].joint_names == [joint] and handle.sent[1].header == new.joint_trajectory.header
        assert not handle.cancelled
        handle.end()
    assert lab.outcome().code == MoveItErrorCodes.SUCCESS


def test_a_controller_that_ends_while_it_moves_is_not_waited_for(monkeypatch):
    """The robot's computer, or the simulation with its clock, may be gone: nothing else would end the goal."""
    monkeypatch.setattr(execution, "_AWAY_S", 0.2)
    monkeypatch.setattr(rospy, "get_time", lambda: 100.0)
    lab = Lab().start(seconds=1.0)
    lab.wait_until_sent()
    lab.handles["turn"].end()
    lab.handles["reach"].there = False
    outcome = lab.outcome()
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED
    assert "'reach/follow' has ended while it moved" in outcome.text
    assert lab.handles["reach"].cancelled


def test_a_controller_that_is_away_for_a_moment_is_waited_for():
    lab = Lab().start(seconds=1.0)
    lab.wait_until_sent()
    asked = []
    lab.handles["reach"].connected = lambda timeout_s, given_up=None: asked.append(timeout_s) or len(asked) > 3
    until(lambda: len(asked) > 5)
    for handle in lab.handles.values():
        handle.end()
    assert lab.outcome().code == MoveItErrorCodes.SUCCESS


def stopping(seconds=2.0):
    new = trajectory(seconds)
    new.joint_trajectory.header.stamp = rospy.Time.from_sec(rospy.get_time() + 0.05)
    return NewWay(new, new.joint_trajectory.header.stamp.to_sec(), "a box")


def test_joints_that_come_to_rest_before_something_have_not_arrived():
    ways = iter([None, stopping()])
    lab = Lab().start(invalidated=lambda: next(ways, None))
    until(lambda: all(len(handle.sent) == 2 for handle in lab.handles.values()))
    for handle in lab.handles.values():
        assert not handle.cancelled
        handle.end()
    outcome = lab.outcome()
    assert (outcome.code, outcome.text) == (MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE, "a box")
    assert not any(handle.cancelled for handle in lab.handles.values())


def test_what_comes_near_while_they_come_to_rest_stops_them_at_once():
    ways = iter([None, stopping(), None, "another box"])
    outcome = Lab().start(invalidated=lambda: next(ways, None)).outcome()
    assert (outcome.code, outcome.text) == (MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                                            "another box")


def test_a_controller_that_does_not_come_to_rest_is_cancelled():
    ways = iter([stopping(0.01)])
    lab = Lab(scaling=1.0, margin=0.01).start(invalidated=lambda: next(ways, None))
    outcome = lab.outcome()
    assert outcome.code == MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
    assert outcome.text.startswith("a box; ") and "0.01 s planned" in outcome.text
    assert all(handle.cancelled for handle in lab.handles.values())


def test_the_time_limit_is_that_of_the_new_way():
    new = trajectory(0.01)
    ways = iter([NewWay(new, rospy.get_time())])
    outcome = Lab(scaling=1.0, margin=0.01).start(invalidated=lambda: next(ways, None)).outcome()
    assert outcome.code == MoveItErrorCodes.TIMED_OUT and "0.01 s planned" in outcome.text


def test_controllers_say_when_a_trajectory_began():
    lab = Lab().start()
    lab.wait_until_sent()
    assert lab.executor.began() is None
    lab.handles["turn"].begins, lab.handles["reach"].begins = 10.0, 10.1
    assert lab.executor.began() == 10.1
    lab.executor.stop()
    lab.outcome()


def test_stop_ends_the_wait_for_a_controller():
    lab = Lab(connection_timeout=LONG_S)
    lab.handles["reach"].there = False
    lab.start()
    until(lab.executor._busy.locked)
    while not lab.outcomes:  # a stop before it has begun does not count
        lab.executor.stop()
        lab.thread.join(0.01)
    assert lab.outcome().code == MoveItErrorCodes.PREEMPTED and not lab.handles["turn"].sent


def test_a_controller_that_is_not_there_is_named():
    lab = Lab(connection_timeout=0.0)
    lab.handles["reach"].there = False
    outcome = lab.start().outcome()
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED and "'reach/follow' does not answer" in outcome.text


def test_one_that_never_ends_is_stopped():
    lab = Lab(scaling=1.0, margin=0.01).start(seconds=0.01)
    outcome = lab.outcome()
    assert outcome.code == MoveItErrorCodes.TIMED_OUT and "'turn/follow', 'reach/follow'" in outcome.text


@pytest.mark.parametrize("change, sentence", [
    ({"velocities": [1.0]}, "1 velocity for 2 joints"), ({"positions": [1.0]}, "1 position for 2 joints"),
    ({"accelerations": [1.0, float("nan")]}, "not finite"), ({"time_from_start": rospy.Duration(0)}, "have to grow")])
def test_flaws_of_trajectories_are_named(change, sentence):
    outcome = Lab().executor.execute(trajectory(1.0, **change))
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED and sentence in outcome.text


# -- handles ----------------------------------------------------------------------------------------------------

class Sent:
    """actionlib's handle of a goal."""

    def __init__(self, moved):
        self.moved, self.state, self.status, self.cancelled = moved, actionlib.CommState.ACTIVE, None, False

    def get_comm_state(self):
        return self.state

    def get_terminal_state(self):
        return self.status

    def get_goal_status_text(self):
        return ""

    def get_result(self):
        return FollowJointTrajectoryResult(error_code=FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED)

    def cancel(self):
        self.cancelled = True

    def end(self, status):
        self.state, self.status = actionlib.CommState.DONE, status
        self.moved(self)


class Client:
    """actionlib's client."""

    def __init__(self, *_):
        self.sent, self.manager = [], SimpleNamespace()

    def send_goal(self, goal, moved, told):
        self.sent.append(Sent(moved))
        self.told = told
        return self.sent[-1]


@pytest.fixture
def follow(monkeypatch):
    monkeypatch.setattr(handles.actionlib, "ActionClient", Client)
    controllers, _ = read_list([{"name": "a", "action_ns": "f", "type": "FollowJointTrajectory", "joints": JOINTS}])
    return handles.ControllerHandles(controllers).of(controllers[0])


def test_the_late_end_of_an_older_goal_ends_no_other(follow):
    follow.send(trajectory(1.0).joint_trajectory)
    follow.send(trajectory(1.0).joint_trajectory)
    older, newer = follow._client.sent
    older.end(GoalStatus.PREEMPTED)
    assert not follow.done.is_set() and not follow.error() and not follow.was_preempted()
    newer.end(GoalStatus.ABORTED)
    assert follow.done.is_set() and "'a/f' ended with ABORTED, PATH_TOLERANCE_VIOLATED" in follow.error()


def test_a_cancel_ends_all_goals_that_run(follow):
    """A goal that was to take another's place may have been refused, and the other still run."""
    for _ in range(3):
        follow.send(trajectory(1.0).joint_trajectory)
    first, second, third = follow._client.sent
    first.end(GoalStatus.PREEMPTED)
    third.end(GoalStatus.REJECTED)
    follow.cancel()
    assert [one.cancelled for one in (first, second, third)] == [False, True, False]


def test_feedback_tells_when_a_goal_began(follow):
    follow.send(trajectory(1.0).joint_trajectory)
    assert follow.began() is None
    feedback = FollowJointTrajectoryFeedback()
    feedback.header.stamp = rospy.Time(20.0)
    follow._client.told(None, feedback)  # some servers say nothing of time
    assert follow.began() is None
    feedback.desired.time_from_start = rospy.Duration(2.5)
    follow._client.told(None, feedback)
    assert follow.began() == 17.5
    follow.send(trajectory(1.0).joint_trajectory)
    assert follow.began() is None


class Heard(list):
    """A publisher that keeps what it is given."""

    publish = list.append


def fake(kind, **options):
    controllers, _ = read_list([{"name": "a", "joints": JOINTS, "type": kind, **options}], fake=True)
    return handles.FakeHandle(controllers[0], Heard())


@pytest.mark.parametrize("kind", ["interpolate", "via points", "last point"])
def test_fake_controllers_come_to_the_end(kind):
    one = fake(kind, rate=1000)
    one.send(trajectory(0.05).joint_trajectory)
    assert one.done.wait(PATIENCE_S) and not one.error()
    assert list(one._publisher[-1].position) == [1.0, 0.5] and one._publisher[-1].name == JOINTS


def test_a_fake_controllers_old_way_says_nothing_after_the_new_one(monkeypatch):
    """Also where the old one's thread is held up while it speaks."""
    one, said, new_has_spoken = fake("interpolate", rate=1000), [], threading.Event()

    def publish(message):
        if message.position[0] >= 0.0 and not said:
            new_has_spoken.wait(0.3)  # it does not: the new one waits for this
        said.append(message.position[0])
        if message.position[0] < 0.0:
            new_has_spoken.set()

    monkeypatch.setattr(one._publisher, "publish", publish)
    one.send(trajectory(LONG_S).joint_trajectory)
    new = trajectory(0.01, positions=[-3.0, 0.0]).joint_trajectory
    new.points = new.points[1:]
    one.send(new)
    assert one.done.wait(PATIENCE_S)
    wait_until(lambda: len(said) >= 2, "both to have spoken")
    assert said[-1] == -3.0


def test_a_fake_controller_that_was_cancelled_plays_what_comes_next():
    one = fake("interpolate", rate=0.001)  # sleeps for longer than the test
    one.send(trajectory(LONG_S).joint_trajectory)
    one.cancel()
    assert one.was_preempted()
    one._step = 0.001
    one.send(trajectory(0.01).joint_trajectory)
    assert one.done.wait(PATIENCE_S) and not one.was_preempted()


def test_a_fake_controller_follows_the_old_way_until_the_new_one_begins():
    one = fake("interpolate", rate=1000)
    one.send(trajectory(0.4).joint_trajectory)
    new = trajectory(0.2, positions=[-3.0, 0.0]).joint_trajectory
    new.header.stamp, new.points = rospy.Time.from_sec(rospy.get_time() + 0.2), new.points[1:]
    one.send(new)
    assert one.done.wait(PATIENCE_S)
    turns = [message.position[0] for message in one._publisher]
    assert max(turns) > 0.1 and turns[-1] == -3.0
    # Nothing of the old way comes behind the new one.
    assert all(turn <= 0.0 for turn in turns[turns.index(max(turns)) + 1:])


@pytest.mark.parametrize("rate", [0, -1.0, "fast", None])
def test_a_rate_that_is_none_counts_as_ten_times_a_second(rate):
    assert fake("interpolate", rate=rate)._step == pytest.approx(0.1)


@pytest.mark.parametrize(("entry", "named"), [
    ({"name": "/robot/limb/left", "action_ns": "follow_joint_trajectory"}, "joint_trajectory_action_server.py"),
    ({"name": "robot/end_effector/left_gripper", "action_ns": "gripper_action"}, "gripper_action_server.py"),
    ({"name": "arm", "action_ns": "follow", "started_by": "rosrun my_robot arm_server"}, "my_robot arm_server"),
    ({"name": "arm", "action_ns": "follow"}, "controller_list")])
def test_a_controller_that_does_not_answer_is_named_with_the_command_that_starts_it(entry, named, monkeypatch):
    """When a motion fails, and already at the start."""
    controllers, _ = read_list([{**entry, "type": "FollowJointTrajectory", "joints": list(JOINTS)}])
    missing = Handle(there=False)
    executor = Executor(lambda: controllers, ExecutionSettings(connection_timeout=0.01), Joints(), lambda _: missing)
    outcome = executor.execute(trajectory(1.0))
    assert outcome.code == MoveItErrorCodes.CONTROL_FAILED and named in outcome.text and entry["name"] in outcome.text
    told = []
    monkeypatch.setattr(node, "_CONTROLLERS_TIMEOUT_S", 0.01)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: told.append(text % values))
    node.tell_of_silent_controllers(executor)
    assert len(told) == 1 and named in told[0] and entry["name"] in told[0]
    missing.there = True
    node.tell_of_silent_controllers(executor)
    node.tell_of_silent_controllers(None)
    assert len(told) == 1
