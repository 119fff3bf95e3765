# SPDX-License-Identifier: BSD-3-Clause
"""Hostile messages to every subscriber and service of the running lab. The targets come from the master.

Messages come in batches. In every other batch no message may move an arm, and the arms must stay where they are. After
each batch all nodes must run, and after some batches the arms must follow a valid command. Message k of a seed does not
depend on the messages before it.
"""
import collections
import contextlib
import random
import time
from dataclasses import dataclass

import rospy
import tcpros
from commands import WORDS, may_move
from hostile import Generator
from invariants import Usage, grown
from message_spec import spec_of
from robot import PATIENCE_WALL_S, LabError, Robot, Services

from lab import FOREIGN, class_of, cpu_s, request_class, usage
from lab_testing.waiting import wait_until

BATCH = 250
FOLLOW_EVERY = 2  # batches
LISTENERS_S, RECONNECTIONS, REGISTRATION_S = 20.0, 4, 1.0
# Time limit for the answer to a request that cannot be decoded [s].
DAMAGED_S = 2.0
TOPIC_WEIGHT, SERVICE_WEIGHT = 4, 1
# A message that may move an arm is drawn again up to this many times; after that, another target is drawn.
REDRAWS = 8
# Not fuzzed, and why.
LEFT_OUT = {
    "/clock": "is the time of all nodes: only the simulator publishes it",
    "/gazebo/advance": "waits as long as the request says; the state machine tests it",
    "/gazebo/pause_physics": "the state machine pauses; here simulation time must advance",
}
# A node's usage may grow by this much: rospy keeps a thread and a descriptor for each client.
ALLOWED = Usage(threads=30, descriptors=60, memory=150_000_000)


@dataclass(frozen=True)
class Target:
    """A topic with a subscriber, or a service. kind: "topic" or "service"; node: of the service."""

    kind: str
    name: str
    type: str
    node: str = ""


class Hub:
    """All targets of a lab: their specs and connections."""

    def __init__(self, lab):
        self._lab, self._publishers = lab, {}
        #: How often a subscriber has closed its connection; it may do so after a message that it cannot decode.
        self.cut_off = 0
        self.services = Services(lab)
        self.specs = {}
        self.targets = []

    def find(self):
        """Find targets and connect to them. Raises LabError if a subscriber does not connect."""
        self.targets = [Target("topic", *row) for row in self._lab.subscriptions() if row[0] not in LEFT_OUT]
        for name, node in self._lab.services():
            if name not in LEFT_OUT:
                self.targets.append(Target("service", name, self._type_of(name), node))
        for target in self.targets:
            if target.type not in self.specs:
                made = request_class(target.type) if target.kind == "service" else class_of(target.type)
                self.specs[target.type] = spec_of(made, class_of)
            if target.kind == "topic" and target.name not in self._publishers:
                self._publishers[target.name] = rospy.Publisher(target.name, class_of(target.type), queue_size=None)
        self._await_connections()

    def await_listeners(self):
        """Wait until every topic's subscriber is connected. If it had closed the connection to a publisher of ours, the
        publisher is replaced. Raises LabError."""
        for _ in range(RECONNECTIONS):
            deaf = self._deaf()
            if not deaf:
                return
            self.cut_off += len(deaf)
            kinds = {name: self._publishers[name].data_class for name in deaf}
            for name in deaf:
                self._publishers.pop(name).unregister()
            # rospy takes us for the publisher that it has disconnected, until the master has told it that we left;
            # there is no way to see when.
            time.sleep(REGISTRATION_S)
            for name, kind in kinds.items():
                self._publishers[name] = rospy.Publisher(name, kind, queue_size=None)
            with contextlib.suppress(LabError):
                self._await_connections()
        self._await_connections()

    def _deaf(self):
        """Our topics without a subscriber."""
        return sorted(name for name, publisher in self._publishers.items() if not publisher.get_num_connections())

    def _await_connections(self):
        def what():
            return "subscribers of %s" % ", ".join(self._deaf())

        try:
            wait_until(lambda: not self._deaf(), what, LISTENERS_S, 0.05)
        except AssertionError as error:
            raise LabError("no longer subscribed: %s" % error) from None

    def send(self, target, data, is_damaged):
        """Send the bytes of a message. Return whether it has a receiver. Raises LabError if a service does not answer
        any more.

        is_damaged: a request that cannot be decoded may stay without an answer; rospy keeps its connection open.
        """
        if target.kind == "topic":
            publisher = self._publishers[target.name]
            if not publisher.get_num_connections():
                return False
            message = rospy.AnyMsg()
            message._buff = data
            publisher.publish(message)
            return True
        try:
            self.services.call_raw(target.name, target.node, data, DAMAGED_S if is_damaged else PATIENCE_WALL_S)
        except tcpros.ConnectionLost:
            pass  # a request that cannot be decoded may end its connection, but nothing else
        except (LabError, OSError):
            if target.node not in FOREIGN and not is_damaged:
                raise
            return False
        return True

    def _type_of(self, name):
        return tcpros.service_type(self._lab.service_address(name), name)[0]


