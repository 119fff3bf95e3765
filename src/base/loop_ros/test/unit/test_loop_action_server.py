# SPDX-License-Identifier: BSD-3-Clause
"""The action protocol, without a master: states of goals, cancel requests of every kind, what is published when."""
import io
import struct

import genpy
import pytest
from actionlib_msgs.msg import GoalID, GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
)

from loop_ros.action_server import ActionServer, WrongState, _numbered
from loop_ros.testing import FakeRos


class Served:
    """A server whose owner only accepts every goal (unless ``accepts`` is false)."""

    def __init__(self, accepts=True):
        self.ros = FakeRos()
        self.accepts = accepts
        self.begun, self.asked_to_end = [], []
        self.server = ActionServer(self.ros, "act", FollowJointTrajectoryAction, self._on_goal,
                                   self.asked_to_end.append)

    def _on_goal(self, handle):
        self.begun.append(handle)
        if self.accepts:
            handle.accept("fine")

    def send(self, name, stamp_s=1.0):
        message = FollowJointTrajectoryActionGoal()
        message.goal_id = GoalID(genpy.Time.from_sec(stamp_s), name)
        self.ros.subscriptions["act/goal"].put(message)

    def cancel(self, name="", stamp_s=0.0):
        self.ros.subscriptions["act/cancel"].put(GoalID(genpy.Time.from_sec(stamp_s), name))

    @property
    def statuses(self):
        """{goal id: state} as last published."""
        newest = self.ros.publishers["act/status"].messages[-1]
        return {status.goal_id.id: status.status for status in newest.status_list}

    @property
    def results(self):
        """List of (goal id, state)."""
        messages = self.ros.publishers["act/result"].messages
        return [(message.status.goal_id.id, message.status.status) for message in messages]


@pytest.fixture
def served():
    return Served()


def test_goal_becomes_active_and_succeeds(served):
    served.send("a")
    served.server.spin(10.0)
    assert served.statuses == {"a": GoalStatus.ACTIVE}
    served.begun[0].succeed(FollowJointTrajectoryResult(error_code=7), "done")
    message = served.ros.publishers["act/result"].messages[0]
    assert (message.result.error_code, message.status.text) == (7, "done")
    assert served.results == [("a", GoalStatus.SUCCEEDED)]
    assert served.statuses == {"a": GoalStatus.SUCCEEDED}
    assert message.header.stamp == genpy.Time(10)


@pytest.mark.parametrize("steps, state", [
    (["reject"], GoalStatus.REJECTED),
    (["cancel"], GoalStatus.RECALLED),
    (["accept", "abort"], GoalStatus.ABORTED),
    (["accept", "succeed"], GoalStatus.SUCCEEDED),
    (["accept", "cancel"], GoalStatus.PREEMPTED),
])
def test_states_of_a_goal(steps, state):
    served = Served(accepts=False)
    served.send("a")
    served.server.spin(1.0)
    for step in steps:
        getattr(served.begun[0], step)()
    assert served.results == [("a", state)]


@pytest.mark.parametrize("steps", [["succeed"], ["abort"], ["accept", "accept"], ["accept", "reject"],
                                   ["accept", "succeed", "cancel"], ["reject", "accept"]])
def test_steps_out_of_order_are_refused(steps):
    served = Served(accepts=False)
    served.send("a")
    served.server.spin(1.0)
    with pytest.raises(WrongState, match="cannot %s a goal that is" % steps[-1]):
        for step in steps:
            getattr(served.begun[0], step)()


def test_feedback_carries_the_goal(served):
    served.send("a")
    served.server.spin(1.0)
    served.begun[0].publish_feedback(FollowJointTrajectoryFeedback(joint_names=["x"]))
    message = served.ros.publishers["act/feedback"].messages[0]
    assert (message.status.goal_id.id, message.feedback.joint_names) == ("a", ["x"])


def test_status_goes_out_five_times_a_second_and_is_latched(served):
    for tick in range(1000):
        served.server.spin(tick * 0.002)
    assert len(served.ros.publishers["act/status"].messages) == 10
    assert [topic for topic, publisher in served.ros.publishers.items() if publisher.keeps_last] == ["act/status"]


