# SPDX-License-Identifier: BSD-3-Clause
"""The node tf2_web_republisher: an action and a service that send transforms to web pages."""
from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import rospy
import tf2_ros
from actionlib.action_server import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle

from rospy_nodes.start import end_on_signals, limit_ports
from tf2_web_republisher.msg import TFArray, TFSubscriptionAction, TFSubscriptionFeedback
from tf2_web_republisher.srv import RepublishTFs, RepublishTFsRequest
from tf2_web_republisher.watch import Audience, Found, FrameWatch, WallSchedule, period_of

# A goal ends when nobody has listened to the feedback for this long [s]: pages go without cancelling theirs.
GONE_S = 10.0
# Goals at a time; then the oldest ends. Pages that come and go while another one listens leave theirs behind.
MAX_GOALS = 500


class Republisher:
    """Goals and topics of all pages."""

    def __init__(self) -> None:
        self._buffer = tf2_ros.Buffer()
        self._schedule = WallSchedule()
        self._numbers = itertools.count()
        self._goals: dict[str, tuple[ServerGoalHandle, Callable[[], None]]] = {}  # by id
        self._server = ActionServer("tf2_web_republisher", TFSubscriptionAction, self._begin, self._cancel,
                                    auto_start=False)
        self._kept = [tf2_ros.TransformListener(self._buffer),
                      rospy.Service("republish_tfs", RepublishTFs, self._topic)]
        self._server.start()

    def _lookup(self, target: str, source: str) -> Found | None:
        try:
            found = self._buffer.lookup_transform(target, source, rospy.Time(0))
        # Frames that are not there yet, or not connected, or no names.
        except (tf2_ros.TransformException, TypeError, ValueError):
            return None
        move, turn = found.transform.translation, found.transform.rotation
        return (move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w), found

    def _changes(self, watch: FrameWatch) -> list[Any]:
        return [found for _, _, found in watch.changed(self._lookup)]

    def _begin(self, handle: ServerGoalHandle) -> None:
        goal: Any = handle.get_goal()
        name = handle.get_goal_id().id
        watch = FrameWatch(goal.target_frame, goal.source_frames, goal.angular_thres, goal.trans_thres)

        feedback: Any = self._server.feedback_pub
        audience = Audience(GONE_S)

        def send() -> None:
            if audience.is_gone(feedback.get_num_connections()):
                self._end(name, "nobody has listened to the feedback for %g s" % GONE_S)
            elif transforms := self._changes(watch):
                handle.publish_feedback(TFSubscriptionFeedback(transforms))
        self._goals[name] = handle, send
        handle.set_accepted()
        self._schedule.add(send, period_of(goal.rate))
        if len(self._goals) > MAX_GOALS:
            self._end(list(self._goals)[0], "there are more than %d goals; this was the oldest" % MAX_GOALS)

    def _end(self, name: str, why: str) -> None:
        handle, send = self._goals.pop(name, (None, None))
        if handle is not None and send is not None:
            self._schedule.remove(send)
            handle.set_aborted(text=why)

    def _cancel(self, handle: ServerGoalHandle) -> None:
        _, send = self._goals.pop(handle.get_goal_id().id, (None, None))
        if send is not None:
            self._schedule.remove(send)
            handle.set_canceled()

    def _topic(self, request: RepublishTFsRequest) -> str:
        """A topic of its own for the request; it ends when nobody has heard it for a while."""
        name = "tf_repub_%d" % next(self._numbers)
        publisher = rospy.Publisher(name, TFArray, queue_size=10)
        watch = FrameWatch(request.target_frame, request.source_frames, request.angular_thres, request.trans_thres)
        audience = Audience(request.timeout.to_sec())

        def send() -> bool:
            listeners = publisher.get_num_connections()
            if audience.is_gone(listeners):
                publisher.unregister()
                return False
            if listeners and (transforms := self._changes(watch)):
                publisher.publish(transforms)
            return True
        self._schedule.add(send, period_of(request.rate))
        return str(publisher.resolved_name)


def main() -> None:
    limit_ports()
    end_on_signals()
    rospy.init_node("tf2_web_republisher", disable_signals=True)
    republisher = Republisher()  # noqa: F841  (it serves while it lives)
    rospy.spin()
