# SPDX-License-Identifier: BSD-3-Clause
"""Controllers without ROS and without physics: topics as lists, a robot whose joints go where they are told."""
import collections
import copy
import io

from .controller import ControllerContext
from .hardware import RobotHardware
from .interfaces import EFFORT, POSITION, VELOCITY


class FakeRos:
    """Keeps what a controller opens, by absolute name.

    Answers as ``gazebo_ros.model_plugin.PluginContext`` does, which ``test_fake_context.py`` of gazebo_ros_control asks
    the same. ``publishers``, ``inboxes``: {topic: the first one}; ``services``: {name: handler}.
    """

    def __init__(self):
        self.publishers, self.inboxes, self.services = {}, {}, {}
        self.closed = False

    def publisher(self, topic, msg_class, latch=False):
        return self.publishers.setdefault(topic, FakePublisher())

    def mailbox(self, topic, msg_class):
        return self._subscribe(topic, FakeMailbox())

    def queue(self, topic, msg_class, depth):
        return self._subscribe(topic, FakeQueue(depth))

    def service(self, name, srv_class, handler):
        self.services[name] = handler
        return _FakeService(self.services, name)

    def close(self):
        self.closed = True
        for publisher in self.publishers.values():
            publisher.close()
        for inbox in self.inboxes.values():
            inbox.close()
        self.services.clear()

    def _subscribe(self, topic, inbox):
        """What comes in on a topic comes to all who subscribe to it."""
        if topic in self.inboxes:
            self.inboxes[topic].others.append(inbox)
        else:
            self.inboxes[topic] = inbox
        return inbox


class _FakeService:
    def __init__(self, services, name):
        self._services, self._name = services, name

    def close(self):
        self._services.pop(self._name, None)


class FakePublisher:
    """``messages``: all that was published while somebody listened, as it was then; one that cannot be sent raises."""

    def __init__(self):
        self.messages = []
        self.has_listeners = True

    def publish(self, message):
        if self.has_listeners:
            message.serialize(io.BytesIO())
            self.messages.append(copy.deepcopy(message))

    def close(self):
        self.has_listeners = False


class _FakeInbox:
    """``put`` a message into it. ``faults``: what was raised by who took one with ``handle``."""

    def __init__(self, depth):
        self.faults, self.others = [], []
        self._messages = collections.deque(maxlen=depth)

    def put(self, message):
        self._messages.append(message)
        for other in self.others:
            other.put(message)

    def handle(self, take):
        for message in self._drain():
            self.guarded(take, message)

    def guarded(self, take, *arguments):
        try:
            take(*arguments)
        except (Exception, SystemExit) as error:
            self.faults.append(error)

    def close(self):
        self._messages.clear()
        for other in self.others:
            other.close()

    def _drain(self):
        messages = list(self._messages)
        self._messages.clear()
        return messages


class FakeMailbox(_FakeInbox):
    """Of what was put into it only the newest counts."""

    def __init__(self):
        super().__init__(1)

    def take(self):
        messages = self._drain()
        return messages[0] if messages else None


class FakeQueue(_FakeInbox):
    """Loses nothing up to ``depth`` unread messages, and then the oldest."""

    def drain(self):
        return self._drain()


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

    def info_throttle(self, period_s, text):
        self.info(text)

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
