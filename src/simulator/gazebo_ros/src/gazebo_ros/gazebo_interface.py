# SPDX-License-Identifier: BSD-3-Clause
"""Calls to a simulator's services, for scripts. Every wait has a deadline in wall time and names what it waits for."""
import sys
import time

import rosgraph
import rospy
from gazebo_msgs.srv import DeleteModel, GetWorldProperties, SetModelConfiguration, SpawnModel
from std_srvs.srv import Empty

#: How long to wait for the simulator, a parameter or a model [s, wall time].
WAIT_S = 60.0
_SAY_AFTER_S = 2.0
_POLL_S = 0.05


class GazeboInterfaceError(Exception):
    """The simulator did not do what was asked; the text says what was expected and what was found."""


def wait_until(condition, what, timeout_s=WAIT_S):
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


def call(service, srv_class, *arguments, timeout_s=WAIT_S):
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


def _spawn_client(service, model_name, model_xml, robot_namespace, initial_pose, reference_frame, gazebo_namespace):
    response = call("%s/%s" % (gazebo_namespace, service), SpawnModel, model_name, model_xml, robot_namespace,
                    initial_pose, reference_frame)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def spawn_urdf_model_client(model_name, model_xml, robot_namespace, initial_pose, reference_frame, gazebo_namespace):
    """Spawn the URDF text ``model_xml`` at ``initial_pose`` (geometry_msgs/Pose); True when it worked."""
    return _spawn_client("spawn_urdf_model", model_name, model_xml, robot_namespace, initial_pose, reference_frame,
                         gazebo_namespace)


def spawn_sdf_model_client(model_name, model_xml, robot_namespace, initial_pose, reference_frame, gazebo_namespace):
    """Spawn the SDF text ``model_xml`` at ``initial_pose`` (geometry_msgs/Pose); True when it worked."""
    return _spawn_client("spawn_sdf_model", model_name, model_xml, robot_namespace, initial_pose, reference_frame,
                         gazebo_namespace)


def set_model_configuration_client(model_name, model_param_name, joint_names, joint_positions, gazebo_namespace):
    """Put joints of a model at ``joint_positions`` [rad or m]; True when it worked. ``model_param_name`` is unused."""
    response = call("%s/set_model_configuration" % gazebo_namespace, SetModelConfiguration, model_name,
                    model_param_name, joint_names, joint_positions)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def delete_model_client(model_name, gazebo_namespace):
    """Delete a model; True when it worked."""
    response = call("%s/delete_model" % gazebo_namespace, DeleteModel, model_name)
    (rospy.loginfo if response.success else rospy.logerr)(response.status_message)
    return response.success


def unpause_client(gazebo_namespace):
    """Let the world run."""
    call("%s/unpause_physics" % gazebo_namespace, Empty)


def wait_for_model(model_name, gazebo_namespace):
    """Wait until a model of that name is in the world."""
    def is_there():
        return model_name in call("%s/get_world_properties" % gazebo_namespace, GetWorldProperties).model_names

    wait_until(is_there, "the model %s" % model_name)
