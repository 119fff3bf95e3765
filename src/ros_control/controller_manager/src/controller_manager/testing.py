# SPDX-License-Identifier: BSD-3-Clause
"""Controllers without ROS and without physics: topics as lists, a robot whose joints go where they are told."""
from .controller import ControllerContext
from .hardware import RobotHardware
from .interfaces import EFFORT, POSITION, VELOCITY


class FakeRos:
    """Keeps what a controller opens, by absolute name."""

    def __init__(self):
        self.publishers, self.inboxes, self.services = {}, {}, {}
        self.closed = False

    def publisher(self, topic, msg_class, latch=False):
        return self.publishers.setdefault(topic, FakePublisher())

    def mailbox(self, topic, msg_class):
        return self.inboxes.setdefault(topic, FakeInbox(newest_only=True))

    def queue(self, topic, msg_class, depth):
        return self.inboxes.setdefault(topic, FakeInbox())

    def service(self, name, srv_class, handler):
        self.services[name] = handler
        return handler

    def close(self):
        self.closed = True


class FakePublisher:
    """``messages``: all that was published."""

    has_listeners = True

    def __init__(self):
        self.messages = []

    def publish(self, message):
        self.messages.append(message)


class FakeInbox:
    """A mailbox and a queue; ``put`` a message into it. ``faults``: what was raised by who took one with ``handle``."""

    def __init__(self, newest_only=False):
        self._messages, self._newest_only = [], newest_only
        self.faults = []

    def put(self, message):
        self._messages.append(message)

    def take(self):
        messages = self.drain()
        return messages[-1] if messages else None

    def drain(self):
        messages, self._messages = self._messages, []
        return messages

    def handle(self, take):
        messages = self.drain()
        for message in messages[-1:] if self._newest_only else messages:
            self.guarded(take, message)

    def guarded(self, take, *arguments):
        try:
            take(*arguments)
        except (Exception, SystemExit) as error:
            self.faults.append(error)


class FakeLog:
    """``lines``: list of (level, text)."""

    def __init__(self):
        self.lines = []

    def info(self, text):
        self.lines.append(("info", text))

    def warn(self, text):
        self.lines.append(("warn", text))

    def error(self, text):
        self.lines.append(("error", text))

    def warn_throttle(self, period_s, text):
        self.warn(text)

    def error_throttle(self, period_s, text):
        self.error(text)

    def of(self, level):
        """The texts of one level."""
        return [text for found, text in self.lines if found == level]


def fake_context(name="controller", parameters=None, root_namespace="/robot", robot=None, log=None):
    """A :class:`ControllerContext` of ``name``; ``parameters``: the controller's own. Returns (context, FakeRos)."""
    ros = FakeRos()
    tree = {name: parameters or {}}
    return ControllerContext(name, root_namespace, tree, ros, log or FakeLog(), robot), ros


class FakeHardware(RobotHardware):
    """Joints that do what they are told, with faults to choose.

    A position command is reached after ``lag`` (0: in the same tick, towards 1: slower), never beyond ``clip`` [rad];
    ``frozen`` joints stay, whatever effort acts. A velocity command moves the joint at that velocity, an effort command
    accelerates it with 1 kg m2 or 1 kg.
    """

    def __init__(self, joint_interfaces, lag=0.0, clip=float("inf")):
        super().__init__(joint_interfaces)
        self.lag = lag
        self.clip = clip
        self.frozen = False

    def step(self, dt):
        """Let ``dt`` seconds pass."""
        before = self.position.copy()
        for interface, joints in self.interface_joints.items():
            if interface not in self.command:
                continue
            index = [self.joint_names.index(joint) for joint in joints]
            command = self.command[interface][index]
            if interface == EFFORT:
                self.effort[index] = command
            if self.frozen:
                continue
            if interface == POSITION:
                target = command.clip(-self.clip, self.clip)
                self.position[index] += (target - self.position[index]) * (1.0 - self.lag)
            elif interface == VELOCITY:
                self.position[index] += command * dt
            elif interface == EFFORT:
                self.position[index] += (self.velocity[index] + command * dt) * dt
        self.velocity[:] = (self.position - before) / dt
