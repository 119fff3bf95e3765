# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that controller managers list, in the place of a controller_list."""
from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, cast

import rosgraph
import rospy
from controller_manager_msgs.srv import ListControllers

from moveit_ros_move_group.controllers import FOLLOW, GRIPPER, ControllerEntry, NoControllers

if TYPE_CHECKING:
    from controller_manager_msgs.msg import ControllerState

# Value of ~moveit_controller_manager: whether all controller managers count, or the one in ~ros_control_namespace.
PLUGINS = {"moveit_ros_control_interface::MoveItControllerManager": False,
           "moveit_ros_control_interface::MoveItMultiControllerManager": True}
#: Wall time that controller managers have for an answer [s]; those of a simulator answer in its loop.
ANSWER_S = 5.0
_SERVICE = "controller_manager/list_controllers"
# Class name in a controller's type: how it is spoken to, and its action.
_KINDS = {"JointTrajectoryController": (FOLLOW, "follow_joint_trajectory"),
          "GripperActionController": (GRIPPER, "gripper_cmd")}


def running(namespace: str, states: Iterable[ControllerState]) -> list[ControllerEntry]:
    """Return the Controllers of those controller_manager_msgs/ControllerState that run and serve a known action.

    namespace: that of their controller manager, with a slash at its end.
    """
    found = []
    for state in states:
        kind, action = _KINDS.get(state.type.rpartition("/")[2], (None, None))
        if kind is None or state.state != "running":
            continue
        joints = tuple(joint for claim in state.claimed_resources for joint in claim.resources)
        name = namespace + state.name
        found.append(ControllerEntry(name, kind, joints, "%s/%s" % (name, action)))
    return found


class RosControl:
    """Asks controller managers each time for what they have: controllers come and go."""

    def __init__(self, namespace: str | None, listed: Iterable[ControllerEntry] = (),
                 list_controllers: Callable[[str], Sequence[ControllerState]] | None = None,
                 service_names: Callable[[], Sequence[str]] | None = None,
                 warn: Callable[..., object] = rospy.logwarn, answer_s: float = ANSWER_S) -> None:
        """namespace: of one controller manager, or None for all; listed: Controllers of the controller_list, taken
        where no manager has one of that action. list_controllers(service): states; service_names(): those of
        the master; warn(format, *values): for managers that do not answer beside others that do."""
        self._namespace, self._listed = namespace, list(listed)
        self._list_controllers = list_controllers or _list_controllers
        self._service_names = service_names or _service_names
        self._warn, self._answer_s = warn, answer_s

    def __call__(self) -> list[ControllerEntry]:
        """Return the present Controllers; raise NoControllers, which names the services, if no manager answers."""
        services = self._services()
        answers, failures = self._ask(services)
        silent = "; ".join("service %s: %s" % (service, failures.get(service, "no answer within %g s" % self._answer_s))
                           for service in services if service not in answers)
        if silent and not answers:
            raise NoControllers("the controllers are not known: " + silent)
        if silent:
            self._warn("controllers of these managers are left out: %s", silent)
        found = [controller for service in services
                 for controller in running(service[:-len(_SERVICE)], answers.get(service, ()))]
        actions = {controller.action for controller in found}
        return found + [controller for controller in self._listed if _absolute(controller.action) not in actions]

    def _services(self) -> list[str]:
        if self._namespace is not None:
            return [_absolute(self._namespace.rstrip("/") + "/" + _SERVICE)]
        return sorted(name for name in self._service_names() if name.endswith("/" + _SERVICE))

    def _ask(self, services: Sequence[str]) -> tuple[dict[str, Sequence[ControllerState]], dict[str, Exception]]:
        """({service: states}, {service: why it failed}); a service that does not answer in time is in neither."""
        answers, failures = {}, {}

        def ask(service: str) -> None:
            try:
                answers[service] = self._list_controllers(service)
            except (rospy.ServiceException, rospy.ROSException, OSError) as error:
                failures[service] = error

        # rospy waits without a limit for a process that is stopped.
        threads = [threading.Thread(target=ask, args=(service,), daemon=True) for service in services]
        for thread in threads:
            thread.start()
        end = time.monotonic() + self._answer_s
        for thread in threads:
            thread.join(max(0.0, end - time.monotonic()))
        # A thread that is still there may answer while the caller reads.
        return dict(answers), dict(failures)


def _absolute(name: str) -> str:
    return name if name.startswith("/") else "/" + name


def _list_controllers(service: str) -> Sequence[ControllerState]:
    return rospy.ServiceProxy(service, ListControllers)().controller


def _service_names() -> list[str]:
    state = rosgraph.Master(rospy.get_name()).getSystemState()
    # rosgraph has no types.
    return [name for name, _ in cast("tuple[object, object, list[tuple[str, list[str]]]]", state)[2]]
