# SPDX-License-Identifier: BSD-3-Clause
"""Finds controller managers in the ROS graph, and filters controllers by their properties."""
from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import rosgraph
import rospy
import rosservice

from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources
from controller_manager_msgs.srv import ListControllers

_TYPES = {
    "list_controllers": "ListControllers",
    "list_controller_types": "ListControllerTypes",
    "load_controller": "LoadController",
    "unload_controller": "UnloadController",
    "switch_controller": "SwitchController",
    "reload_controller_libraries": "ReloadControllerLibraries",
}


def is_controller_manager(namespace: str) -> bool:
    """Whether ``namespace`` has all services of a controller manager, of the right types, e.g.
    ``"/robot/controller_manager"``."""
    try:
        return all(rosservice.get_service_type("%s/%s" % (namespace.rstrip("/"), name))
                   == "controller_manager_msgs/" + srv_type for name, srv_type in _TYPES.items())
    except rosservice.ROSServiceIOException:
        return False


def get_controller_managers(namespace: str = "/", initial_guess: Iterable[str] | None = None) -> list[str]:
    """Sorted list of the controller managers below ``namespace``. Entries of ``initial_guess``, an earlier result, that
    are still advertised are not checked again."""
    below = rosgraph.names.canonicalize_name(namespace).rstrip("/") + "/"
    services = {name for name, _ in _system_state(rosgraph.Master(rospy.get_name()))[2]}
    marker = "/list_controllers"
    candidates = sorted(name[:-len(marker)] for name in services if name.endswith(marker) and name.startswith(below))
    candidates = [found for found in candidates if all("%s/%s" % (found, name) in services for name in _TYPES)]
    return [found for found in candidates if found in (initial_guess or ()) or is_controller_manager(found)]


class ControllerManagerLister:
    """Call it for the controller managers below a namespace; it remembers what it has found before."""

    def __init__(self, namespace: str = "/") -> None:
        self._namespace = namespace
        self._found = []

    def __call__(self) -> list[str]:
        self._found = get_controller_managers(self._namespace, self._found)
        return self._found


class ControllerLister:
    """Call it for the list of ``ControllerState`` of the controller manager in a namespace."""

    def __init__(self, namespace: str = "/controller_manager") -> None:
        self._list = rospy.ServiceProxy(namespace.rstrip("/") + "/list_controllers", ListControllers)

    def __call__(self) -> list[ControllerState]:
        return self._list().controller


def filter_by_name(ctrl_list: Iterable[ControllerState], ctrl_name: str,
                   match_substring: bool = False) -> list[ControllerState]:
    """The controllers of that name, or with that text in their name."""
    return _filtered(ctrl_list, "name", ctrl_name, match_substring)


def filter_by_type(ctrl_list: Iterable[ControllerState], ctrl_type: str,
                   match_substring: bool = False) -> list[ControllerState]:
    """The controllers of that type, or with that text in their type."""
    return _filtered(ctrl_list, "type", ctrl_type, match_substring)


def filter_by_state(ctrl_list: Iterable[ControllerState], ctrl_state: str,
                    match_substring: bool = False) -> list[ControllerState]:
    """The controllers in that state."""
    return _filtered(ctrl_list, "state", ctrl_state, match_substring)


def filter_by_hardware_interface(ctrl_list: Iterable[ControllerState], hardware_interface: str,
                                 match_substring: bool = False) -> list[ControllerState]:
    """The controllers that use that hardware interface, e.g. "hardware_interface::PositionJointInterface"."""
    return [controller for controller in ctrl_list
            if any(_matches(claim.hardware_interface, hardware_interface, match_substring)
                   for claim in _claims(controller))]


def filter_by_resources(ctrl_list: Iterable[ControllerState], resources: Iterable[str],
                        hardware_interface: str | None = None, match_any: bool = False) -> list[ControllerState]:
    """The controllers that claim all of ``resources`` (with ``match_any``: one of them), through that hardware
    interface if one is given."""
    wanted = set(resources)
    found = []
    for controller in ctrl_list:
        claimed = {name for claim in _claims(controller)
                   if hardware_interface in (None, claim.hardware_interface) for name in claim.resources}
        if (wanted & claimed) if match_any else (wanted <= claimed):
            found.append(controller)
    return found


def get_rosparam_controller_names(namespace: str = "/") -> list[str]:
    """Names on the parameter server below ``namespace`` that have a ``type``, as controllers do."""
    try:
        # Read from the master itself: rospy answers "/" from a cache that may be nearly empty.
        tree = rosgraph.Master(rospy.get_name()).getParam(rospy.resolve_name(namespace))
    except rosgraph.MasterError:
        return []
    if not isinstance(tree, dict):
        return []
    return [name for name, value in tree.items() if isinstance(value, dict) and isinstance(value.get("type"), str)]


def _system_state(master: Any) -> list[list[tuple[str, list[str]]]]:
    """Publishers, subscribers and providers of services: (name, nodes) each. rosgraph has no types."""
    return master.getSystemState()


def _claims(controller: Any) -> list[HardwareInterfaceResources]:
    """Generated messages have no types: to the checker, a list in one may be None."""
    return controller.claimed_resources


def _filtered(controllers, field, wanted, match_substring):
    return [controller for controller in controllers if _matches(getattr(controller, field), wanted, match_substring)]


def _matches(text, wanted, match_substring):
    return wanted in text if match_substring else text == wanted
