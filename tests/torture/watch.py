# SPDX-License-Identifier: BSD-3-Clause
"""Reads the messages of the lab's nodes on its own connections, and checks the invariants."""
import collections
import contextlib
import math
import random
import selectors
import struct
import threading
import time
import traceback

import genpy
import tcpros
from invariants import JointLimits, Stamps, Still, not_finite

from baxter_model import SIDES
from lab import class_of, subscribe

STATES, STATE = "/robot/joint_states", "/robot/state"
CORE = {"/clock", STATES, STATE, "/robot/limb/left/endpoint_state", "/robot/limb/right/endpoint_state",
        "/robot/end_effector/left_gripper/state", "/robot/end_effector/right_gripper/state"}
# These topics repeat the test's own input: states as transforms, refused requests with the reason.
ECHOES = {("/tf", "/robot_state_publisher")} | {
    ("/ExternalTools/%s/PositionKinematicsNode/IKReport" % side, "/baxter_sim_kinematics") for side in SIDES}
# Pictures and clouds are only read as bytes; the renderer has the cost.
BULKY = ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2")
SAMPLE = 15
LOOK_S = 1.0
_LENGTH = struct.Struct("<I")


class _Reader:
    """One connection: splits the stream into messages."""

    def __init__(self, connection, topic, node, message_type):
        connection.setblocking(False)
        self.connection, self.topic, self.node, self.type = connection, topic, node, message_type
        self.message_class = class_of(message_type)
        self._held = bytearray()

    def messages(self):
        """The bytes of the complete messages. Raises ConnectionError if the connection has ended."""
        with contextlib.suppress(BlockingIOError):
            more = self.connection.recv(1 << 18)
            if not more:
                raise ConnectionError("closed")
            self._held += more
        found = []
        while len(self._held) >= 4 and len(self._held) >= 4 + _LENGTH.unpack_from(self._held)[0]:
            end = 4 + _LENGTH.unpack_from(self._held)[0]
            found.append(bytes(self._held[4:end]))
            del self._held[:end]
        return found


class Watch(threading.Thread):
    """Subscribes to the topics of CORE all the time and to a changing sample of the others. Context manager.

    Attributes: ``found``, texts of faults; ``counts``, messages read per topic; ``latest``, {topic: last message};
    ``stamps``, ``still``: checks, configured by the test.
    """

    def __init__(self, lab, limits, tolerance, seed=0):
        """limits: as in JointLimits; tolerance: as in Still."""
        super().__init__(name="watch", daemon=True)
        self._lab, self._limits, self._choose = lab, JointLimits(limits), random.Random(seed)
        self.found, self.counts, self.latest = [], collections.Counter(), {}
        self.stamps, self.still = Stamps(), Still(tolerance)
        #: False while a test changes the world by force, including the robot's links.
        self.checks_limits = True
        self.simulated_s = 0.0
        self.watched_topics = set()
        self._selector, self._readers = selectors.DefaultSelector(), {}
        self._ending, self._sampled_at, self._sample = threading.Event(), -math.inf, []

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self._ending.set()
        self.join()

    def take_found(self):
        """Return the faults found since the last call."""
        found, self.found = self.found, []
        return found

    def run(self):
        try:
            self._follow()
        except Exception:
            self.found.append("the watch itself ended: " + traceback.format_exc())
            raise

    def _follow(self):
        looked_at = 0.0
        while not self._ending.is_set():
            if time.monotonic() - looked_at > LOOK_S:
                self._connect()
                looked_at = time.monotonic()
            if not self._readers:
                self._ending.wait(0.05)
                continue
            for key, _ in self._selector.select(0.1):
                self._read(key.data)
        for reader in list(self._readers.values()):
            self._drop(reader)

    def _connect(self):
        """Connect to topics without a connection, and from time to time to another sample."""
        try:
            published = [row for row in self._lab.publications()
                         if row[1] not in BULKY and (row[0], row[2]) not in ECHOES]
        except OSError:
            return
        wanted = {(topic, node): kind for topic, kind, node in published if topic in CORE}
        others = [row for row in published if row[0] not in CORE]
        if time.monotonic() - self._sampled_at > 5.0:
            self._sampled_at = time.monotonic()
            self._sample = self._choose.sample(others, min(SAMPLE, len(others)))
        wanted.update({(topic, node): kind for topic, kind, node in self._sample if (topic, kind, node) in others})
        for key in set(self._readers) - set(wanted):
            self._drop(self._readers[key])
        for (topic, node), kind in wanted.items():
            if (topic, node) in self._readers:
                continue
            with contextlib.suppress(OSError, tcpros.ConnectionLost, KeyError):  # `connect` tries again
                reader = _Reader(subscribe(self._lab, topic, kind, node), topic, node, kind)
                self._readers[topic, node] = reader
                self._selector.register(reader.connection, selectors.EVENT_READ, reader)

    def _drop(self, reader):
        self._selector.unregister(reader.connection)
        reader.connection.close()
        del self._readers[reader.topic, reader.node]

    def _read(self, reader):
        try:
            messages = reader.messages()
        except OSError:
            self._drop(reader)
            return
        for data in messages:
            message = reader.message_class()
            try:
                message.deserialize(data)
            except genpy.DeserializationError as error:
                self.found.append("%s of %s cannot be read: %s" % (reader.topic, reader.node, error))
                continue
            self.check(reader.topic, reader.type, message)

    def check(self, topic, message_type, message):
        """Check one message against all expectations."""
        self.counts[topic] += 1
        self.watched_topics.add(topic)
        self.found += not_finite(topic, message_type, message)
        if topic == "/clock":
            now, last = message.clock.to_sec(), self.latest.get(topic)
            if last is not None and 0.0 < now - last.clock.to_sec() < 10.0:
                self.simulated_s += now - last.clock.to_sec()
            self.found += self.stamps.check(topic, now)
        elif topic == STATES:
            self.found += self.stamps.check(topic, message.header.stamp.to_sec())
            if self.checks_limits:
                self.found += self._limits.check(message.name, message.position)
            self.found += self.still.check(message.name, message.position)
        self.latest[topic] = message
