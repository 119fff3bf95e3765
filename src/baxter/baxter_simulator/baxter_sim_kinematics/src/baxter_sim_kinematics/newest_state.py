# SPDX-License-Identifier: BSD-3-Clause
"""The newest joint states of an arm, deserialized only on demand. Uses messages."""
from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import genpy
from sensor_msgs.msg import JointState

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from std_msgs.msg import Header

# std_msgs/Header on the wire: sequence number, then the stamp.
_STAMP = struct.Struct("<4xII")


class UnreadJointState(JointState):
    """A JointState that keeps its bytes: only a few of the messages are ever read."""

    def __init__(self) -> None:
        """Does not create the fields: nobody reads them, and creating them takes as long as all other work here."""

    @property
    def header(self) -> Header:
        """For rospy's statistics about topics, which few labs have."""
        return JointState().deserialize(self.serialized).header

    def deserialize(self, buffer: bytes) -> UnreadJointState:
        """Keep the bytes. Raises genpy.DeserializationError if they end within the header."""
        if len(buffer) < _STAMP.size:
            raise genpy.DeserializationError("joint states of %d bytes" % len(buffer))
        self.serialized = bytes(buffer)
        return self


class NewestState:
    """Takes UnreadJointStates; any thread may read the newest one with all of ``joint_names``."""

    def __init__(self, joint_names: Iterable[str], time_went_back: Callable[[], object]) -> None:
        """``time_went_back()`` is called when a state is older than the one before it."""
        # A serialized string is its length and its bytes. The fingers may come in a message of their own.
        self._needed = [struct.pack("<I", len(name)) + name for name in map(str.encode, joint_names)]
        self._time_went_back = time_went_back
        self._serialized, self._stamp = None, (0, 0)
        self._read = None, None  # the last result, and the message that it came from

    def take(self, message: UnreadJointState) -> bool:
        """Returns whether it has all of the joints, and so is the newest state now."""
        stamp = _STAMP.unpack_from(message.serialized)
        if stamp < self._stamp:
            self._time_went_back()
        counts = all(name in message.serialized for name in self._needed)
        if counts:
            self._serialized, self._stamp = message.serialized, stamp
        return counts

    def read(self) -> JointState | None:
        """Return the newest JointState, or None if there is none yet. Raises genpy.DeserializationError."""
        serialized = self._serialized
        if serialized is None:
            return None
        source, state = self._read
        if source is not serialized:  # a request with thousands of poses calls this thousands of times
            state = JointState().deserialize(serialized)
            self._read = serialized, state
        return state
