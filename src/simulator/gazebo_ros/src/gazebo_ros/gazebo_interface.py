# SPDX-License-Identifier: BSD-3-Clause
"""Calls to a simulator's services, for scripts. Every wait has a deadline in wall time and names what it waits for."""
from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

import rosgraph
import rospy
from gazebo_msgs.srv import DeleteModel, GetWorldProperties, SetModelConfiguration, SpawnModel
from std_srvs.srv import Empty

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from geometry_msgs.msg import Pose

#: How long to wait for the simulator, a parameter or a model [s, wall time].
WAIT_S = 60.0
_SAY_AFTER_S = 2.0
_POLL_S = 0.05


class GazeboInterfaceError(Exception):
    """The simulator did not do what was asked; the text says what was expected and what was found."""


def wait_until(condition: Callable[[], Any], what: str, timeout_s: float = WAIT_S) -> Any:
    """Poll ``condition()`` until it returns something true, and return that.

    After a moment says on the terminal that it waits for ``what``; raises :class:`GazeboInterfaceError` at the end of
    ``timeout_s`` [s, wall time].
    """
    start = time.monotonic()
    said = False
    while True:
        found = condition()
        if found:
            return found
        waited = time.monotonic() - start
        if rospy.is_shutdown():
            raise GazeboInterfaceError("interrupted while waiting for %s" % what)
        if waited > timeout_s:
            raise GazeboInterfaceError("gave up after %.0f s waiting for %s" % (waited, what))
        if waited > _SAY_AFTER_S and not said:
            said = True
            print("waiting for %s ..." % what, file=sys.stderr)
        time.sleep(_POLL_S)


def call(service: str, srv_class: type, *arguments: Any, timeout_s: float = WAIT_S) -> Any:
    """Wait for a service, call it with ``arguments``, return the response."""
    name = rospy.resolve_name(service)

    def is_there():
        try:
            return rosgraph.Master(rospy.get_name()).lookupService(name)
        except rosgraph.MasterError:
            return None

    wait_until(is_there, "the service %s (is the simulator running?)" % name, timeout_s)
    try:
        return rospy.ServiceProxy(name, srv_class)(*arguments)
    except rospy.ServiceException as error:
        raise GazeboInterfaceError("%s failed: %s" % (name, error)) from error


def _spawn_client(service: str, model_name: str, model_xml: str, robot_namespace: str, initial_pose: Pose,
                  reference_frame: str, gazebo_namespace: str) -> bool:
    response = call("%s/%s" % (gazebo_namespace, service), SpawnModel, model_name, model_xml, robot_namespace,
                    initial_pose, reference_frame)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def spawn_urdf_model_client(model_name: str, model_xml: str, robot_namespace: str, initial_pose: Pose,
                            reference_frame: str, gazebo_namespace: str) -> bool:
    """Spawn the URDF text ``model_xml`` at ``initial_pose`` (geometry_msgs/Pose); True when it worked."""
    return _spawn_client("spawn_urdf_model", model_name, model_xml, robot_namespace, initial_pose, reference_frame,
                         gazebo_namespace)


def spawn_sdf_model_client(model_name: str, model_xml: str, robot_namespace: str, initial_pose: Pose,
                           reference_frame: str, gazebo_namespace: str) -> bool:
    """Spawn the SDF text ``model_xml`` at ``initial_pose`` (geometry_msgs/Pose); True when it worked."""
    return _spawn_client("spawn_sdf_model", model_name, model_xml, robot_namespace, initial_pose, reference_frame,
                         gazebo_namespace)


def set_model_configuration_client(model_name: str, model_param_name: str, joint_names: Sequence[str],
                                   joint_positions: Sequence[float], gazebo_namespace: str) -> bool:
    """Put joints of a model at ``joint_positions`` [rad or m]; True when it worked. ``model_param_name`` is unused."""
    response = call("%s/set_model_configuration" % gazebo_namespace, SetModelConfiguration, model_name,
                    model_param_name, joint_names, joint_positions)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def delete_model_client(model_name: str, gazebo_namespace: str) -> bool:
    """Delete a model; True when it worked."""
    response = call("%s/delete_model" % gazebo_namespace, DeleteModel, model_name)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def unpause_client(gazebo_namespace: str) -> None:
    """Let the world run."""
    call("%s/unpause_physics" % gazebo_namespace, Empty)


def wait_for_model(model_name: str, gazebo_namespace: str) -> None:
    """Wait until a model of that name is in the world."""
    def is_there():
        return model_name in call("%s/get_world_properties" % gazebo_namespace, GetWorldProperties).model_names

    wait_until(is_there, "the model %s" % model_name)
