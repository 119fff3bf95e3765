# SPDX-License-Identifier: BSD-3-Clause
"""Calls to a controller manager, for scripts. Service names are relative: the caller's namespace selects the robot.

Each function returns True if the request succeeded, prints the result in one line, and raises ``rospy.ROSException``
when there is no controller manager.
"""
from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import rospy
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)

#: How long to wait for the services [wall s].
WAIT_S = 10.0


def list_controller_types() -> bool:
    """Print the types that can be loaded, one a line."""
    for kind in _call("list_controller_types", ListControllerTypes).types:
        print(kind)
    return True


def list_controllers() -> bool:
    """Print name, hardware interfaces and state of each controller."""
    controllers = _call("list_controllers", ListControllers).controller
    if not controllers:
        print("No controllers are loaded in mechanism control")
    for controller in controllers:
        interfaces = "+".join(claim.hardware_interface for claim in controller.claimed_resources)
        print("'%s' - '%s' ( %s )" % (controller.name, interfaces, controller.state))
    return True


def load_controller(name: str) -> bool:
    """Load one controller."""
    return _report(_call("load_controller", LoadController, name).ok, "Loaded", "Error when loading", name)


def unload_controller(name: str) -> bool:
    """Unload one controller that does not run."""
    return _report(_call("unload_controller", UnloadController, name).ok, "Unloaded", "Error when unloading", name)


def start_controller(name: str) -> bool:
    """Start one controller."""
    return start_controllers([name])


def start_controllers(names: Iterable[str]) -> bool:
    """Start controllers, all or none."""
    return start_stop_controllers(names, [])


def stop_controller(name: str) -> bool:
    """Stop one controller."""
    return stop_controllers([name])


def stop_controllers(names: Iterable[str]) -> bool:
    """Stop controllers, all or none."""
    return start_stop_controllers([], names)


def start_stop_controllers(start_controllers: Iterable[str], stop_controllers: Iterable[str]) -> bool:
    """Start and stop controllers in one change, all or none."""
    ok = _call("switch_controller", SwitchController, list(start_controllers), list(stop_controllers),
               SwitchControllerRequest.STRICT, False, 0.0).ok
    for names, done, failed in ((start_controllers, "Started", "Error when starting"),
                                (stop_controllers, "Stopped", "Error when stopping")):
        for name in names:
            _report(ok, done, failed, name)
    return ok


def reload_libraries(force_kill: bool, restore: bool = False) -> bool:
    """Import the controllers' source again; ``force_kill`` unloads those that are loaded, ``restore`` loads and starts
    them again."""
    before = _call("list_controllers", ListControllers).controller if restore else []
    ok = _call("reload_controller_libraries", ReloadControllerLibraries, force_kill).ok
    print("Successfully reloaded libraries" if ok else "Failed to reload libraries; are controllers loaded?")
    if ok:
        loaded = [load_controller(controller.name) for controller in before]
        ok = all(loaded)
        running = [controller.name for controller in before if controller.state == "running"]
        if running:
            ok = start_controllers(running) and ok
    return ok


def _call(name: str, srv_class: type, *arguments: Any) -> Any:
    service = "controller_manager/" + name
    rospy.wait_for_service(service, WAIT_S)
    return rospy.ServiceProxy(service, srv_class)(*arguments)


def _report(ok: bool, done: str, failed: str, name: str) -> bool:
    print("%s '%s' successfully" % (done, name) if ok else
          "%s '%s': see the log of the node that holds the controller manager" % (failed, name))
    return ok