class Fuzz:
    """A run: a failure ends its batch, and the lab is restarted if it does not recover."""

    def __init__(self, lab, watch, journal, seed):
        self._lab, self._watch, self._journal, self._seed = lab, watch, journal, seed
        self._generator = Generator(WORDS)
        self.hub, self._robot = Hub(lab), Robot(watch)
        self.counts, self.foreign_deaths = collections.Counter(), 0
        self.relaunches = 0

    def run(self, first, count, until=None):
        """Send messages first .. first + count - 1, or as many as time allows. until: by time.monotonic() [s]."""
        self._begin()
        for start in range(first - first % BATCH, first + count, BATCH):
            if until is not None and time.monotonic() > until:
                break
            numbers = range(max(start, first), min(start + BATCH, first + count))
            try:
                self._batch(start // BATCH, numbers)
                problems = self._watch.take_found()
            except (LabError, AssertionError, OSError) as error:
                problems = [*self._watch.take_found(), str(error)]
            self._watch.still.disarm()
            if problems:
                self._fail(problems, numbers)
        problems = self._grown()
        if problems:
            self._journal.fail("; ".join(problems), self._seed, first, self._journal.sent)

    def _begin(self):
        self.hub.find()
        self._robot.come_to_rest()
        self._pids = self._lab.processes()
        self._usage = {}
        self._watch.take_found()

    def _batch(self, number, indices):
        is_quiet = number % 2 == 0
        self._watch.checks_limits = False
        if is_quiet:
            self._robot.come_to_rest()
            self._watch.checks_limits = True
            self._watch.stamps.settle()
            self._watch.still.arm(self._robot.positions())
        for index in indices:
            target, style, value, data = self.draw(index, is_quiet)
            if target.name.startswith("/gazebo/reset_"):
                self._watch.stamps.announce_reset()
            self._journal.note(index, target.name, style, value)
            self.counts[target.name] += self.hub.send(target, data, style == "damaged")
        self._check_alive()
        if is_quiet:
            self._robot.come_to_rest()
            self._watch.still.disarm()
        else:
            self._robot.tidy()
        if number % FOLLOW_EVERY == 0:
            self._robot.follow()
        self.hub.await_listeners()
        if number == FOLLOW_EVERY:  # warmed up: caches filled, every client connected
            self._usage = {node: usage(pid) for node, pid in self._lab.processes().items()}

    def draw(self, index, is_quiet):
        """Return (Target, style, value, bytes) of message ``index``. In batches without motion, no message may move an
        arm."""
        choose = random.Random("%d/%d" % (self._seed, index))
        targets = self.hub.targets
        weights = [TOPIC_WEIGHT if target.kind == "topic" else SERVICE_WEIGHT for target in targets]
        while True:
            target, = choose.choices(targets, weights)
            for _ in range(REDRAWS):
                style, value, data = self._generator.draw(self.hub.specs[target.type], choose.random())
                if not is_quiet or not may_move(target.name, value, style):
                    return target, style, value, data

    def _check_alive(self):
        """Raises LabError if a node has another process than before, or does not answer."""
        now = self._lab.processes()
        for node in FOREIGN:
            if now.get(node) != self._pids[node]:
                wait_until(lambda node=node: self._lab.pid(node) not in (None, self._pids[node]), node + " to be back",
                           LISTENERS_S, 0.1)
                self.foreign_deaths += 1
                self._pids[node] = now[node] = self._lab.pid(node)
        for node, pid in self._pids.items():
            if now.get(node) != pid:
                computing = "computed %.1f s in all" % cpu_s(pid)
                raise LabError("%s died or does not answer (process %d, now %s; %s)" % (
                    node, pid, now.get(node), computing))

    def _fail(self, problems, numbers):
        self._journal.fail("; ".join(problems[:5]), self._seed, numbers[0], len(numbers))
        try:
            self._check_alive()
            self._robot.tidy()
            self._robot.follow()
            self.hub.await_listeners()
        except (LabError, OSError) as error:
            self._journal.echo("the lab is restarted, because it does not recover: %s" % error)
            self.relaunches += 1
            self._watch.stamps.announce_reset()
            self._lab.relaunch()
            self.hub.services.forget()
            self._begin()
        self._watch.take_found()

    def _grown(self):
        found = []
        for node, pid in self._lab.processes().items():
            if node in self._usage and self._pids.get(node) == pid:
                found += grown(node, self._usage[node], usage(pid), ALLOWED)
        return found
