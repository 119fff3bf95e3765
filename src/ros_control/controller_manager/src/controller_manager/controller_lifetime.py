# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that are loaded as long as the process that spawned them runs."""
from __future__ import annotations

import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import rosgraph
import rosparam
import rospy
import yaml
from controller_manager_msgs.srv import (
    ListControllers,
    LoadController,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)
from std_msgs.msg import Bool

from rospy_nodes.start import limit_ports
from urdf_model import bounds, read_text

# Polling period, and how long a signal may wait [wall s].
_POLL_S, _WAKE_S = 0.1, 0.5
_FAILED_LOAD_PAUSE_S = 1.0
# Longest delay of the process's end by a paused simulation, for one request and in all [wall s].
_TAKE_DOWN_S = 2.0
_END_S = 5.0


class NotThere(Exception):
    """A wait has failed; the text says what was missing and how to provide it."""


def run_until_ended(node_name: str, work: Callable[[], int | None], clean_up: Callable[[], object]) -> int:
    """Run ``work()`` in a thread until a signal or a shutdown request comes, then ``clean_up()``.

    If ``work`` returns None, the node goes on until its end. Returns the exit code, 1 if it raised. rospy would clean
    up inside the signal's handler, which interrupts the main thread anywhere, even while it holds a lock that the
    clean-up needs.
    """
    try:
        limit_ports()
        rospy.init_node(node_name, anonymous=True, disable_signals=True)
    except KeyboardInterrupt:
        return 0
    events, over = queue.SimpleQueue(), threading.Event()

    def run() -> None:
        code = 1
        try:
            code = work()
        except rospy.ROSInterruptException:
            code = 0
        except (NotThere, rospy.ROSException, rospy.ServiceException) as error:
            rospy.logerr("%s: %s", node_name, error)
        finally:
            if code is not None:
                events.put(code)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: events.put(0))

    def asked_to_shut_down() -> None:
        events.put(0)
        over.wait(_END_S)

    rospy.on_shutdown(asked_to_shut_down)
    threading.Thread(target=run, daemon=True).start()
    code = _first(events)
    cleaning = threading.Thread(target=clean_up, daemon=True)
    cleaning.start()
    # In a paused simulation nobody answers; controllers that are still loaded stay.
    cleaning.join(_END_S)
    over.set()
    rospy.signal_shutdown("done")
    return code


def _first(events: queue.SimpleQueue[int]) -> int:
    """Wait for an event of a queue.SimpleQueue. A signal that comes while this thread falls asleep does not wake it,
    and is handled when it wakes up for another reason: so it does now and then.
    """
    while True:
        try:
            return events.get(timeout=_WAKE_S)
        except queue.Empty:
            pass


