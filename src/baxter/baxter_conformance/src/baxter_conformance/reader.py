# SPDX-License-Identifier: BSD-3-Clause
"""Reads a master: its tables, a message of each topic, tf. Looks only; it calls no service and publishes nothing."""
from __future__ import annotations

import http.client
import time
import xml.etree.ElementTree as ElementTree
import xmlrpc.client
from typing import TYPE_CHECKING, Any

import rosgraph
import roslib.message
import rospy
import rosservice
from tf2_msgs.msg import TFMessage

from .comparison import SeenInterface, alternatives, may_be_silent

if TYPE_CHECKING:
    from baxter_model.interface import Interface

BATCH = 40  # topics listened to at a time: a robot's nodes get no more new connections than that at once
POLL_S = 0.02
#: Errors of :func:`read` where the master, or a node that was just asked, is gone.
NO_ANSWER = (rosgraph.MasterException, rospy.ROSException, OSError, xmlrpc.client.Error, http.client.HTTPException)


def read(robot: Interface, timeout_s: float) -> SeenInterface:
    """Return a SeenInterface. robot: the Interface of which the topics are listened to. timeout_s: how long to wait for
    them.

    Call after rospy.init_node(). Raises one of NO_ANSWER where the master does not answer.
    """
    master = rosgraph.Master(rospy.get_name())
    published, listened, services = _told(master.getSystemState())
    types = {name: kind for name, kind in _told(master.getTopicTypes()) if kind != "*"}
    own = rospy.get_name()
    seen = SeenInterface(published=_with_types(published, types, own), listened=_with_types(listened, types, own))
    for name in {name for name, _ in services} & set(robot.services):
        seen.services[name] = _service_type(name)
    for name in robot.parameters:
        if rospy.has_param(name):
            seen.parameters[name] = rospy.get_param(name)
    seen.links = _links(seen.parameters.get("/robot_description"))
    chosen = {name: robot.published[name] for name in robot.published
              if alternatives(name, seen.published) == [name] and robot.is_public(robot.published[name])
              and not may_be_silent(name)}
    seen.frames = _frames({*robot.frames, *seen.links}, timeout_s)
    seen.heard = _listen(chosen, timeout_s)
    return seen


def _told(answer: Any) -> Any:
    """An answer of the master: lists of names; rosgraph has no types."""
    return answer


def _with_types(table: Any, types, own):
    return {name: types.get(name, "") for name, nodes in table if set(nodes) - {own}}


def _service_type(name: str):
    try:
        return rosservice.get_service_type(name)
    except (rosservice.ROSServiceException, OSError):
        return None


def _links(description):
    """Names of the links of a URDF; none where it is no XML."""
    try:
        return tuple(link.get("name") for link in ElementTree.fromstring(description or "").iter("link"))
    except ElementTree.ParseError:
        return ()


def _frames(expected, timeout_s: float):
    """Names of the frames in tf; returns early when all the expected ones are there."""
    frames = set()

    def collect(message: Any) -> None:
        for transform in message.transforms:
            frames.update((transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")))

    subscribers = [rospy.Subscriber(topic, TFMessage, collect, queue_size=100) for topic in ("/tf", "/tf_static")]
    _wait(lambda: expected <= frames, timeout_s)
    for subscriber in subscribers:
        subscriber.unregister()
    return frames


def _listen(topics: dict[str, str], timeout_s: float):
    """{topic: newest message, or None}. topics: {name: type}; those of types that are not installed are left out."""
    heard = {}
    classes = {name: roslib.message.get_message_class(kind) for name, kind in topics.items()}
    names = [name for name, kind in classes.items() if kind is not None]
    for start in range(0, len(names), BATCH):
        batch = names[start:start + BATCH]
        heard.update(dict.fromkeys(batch))
        subscribers = [rospy.Subscriber(name, classes[name], lambda message, name=name: heard.update({name: message}),
                                        queue_size=1) for name in batch]
        _wait(lambda batch=batch: all(heard[name] is not None for name in batch), timeout_s)
        for subscriber in subscribers:
            subscriber.unregister()
    return heard


def _wait(condition, timeout_s: float) -> None:
    """Wait by the wall clock: simulated time may stand still."""
    deadline = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline and not rospy.is_shutdown():
        time.sleep(POLL_S)
