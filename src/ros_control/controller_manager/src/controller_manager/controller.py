# SPDX-License-Identifier: BSD-3-Clause
"""The base class of controllers, and their context. ROS-free; see docs/write_a_controller.md for a full example."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from controller_manager.hardware import RobotHardware
from loop_ros.protocol import Log, Publisher, Service, Subscription

from .errors import ControllerError


class Controller:
    """Base class of all controllers.

    Everything runs in the thread of the control loop, so nothing here may wait. Times are control time (simulation
    time) [s], ``dt`` is the time since the update before [s]. The order of calls is: the constructor at load,
    ``starting``, any number of ``update``, ``stopping``, perhaps ``starting`` again, ``close`` at unload.
    """

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        """Read the parameters, claim the joints, open the topics. Raise :class:`ControllerError` to refuse.

        ``hardware``: :class:`controller_manager.hardware.RobotHardware`; ``context``: :class:`ControllerContext`.
        """
        self.name = name
        self.hardware = hardware
        self.context = context
        self.log = context.log
        #: {hardware interface: list of joints that no other controller may command while this one runs}
        self.claims: dict[str, list[str]] = {}

    def claim(self, interface: str, joints: Iterable[str]) -> npt.NDArray[np.int_]:
        """Declare that the controller commands ``joints`` (names) through ``interface`` (see :mod:`.interfaces`).

        Returns the joints' indices, an int array (k,), for the arrays of the hardware. Raises :class:`ControllerError`
        for a joint that the hardware does not offer through this interface.
        """
        index = self.hardware.index(interface, joints, self.context.namespace)
        claimed = self.claims.setdefault(interface, [])
        claimed.extend(joint for joint in joints if joint not in claimed)
        return index

    def observe(self, interface: str) -> None:
        """Declare that the controller reads through ``interface``; this does not claim the joints."""
        self.claims.setdefault(interface, [])

    def starting(self, time_s: float) -> None:
        """The controller begins to run; its first ``update`` is one tick later."""

    def update(self, time_s: float, dt: float) -> None:
        """One tick: read ``hardware.position[index]`` ..., write ``hardware.command[interface][index]``."""
        raise NotImplementedError

    def idle(self, time_s: float) -> None:
        """One tick while the controller is loaded but not running: answer requests, command nothing.

        Called at every tick instead of ``update``, e.g. to reject the goals of an action.
        """

    def stopping(self, time_s: float) -> None:
        """The controller stops running; the hardware keeps its last command."""

    def close(self) -> None:
        """Called when the controller is unloaded, before the topics and services of its context are closed."""


class ControllerContext:
    """A controller's place in the ROS graph: its parameters, topics, services and log.

    Relative names live in the controller's namespace ``<root namespace>/<controller name>``; for a topic of the robot
    as a whole use ``context.in_root("joint_states")``.

    Attributes: ``namespace``, ``root_namespace`` (absolute, "" for the root), ``robot`` (``urdf_model.Robot`` of
    ``robot_description``, or None), ``log`` (``info``, ``warn``, ``error``, ``*_throttle(period_s, text)``).
    """

    def __init__(self, name: str, root_namespace: str, parameters: Any, ros: Any, log: Log, robot: Any = None) -> None:
        """``parameters``: the tree below ``root_namespace``; ``ros``: makes topics and services from absolute names
        (``loop_ros.protocol.Topics``); ``log``: ``loop_ros.protocol.Log``."""
        self.root_namespace = root_namespace
        self.namespace = "%s/%s" % (root_namespace, name)
        self.robot = robot
        self.log = log
        self._parameters = parameters if isinstance(parameters, dict) else {}
        self._name = name
        self._ros = ros

    # -- names --------------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        """Absolute name of ``name``, which is relative to the controller's namespace."""
        return name if name.startswith("/") else "%s/%s" % (self.namespace, name)

    def in_root(self, name: str) -> str:
        """Absolute name of ``name``, which is relative to the robot's namespace."""
        return name if name.startswith("/") else "%s/%s" % (self.root_namespace, name)

    # -- parameters, as they were when the controller was loaded ---------------------------------------------------

    def param(self, name: str, default: Any = None) -> Any:
        """Value of a parameter in the controller's namespace (``"a/b"`` looks into mappings), or ``default``."""
        return _look_up(self._parameters, "%s/%s" % (self._name, name), default)

    def root_param(self, name: str, default: Any = None) -> Any:
        """Value of a parameter in the robot's namespace, or ``default``."""
        return _look_up(self._parameters, name, default)

    def entry(self, name: str) -> tuple[Any, str]:
        """(value or None, absolute name) of a parameter in the controller's namespace."""
        return self.param(name), self.resolve(name)

    def required(self, name: str, expected: str) -> Any:
        """Value of a required parameter; ``expected`` describes a valid value for the error text."""
        value = self.param(name)
        if value is None:
            raise ControllerError("parameter %s is missing; give %s" % (self.resolve(name), expected))
        return value

    def text(self, name: str, expected: str) -> str:
        """A required parameter that is a non-empty text."""
        value = self.required(name, expected)
        if not isinstance(value, str) or not value:
            raise ControllerError("parameter %s is %r, expected %s" % (self.resolve(name), value, expected))
        return value

    def texts(self, name: str, expected: str) -> list[str]:
        """A required parameter that is a list of texts without repetition, at least one."""
        value = self.required(name, expected)
        if not isinstance(value, list) or not value or not all(isinstance(entry, str) and entry for entry in value):
            raise ControllerError("parameter %s is %r, expected %s" % (self.resolve(name), value, expected))
        if len(set(value)) != len(value):
            raise ControllerError("parameter %s is %r; each entry may stand there only once"
                                  % (self.resolve(name), value))
        return value

    def number(self, name: str, default: float | None = None, expected: str = "a number") -> float:
        """A parameter that is a finite number, as float; required when there is no default."""
        value = self.required(name, expected) if default is None else self.param(name, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ControllerError("parameter %s is %r, expected %s" % (self.resolve(name), value, expected))
        return float(value)

    def flag(self, name: str, default: bool) -> bool:
        """A parameter that is true or false."""
        value = self.param(name, default)
        if not isinstance(value, bool):
            raise ControllerError("parameter %s is %r, expected true or false" % (self.resolve(name), value))
        return value

    # -- topics and services ------------------------------------------------------------------------------------

    def publisher(self, topic: str, msg_class: type, latch: bool = False) -> Publisher:
        """A publisher for the loop: ``has_listeners`` and ``publish(message)``; never waits."""
        return self._ros.publisher(self.resolve(topic), msg_class, latch=latch)

    def subscription(self, topic: str, msg_class: type, depth: int = 1) -> Subscription:
        """A subscription, which keeps the newest ``depth`` unread messages.

        ``handle(function)`` calls ``function(message)`` for each of them, oldest first, and drops and counts a message
        for which it raises; ``guarded(function, ...)``: one such call. Unguarded: ``drain()`` -> list of them;
        ``take()`` -> the newest or None.
        """
        return self._ros.subscription(self.resolve(topic), msg_class, depth)

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """Advertise a service; ``handler(request)`` runs in the loop thread between two ticks."""
        return self._ros.service(self.resolve(name), srv_class, handler)

    def close(self) -> None:
        """Close all topics and services of this context."""
        self._ros.close()


def _look_up(tree: Any, name: str, default: Any) -> Any:
    for part in name.strip("/").split("/"):
        if not isinstance(tree, dict) or part not in tree:
            return default
        tree = tree[part]
    return tree
