# SPDX-License-Identifier: BSD-3-Clause
"""From topics to a recording: one subscriber for each topic, for all its plotted fields."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import roslib.message
import rospy

from . import fields

if TYPE_CHECKING:
    from live_plot.recording import PlotRecording


def fields_of(type_name: str) -> dict[str, str]:
    """Return {field: type} of an installed message type."""
    message_class = _message_class(type_name)
    return dict(zip(message_class.__slots__, message_class._slot_types, strict=True))


def _message_class(type_name: str) -> type:
    message_class = roslib.message.get_message_class(type_name)
    if message_class is None:
        raise fields.PlotError("messages of type %s are not built in this workspace" % type_name)
    return message_class


def topic_types() -> dict[str, str]:
    """Return {topic: type} of all topics with a publisher or subscriber of known type."""
    # '*' is a subscriber to any type, rostopic echo for example.
    return {name: kind for name, kind in rospy.get_master().getTopicTypes()[2] if kind != "*"}


class Subscriptions:
    """Opens and closes subscriptions of plotted topics.

    on_problem(text): called from another thread, once for each problem, if a message lacks the number.
    """

    def __init__(self, recording: PlotRecording, on_problem: Callable[[str], None]) -> None:
        self._recording = recording
        self._on_problem = on_problem
        self._lock = threading.Lock()
        self._curves = {}  # topic -> its curves; replaced, never changed, since callbacks read it
        self._subscribers = {}
        self._problems = set()

    def open(self, path: str, types: dict[str, str]) -> list[str]:
        """Subscribe to the topic of a path from fields.expand; return its labels. types: as from topic_types().

        Raises PlotError, and UnknownTopic if the topic is not there yet.
        """
        topic, tokens = fields.split(path, types)
        message_class = _message_class(types[topic])
        added = fields.curves(topic, tokens, types[topic], fields_of)
        with self._lock:
            known = self._curves.get(topic, ())
            self._curves[topic] = (*known, *(curve for curve in added if curve not in known))
            for curve in added:
                self._recording.add(curve.label)
            if topic not in self._subscribers:
                self._subscribers[topic] = rospy.Subscriber(topic, message_class, self._on_message, topic)
        return [curve.label for curve in added]

    def close(self, label: str) -> None:
        """Remove a curve; does nothing if it is not plotted."""
        with self._lock:
            for topic, known in list(self._curves.items()):
                self._curves[topic] = tuple(curve for curve in known if curve.label != label)
                if not self._curves[topic]:
                    del self._curves[topic]
                    self._subscribers.pop(topic).unregister()
        self._recording.remove(label)

    def _on_message(self, message: Any, topic: str) -> None:
        stamp = message.header.stamp if message._has_header else None
        time_s = (stamp or rospy.get_rostime()).to_sec()  # a stamp of zero is none
        for curve in self._curves.get(topic, ()):
            try:
                self._recording.append(curve.label, time_s, curve.value(message))
            except fields.PlotError as error:
                if str(error) not in self._problems:
                    self._problems.add(str(error))
                    self._on_problem(str(error))