class ControllerLifetime:
    """Loads and starts controllers through the services of one controller manager, and unloads them at the end."""

    def __init__(self, namespace: str = "", timeout_s: float = 0.0) -> None:
        """Wait for the controller manager below ``namespace`` (relative to the node's own), at most ``timeout_s`` wall
        seconds (0 or less: for ever). Raises :class:`NotThere`."""
        self._prefix = (namespace.rstrip("/") + "/" if namespace else "") + "controller_manager/"
        self._deadline = time.monotonic() + timeout_s if timeout_s > 0.0 else None
        self._timeout_s = timeout_s
        self._loaded: list[str] = []
        self._ending = False
        self._load = self._proxy("load_controller", LoadController)
        self._switch = self._proxy("switch_controller", SwitchController)
        self._list = self._proxy("list_controllers", ListControllers)
        self._unload = self._proxy("unload_controller", UnloadController)

    def _proxy(self, name: str, srv_class: type) -> rospy.ServiceProxy:
        service = rospy.resolve_name(self._prefix + name)
        told = False
        while True:
            try:
                rospy.wait_for_service(service, _POLL_S)
                return rospy.ServiceProxy(service, srv_class)
            except rospy.ROSException:
                pass
            if rospy.is_shutdown():
                raise rospy.ROSInterruptException()
            # Simulated time 0 means that the simulator is not up yet.
            still_starting = rospy.get_param("/use_sim_time", False) and rospy.get_rostime().is_zero()
            if self._deadline is not None and time.monotonic() > self._deadline and not still_starting:
                raise NotThere("no controller manager: service %s did not come within %g s; is the robot spawned, with "
                               "libgazebo_ros_control.so in its description and this robotNamespace?"
                               % (service, self._timeout_s))
            if not told:
                rospy.loginfo("waiting for the service %s", service)
                told = True

    @staticmethod
    def wait_for_true(topic: str) -> None:
        """Wait until the std_msgs/Bool topic ``topic`` says true."""
        rospy.loginfo("waiting for %s to say true", rospy.resolve_name(topic))
        message: Any = None
        while message is None or not message.data:
            message = rospy.wait_for_message(topic, Bool)

    @staticmethod
    def names_from(arguments: Iterable[str]) -> list[str]:
        """Names of controllers; an argument that is an existing file is loaded to the parameter server, and its keys
        are names. Raises :class:`NotThere` for a file that does not exist or has none."""
        names = []
        for argument in arguments:
            if not os.path.isfile(argument):
                if argument.endswith((".yaml", ".yml")):
                    raise NotThere("there is no file %s; give a YAML file or names of controllers" % argument)
                names.append(argument)
                continue
            try:
                content = yaml.safe_load(read_text(argument, bounds.DESCRIPTION_BYTES))
            except (OSError, ValueError, yaml.YAMLError) as error:
                raise NotThere("%s cannot be read as YAML: %s" % (argument, " ".join(str(error).split()))) from error
            if not isinstance(content, dict) or not content:
                raise NotThere("%s has no controllers: expected a mapping of names to parameters" % argument)
            rosparam.upload_params(rosgraph.names.get_ros_namespace(), content)
            names.extend(content)
        return names

    def bring_up(self, names: Sequence[str], start: bool = True) -> None:
        """Load each of ``names``; start those that could be loaded, all or none."""
        for name in names:
            if self._ending or rospy.is_shutdown():
                return
            # Added before the response: a process that ends meanwhile must unload the controller too.
            self._loaded.append(name)
            if self._asked(self._load, name):
                rospy.loginfo("loaded controller '%s'", name)
            else:
                self._loaded.remove(name)
                time.sleep(_FAILED_LOAD_PAUSE_S)
                rospy.logerr("controller '%s' could not be loaded: see the log of the node that holds the controller "
                             "manager (/gazebo) for the reason", name)
        if not start or not self._loaded or self._ending:
            return
        if self._asked(self._switch, self._loaded, [], SwitchControllerRequest.STRICT, False, 0.0):
            rospy.loginfo("started controllers: %s", ", ".join(self._loaded))
        else:
            rospy.logerr("controllers could not be started: %s; see the log of the node that holds the controller "
                         "manager (/gazebo) for the reason", ", ".join(self._loaded))

    def take_down(self) -> None:
        """Any thread: stop and unload the controllers that were brought up, the last one first. Missing ones are
        skipped."""
        self._ending = True
        names = list(self._loaded)
        if not names:
            return
        try:
            states = {controller.name: controller.state for controller in self._list().controller}
            running = [name for name in names if states.get(name) == "running"]
            if running:
                self._switch(start_controllers=[], stop_controllers=running, start_asap=False,
                             strictness=SwitchControllerRequest.STRICT, timeout=_TAKE_DOWN_S)
            for name in reversed(names):
                if name in states:
                    self._unload(name)
        except (rospy.ServiceException, rospy.ROSException):
            rospy.logdebug("the controller manager is gone; nothing to take down")

    @staticmethod
    def _asked(proxy: Any, *arguments: Any) -> bool:
        try:
            return proxy(*arguments).ok
        except rospy.ServiceException as error:
            rospy.logerr("%s: %s", proxy.resolved_name, error)
            return False


def loaded_controllers() -> dict[str, str]:
    """{name: state} of the controllers of this namespace's controller manager."""
    listing = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)()
    return {controller.name: controller.state for controller in listing.controller}