def test_ended_goals_are_told_for_a_while(served):
    served.send("a")
    served.server.spin(1.0)
    served.begun[0].succeed()
    served.server.spin(5.9)
    assert served.statuses == {"a": GoalStatus.SUCCEEDED}
    served.server.spin(6.3)
    assert served.statuses == {}


def test_active_goals_are_told_for_ever(served):
    served.send("a")
    for time in (1.0, 100.0, 1000.0):
        served.server.spin(time)
    assert served.statuses == {"a": GoalStatus.ACTIVE}


def test_goal_that_comes_twice_is_begun_once(served):
    served.send("a")
    served.send("a")
    served.server.spin(1.0)
    served.send("a")
    served.server.spin(1.1)
    assert len(served.begun) == 1


def test_goals_without_a_name_get_one_each_and_the_time(served):
    served.send("", 0.0)
    served.send("", 0.0)
    served.server.spin(2.5)
    ids = [handle.status.goal_id for handle in served.begun]
    assert len({goal_id.id for goal_id in ids}) == 2 and all(goal_id.id for goal_id in ids)
    assert all(goal_id.stamp == genpy.Time(2, 500000000) for goal_id in ids)


# -- cancel requests ----------------------------------------------------------------------------------------------

def test_cancel_by_name(served):
    served.send("a")
    served.send("b")
    served.cancel("a")
    served.server.spin(1.0)
    assert [handle.status.goal_id.id for handle in served.asked_to_end] == ["a"]
    assert served.statuses == {"a": GoalStatus.PREEMPTING, "b": GoalStatus.ACTIVE}
    served.asked_to_end[0].cancel()
    assert served.results == [("a", GoalStatus.PREEMPTED)]


def test_cancel_of_a_pending_goal_recalls_it():
    served = Served(accepts=False)
    served.send("a")
    served.server.spin(1.0)
    served.cancel("a")
    served.server.spin(1.1)
    assert served.statuses == {"a": GoalStatus.RECALLING}
    served.asked_to_end[0].cancel()
    assert served.results == [("a", GoalStatus.RECALLED)]


def test_recalled_goal_that_is_accepted_all_the_same_is_preempting():
    served = Served(accepts=False)
    served.send("a")
    served.server.spin(1.0)
    served.cancel("a")
    served.server.spin(1.1)
    served.begun[0].accept()
    assert served.statuses == {"a": GoalStatus.PREEMPTING}


def test_cancel_all(served):
    for name in "abc":
        served.send(name)
    served.server.spin(1.0)
    served.begun[1].succeed()
    served.cancel()
    served.server.spin(1.1)
    assert [handle.status.goal_id.id for handle in served.asked_to_end] == ["a", "c"]


def test_cancel_up_to_a_time(served):
    for name, stamp in (("a", 1.0), ("b", 2.0), ("c", 3.0)):
        served.send(name, stamp)
    served.server.spin(4.0)
    served.cancel(stamp_s=2.0)
    served.server.spin(4.1)
    assert [handle.status.goal_id.id for handle in served.asked_to_end] == ["a", "b"]


def test_cancel_by_name_and_time_means_both(served):
    for name, stamp in (("a", 1.0), ("b", 2.0), ("c", 3.0)):
        served.send(name, stamp)
    served.server.spin(4.0)
    served.cancel("c", 1.0)
    served.server.spin(4.1)
    assert [handle.status.goal_id.id for handle in served.asked_to_end] == ["a", "c"]


def test_goal_from_before_a_cancelled_time_is_not_begun(served):
    served.cancel(stamp_s=5.0)
    served.server.spin(1.0)
    served.send("late", 5.0)
    served.send("next", 5.1)
    served.server.spin(1.1)
    assert served.results == [("late", GoalStatus.RECALLED)]
    assert [handle.status.goal_id.id for handle in served.begun] == ["next"]


def test_cancel_that_overtakes_its_goal_recalls_it(served):
    served.cancel("a")
    served.server.spin(1.0)
    assert served.statuses == {"a": GoalStatus.RECALLING}
    served.send("a")
    served.server.spin(1.1)
    assert served.results == [("a", GoalStatus.RECALLED)]
    assert served.begun == []


