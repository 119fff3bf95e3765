# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene of a running move_group: asked for, and changed. ``connection``: a connection.Connection."""
import rospy
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene, PlanningSceneComponents


def scene(connection, components):
    """Return the PlanningScene with the parts that ``components``, a sum of PlanningSceneComponents' numbers, names."""
    return connection.call("get_planning_scene", components=PlanningSceneComponents(components)).scene


def robot_state(connection):
    """Return the RobotState now, with what the robot holds. It has no stamp, as MoveIt's: programs compare states."""
    state = scene(connection, PlanningSceneComponents.ROBOT_STATE
                  | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS).robot_state
    state.joint_state.header.stamp = state.multi_dof_joint_state.header.stamp = rospy.Time()
    return state


def difference():
    """Return a PlanningScene that changes nothing yet."""
    message = PlanningScene(is_diff=True)
    message.robot_state.is_diff = True
    return message


def attach(connection, attached):
    """Attach or detach (AttachedCollisionObject), and return whether that was done."""
    message = difference()
    message.robot_state.attached_collision_objects = [attached]
    return connection.call("apply_planning_scene", scene=message).success


def attached_object(name, link, operation, touch_links=()):
    """Return the AttachedCollisionObject that takes the world's object ``name`` over, or gives it back."""
    message = AttachedCollisionObject(link_name=link, touch_links=list(touch_links))
    message.object = CollisionObject(id=name, operation=operation)
    return message
