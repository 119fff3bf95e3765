# SPDX-License-Identifier: BSD-3-Clause
"""An action server for ``traj`` that knows its clients: their version of the action, and whether they still run."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import rospy
from actionlib.action_server import ActionServer
from actionlib.status_tracker import StatusTracker
from actionlib_msgs.msg import GoalID, GoalStatus
from std_msgs.msg import Header

from baxter_interface.goal_loop import can_be_answered

from . import versions

if TYPE_CHECKING:
    from baxter_traj_streamer.versions import Version

# Size of a Header on the wire without its frame_id [bytes]: seq, stamp, length.
_HEADER_SIZE = 16


class TrajServer(ActionServer):
    """The action server of one ``versions.Version``; a client of the other version gets a log line on both
    sides."""

    def __init__(self, name: str, version: Version, goal_callback: Callable[..., Any],
                 cancel_callback: Callable[..., Any]) -> None:
        super().__init__(name, version.action, goal_callback, cancel_callback, auto_start=False)
        self._version = version
        # Accepts goals of another version, so that they can be rejected with a reason; tools still see the served type.
        self.ActionGoal = type("GoalOfAnyVersion", (rospy.AnyMsg,), {
            "__slots__": [], "_type": version.action_goal._type})
        self._told = set()

    def has_client(self, handle: Any) -> bool:
        """Whether the program that sent the goal is still connected."""
        caller = handle.goal._connection_header["callerid"]
        return any(connection.callerid_pub == caller for connection in self._connections())

    def internal_goal_callback(self, message: Any) -> None:
        """Receives goals as bytes."""
        header = message._connection_header
        if header["md5sum"] == self._version.md5sum:
            goal = self._version.action_goal()
            goal.deserialize(message._buff)
            goal._connection_header = header
            if can_be_answered(goal.goal_id):
                super().internal_goal_callback(goal)
            return
        # In every version a goal begins with these two, and goal states are the same.
        start = _HEADER_SIZE + len(Header().deserialize(message._buff).frame_id.encode())
        goal_id = GoalID().deserialize(message._buff[start:])
        if not can_be_answered(goal_id):
            return
        tracker = StatusTracker(goal=self._version.action_goal(goal_id=goal_id))
        tracker.status.status = GoalStatus.REJECTED
        self._told.add(header["callerid"])
        tracker.status.text = self._wrong_version(header["callerid"], header["type"], header["md5sum"])
        tracker.handle_destruction_time = rospy.Time.now()
        rospy.logerr("goal refused: %s", tracker.status.text)
        with self.lock:
            self.status_list.append(tracker)
            self.publish_status()

    def publish_status(self) -> None:
        """Called a few times a second: a client of another version may never get to send a goal."""
        super().publish_status()
        for connection in self._connections():
            caller, version = connection.callerid_pub, connection.md5sum
            if version and version != self._version.md5sum and caller not in self._told:
                self._told.add(caller)
                rospy.logerr(self._wrong_version(caller, connection.type, version))

    def _wrong_version(self, caller: str, kind: str, md5sum: str) -> str:
        own, other = self._version, versions.of_goal(md5sum)
        what_now = ("start the server with --action %s" % other.name if other is not None
                    else "use %s in the program" % own.name)
        return "%s speaks another version of the action (%s, md5sum %s) than this server (%s, md5sum %s): %s" % (
            caller, kind, md5sum, own.name, own.md5sum, what_now)

    def _connections(self):
        # Only rospy's implementation knows the node at the other end.
        return list(self.goal_sub.impl.connections) if self.goal_sub and self.goal_sub.impl else []