def test_cancel_of_a_goal_that_has_ended_does_nothing(served):
    served.send("a")
    served.server.spin(1.0)
    served.begun[0].succeed()
    served.cancel("a")
    served.server.spin(1.1)
    assert served.asked_to_end == [] and served.results == [("a", GoalStatus.SUCCEEDED)]


def test_goals_and_cancels_of_one_tick_are_taken_in_the_order_of_arrival():
    served = Served()
    numbered_goal, numbered_cancel = _numbered(FollowJointTrajectoryActionGoal), _numbered(GoalID)

    def arrive(topic, numbered, message):
        buffer = io.BytesIO()
        message.serialize(buffer)
        served.ros.subscriptions[topic].put(numbered().deserialize(buffer.getvalue()))

    old, new = FollowJointTrajectoryActionGoal(), FollowJointTrajectoryActionGoal()
    old.goal_id.id, new.goal_id.id = "old", "new"
    arrive("act/goal", numbered_goal, old)
    arrive("act/cancel", numbered_cancel, GoalID())
    arrive("act/goal", numbered_goal, new)
    served.server.spin(1.0)
    assert [handle.status.goal_id.id for handle in served.asked_to_end] == ["old"]


def test_numbered_messages_are_the_same_on_the_wire():
    numbered = _numbered(FollowJointTrajectoryActionGoal)
    assert numbered._md5sum == FollowJointTrajectoryActionGoal._md5sum
    assert numbered._type == FollowJointTrajectoryActionGoal._type


def test_time_that_goes_back_does_not_cancel_or_silence_anything(served):
    served.cancel(stamp_s=100.0)
    served.server.spin(100.0)
    published = len(served.ros.publishers["act/status"].messages)
    served.send("a", 0.5)
    served.server.spin(0.5)
    assert len(served.ros.publishers["act/status"].messages) > published
    assert served.statuses == {"a": GoalStatus.ACTIVE}


def test_a_new_goal_may_have_the_id_of_one_that_ended_before_the_time_went_back(served):
    """actionlib derives ids from the time, and a restarted client starts its count again."""
    for _ in range(2):
        served.send("client-1-1.000", 1.0)
        served.server.spin(1.0)
        assert served.statuses == {"client-1-1.000": GoalStatus.ACTIVE}
        served.begun[-1].succeed()
        served.server.spin(0.5)
    assert len(served.begun) == 2


def test_a_goal_that_the_owner_fails_on_is_rejected_and_the_next_one_is_not(served):
    real = served.server._on_goal

    def fail(handle):
        served.server._on_goal = real
        raise RecursionError("broken on purpose")

    served.server._on_goal = fail
    served.send("bad")
    served.send("good")
    served.server.spin(10.0)
    assert served.statuses == {"bad": GoalStatus.REJECTED, "good": GoalStatus.ACTIVE}
    assert "RecursionError: broken on purpose" in served.ros.publishers["act/result"].messages[0].status.text
    (place, error), = served.ros.faults.noted
    assert place == "act/goal" and isinstance(error, RecursionError)


def test_a_cancel_request_that_the_owner_fails_on_ends_the_goal(served):
    served.send("a")
    served.server.spin(10.0)
    served.server._on_cancel = lambda handle: 1 / 0
    served.cancel("a")
    served.server.spin(10.1)
    assert served.results == [("a", GoalStatus.ABORTED)]
    (place, error), = served.ros.faults.noted
    assert place == "act/cancel" and isinstance(error, ZeroDivisionError)


@pytest.mark.parametrize("topic", ["goal", "cancel"])
def test_an_id_that_cannot_be_sent_back_is_dropped_and_others_go_on(served, topic):
    """As it is read from the wire: its stamp does not fit any more once the nanoseconds have been carried over."""
    goal_id = GoalID().deserialize(struct.pack("<III1s", 0xFFFFFFFF, 0xFFFFFFFF, 1, b"x"))
    message = goal_id if topic == "cancel" else FollowJointTrajectoryActionGoal(goal_id=goal_id)
    served.ros.subscriptions["act/" + topic].put(message)
    served.send("a")
    served.server.spin(10.0)
    assert served.statuses == {"a": GoalStatus.ACTIVE}
