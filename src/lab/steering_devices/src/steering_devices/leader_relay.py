# SPDX-License-Identifier: BSD-3-Clause
"""Prints a leader's messages as lines of JSON, like rosbridge's; a separate process at the leader's master.

    python3 -m steering_devices.leader_relay SIDE...
"""
from __future__ import annotations

import json
import sys
import threading

import roslib.message
import rospy

from steering_devices.leader import topics_of


def main(sides: list[str]) -> None:
    """Relay until standard output is closed or the node ends."""
    rospy.init_node("steering_leader_relay", anonymous=True)
    lock = threading.Lock()

    def relay(topic: str, fields: tuple[str, ...], message) -> None:
        line = json.dumps({"topic": topic, "msg": {name: _plain(getattr(message, name)) for name in fields}})
        with lock:
            try:
                print(line, flush=True)
            except BrokenPipeError:
                rospy.signal_shutdown("nobody listens")

    for topic, name in topics_of(sides).items():
        kind = roslib.message.get_message_class(name)
        if kind is None:
            sys.exit("the package of %s is not there" % name)
        fields = tuple(one for one in ("name", "position", "state", "buttons") if one in kind.__slots__)
        rospy.Subscriber(topic, kind, lambda message, topic=topic, fields=fields: relay(topic, fields, message),
                         queue_size=1, tcp_nodelay=True)
    rospy.spin()


def _plain(value):
    return list(value) if isinstance(value, tuple | list) else value


if __name__ == "__main__":
    main(sys.argv[1:])
