# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene of a running move_group: asked for, and changed. ``connection``: a
connection.MoveGroupConnection."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import rospy
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene, PlanningSceneComponents

from .conversions import matrix_of
from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from moveit_msgs.msg import RobotState

    from moveit_commander.connection import MoveGroupConnection


def scene(connection: MoveGroupConnection, components: int) -> PlanningScene:
    """Return the PlanningScene with the parts that ``components``, a sum of PlanningSceneComponents' numbers, names."""
    return connection.call("get_planning_scene", components=PlanningSceneComponents(components)).scene


def robot_state(connection: MoveGroupConnection) -> RobotState:
    """Return the RobotState now, with what the robot holds. It has no stamp, as MoveIt's: programs compare states."""
    state = scene(connection, PlanningSceneComponents.ROBOT_STATE
                  | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS).robot_state
    state.joint_state.header.stamp = state.multi_dof_joint_state.header.stamp = rospy.Time()
    return state


def held_frame(connection: MoveGroupConnection, name: str) -> tuple[str, np.ndarray]:
    """Return (link, pose (4, 4) in it) of an attached object, or of "object/subframe" of one. Raises
    MoveItCommanderException for other names."""
    owner, _, subframe = name.rpartition("/")
    for body in robot_state(connection).attached_collision_objects:
        one = body.object
        if one.id == name:
            return body.link_name, matrix_of(one.pose)
        if one.id == owner and subframe in one.subframe_names:
            return body.link_name, matrix_of(one.pose) @ matrix_of(
                one.subframe_poses[one.subframe_names.index(subframe)])
    raise MoveItCommanderException("the robot has no link '%s', and holds no object or subframe of that name" % name)


def difference() -> PlanningScene:
    """Return a PlanningScene that changes nothing yet."""
    message = PlanningScene(is_diff=True)
    message.robot_state.is_diff = True
    return message


def attach(connection: MoveGroupConnection, attached: AttachedCollisionObject) -> bool:
    """Attach or detach (AttachedCollisionObject), and return whether that was done."""
    message = difference()
    message.robot_state.attached_collision_objects = [attached]
    return connection.call("apply_planning_scene", scene=message).success


def attached_object(name: str, link: str, operation: int, touch_links: Iterable[str] = ()) -> AttachedCollisionObject:
    """Return the AttachedCollisionObject that takes the world's object ``name`` over, or gives it back."""
    message = AttachedCollisionObject(link_name=link, touch_links=list(touch_links))
    message.object = CollisionObject(id=name, operation=operation)
    return message
