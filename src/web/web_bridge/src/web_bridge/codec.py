# SPDX-License-Identifier: BSD-3-Clause
"""Serialized messages to objects, and objects to the forms that clients read. No ROS: classes are asked from the
caller.
"""
from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from web_bridge.errors import BridgeError, UnknownType
from web_bridge.values import CborForm, JsonForm, Reader, Writer

if TYPE_CHECKING:
    from genpy import Message, Time

    from web_bridge.feeds import Arrival


def serialized(message: Message) -> bytes:
    """The bytes of a message, as on the wire. Raises what generated code raises."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def deserialized(empty: Any, data: bytes) -> Message:
    """An empty message filled from all of these bytes. Raises BridgeError."""
    try:
        message = empty.deserialize(data)
        length = len(serialized(message))
    # Generated code on bytes from any client.
    except Exception as error:
        raise BridgeError("%d bytes are no %s: %s" % (len(data), empty._type, error)) from None
    if length != len(data):
        raise BridgeError("%d bytes are no %s: it ends after %d" % (len(data), empty._type, length))
    return message


def are_the_same(class_of: Callable[[str], type], one: str, other: str) -> bool:
    """Whether two names stand for the same messages, as rospy decides it: by the MD5 of their definitions.

    ``class_of(type name)`` returns a message class or raises UnknownType; a name that is not known here is the same as
    itself alone.
    """
    try:
        return one == other or class_of(one)._md5sum == class_of(other)._md5sum
    except UnknownType:
        return False


class Codec:
    """``class_of(type name)`` returns a message class or raises UnknownType; ``now()`` the time for headers."""

    def __init__(self, class_of: Callable[[str], type], now: Callable[[], Time]) -> None:
        self.class_of = class_of
        self.json = Writer(class_of, JsonForm())
        self.cbor = Writer(class_of, CborForm())
        self.reader = Reader(class_of, now)

    def decoded(self, arrival: Arrival) -> Message:
        """The message of an :class:`web_bridge.feeds.Arrival`. Raises BridgeError."""
        cls = self.class_of(arrival.type)
        if arrival.md5 != cls._md5sum:
            raise BridgeError("its publisher %s has another definition of %s than this machine (MD5 %s, here %s)"
                              % (arrival.publisher, arrival.type, arrival.md5, cls._md5sum))
        try:
            return cls().deserialize(arrival.data)
        # Generated code on bytes from any client.
        except Exception as error:
            raise BridgeError("%d bytes are no %s: %s" % (len(arrival.data), arrival.type, error)) from None
