# SPDX-License-Identifier: BSD-3-Clause
"""rviz's part of interactive markers: markers are dragged, entries of their menus chosen."""
import threading

import rospy
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit, InteractiveMarkerUpdate

from lab_testing.waiting import wait_until


class MarkerClient:
    """Sends what rviz sends, and knows the markers as rviz does: full at first, then changes.

    topic: namespace of the server's topics. markers: {name: InteractiveMarker}. Raises AssertionError after
    timeout_s without a server.
    """

    def __init__(self, topic, timeout_s):
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self.markers = {}
        self._feedback = rospy.Publisher(topic + "/feedback", InteractiveMarkerFeedback, queue_size=20)
        self._subscribers = [rospy.Subscriber(topic + "/update_full", InteractiveMarkerInit, self._on_full),
                             rospy.Subscriber(topic + "/update", InteractiveMarkerUpdate, self._on_update)]
        wait_until(self._feedback.get_num_connections, "the server of %s" % topic, timeout_s)

    def _on_full(self, message):
        with self._lock:
            self.markers.update({marker.name: marker for marker in message.markers})

    def _on_update(self, message):
        with self._lock:
            self.markers.update({marker.name: marker for marker in message.markers})
            for one in message.poses:
                self.markers[one.name].pose = one.pose
            for name in message.erases:
                self.markers.pop(name, None)

    def drag(self, pose, name, steps=3):
        """Drag a marker to a pose in its frame, and release it."""
        kinds = InteractiveMarkerFeedback
        for step in range(steps + 1):
            self._send(name, kinds.POSE_UPDATE if step < steps else kinds.MOUSE_UP, control_name="ball", pose=pose)

    def titles(self, name):
        """The titles of a marker's menu."""
        return [entry.title for entry in self.markers[name].menu_entries]

    def choose(self, *titles, name):
        """Click an entry of a marker's menu, by the titles on the way there; wait until it is there."""
        def find():
            marker, parent = self.markers.get(name), 0
            for title in titles if marker is not None else ():
                found = [entry for entry in marker.menu_entries if entry.parent_id == parent
                         and entry.title.replace("[x] ", "").replace("[  ] ", "") == title]
                if not found:
                    return None
                parent = found[0].id
            return parent

        number = wait_until(find, "the menu's entry %s" % " / ".join(titles), self._timeout_s)
        self._send(name, InteractiveMarkerFeedback.MENU_SELECT, menu_entry_id=number)

    def _send(self, name, event, **fields):
        message = InteractiveMarkerFeedback(client_id="/rviz/Goals", marker_name=name, event_type=event, **fields)
        message.header.frame_id = self.markers[name].header.frame_id
        self._feedback.publish(message)
