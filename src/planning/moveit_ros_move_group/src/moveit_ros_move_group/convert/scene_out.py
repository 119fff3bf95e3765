# SPDX-License-Identifier: BSD-3-Clause
"""Scenes, states and trajectories as messages."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from moveit_msgs.msg import (
    AllowedCollisionEntry,
    AllowedCollisionMatrix,
    AttachedCollisionObject,
    CollisionObject,
    LinkPadding,
    LinkScale,
    ObjectColor,
    PlanningScene,
    PlanningSceneComponents,
    RobotState,
    RobotTrajectory,
)
from rospy.rostime import genpy  # of the stamps in messages
from std_msgs.msg import ColorRGBA
from trajectory_msgs.msg import JointTrajectoryPoint

from moveit_ros_move_group.convert.geometry import add_shapes, pose_of, transform_of

if TYPE_CHECKING:
    from octomap_msgs.msg import OctomapWithPose
    from trajectory_msgs.msg import JointTrajectory

    from motion_planning.model import PlanningModel, State
    from motion_planning.scene import AllowedCollisions, AttachedBody, Scene, WorldObject
    from motion_planning.timing import Timed

EVERYTHING = 1023


def object_message(thing: WorldObject, frame: str, stamp: genpy.Time | None = None,
                   geometry: bool = True) -> CollisionObject:
    """Return the CollisionObject of a WorldObject whose pose is given in ``frame``."""
    message = CollisionObject(id=thing.id, operation=CollisionObject.ADD)
    message.header.frame_id = frame
    message.header.stamp = stamp or rospy.Time()
    message.type.key, message.type.db = thing.type
    message.pose = pose_of(thing.pose)
    if geometry:
        add_shapes(message, thing.shapes)
        message.subframe_names = list(thing.subframes)
        message.subframe_poses = [pose_of(pose) for pose in thing.subframes.values()]
    return message


def attached_message(body: AttachedBody) -> AttachedCollisionObject:
    """Return the AttachedCollisionObject of an AttachedBody."""
    message = AttachedCollisionObject(link_name=body.link, object=object_message(body.object, body.link),
                                      touch_links=sorted(body.touch_links))
    if body.detach_posture is not None:
        message.detach_posture = cast("JointTrajectory", body.detach_posture)  # the core keeps what it was given
    return message


def state_message(model: PlanningModel, state: State, stamp: genpy.Time | None = None, attached: bool = True,
                  is_diff: bool = False) -> RobotState:
    """Return the RobotState of a State: all joints, mimic ones too, and the base where a virtual joint moves it."""
    message = RobotState(is_diff=is_diff)
    stamp = stamp or rospy.Time()
    message.joint_state.header.frame_id = model.frame
    message.joint_state.header.stamp = stamp
    values = model.joint_values(state.q)
    message.joint_state.name = list(values)
    message.joint_state.position = list(values.values())
    multi = message.multi_dof_joint_state
    multi.header.frame_id, multi.header.stamp = model.frame, stamp
    if model.virtual_joint is not None and model.virtual_joint.type != "fixed":
        multi.joint_names, multi.transforms = [model.virtual_joint.name], [transform_of(state.base)]
    if attached:
        message.attached_collision_objects = [attached_message(body) for body in state.attached.values()]
    return message


def scene_message(scene: Scene, components: int = EVERYTHING, octomap: OctomapWithPose | None = None,
                  stamp: genpy.Time | None = None) -> PlanningScene:
    """Return the parts of a scene that ``components`` (bits of PlanningSceneComponents; 0 for all) asks for.

    octomap: the OctomapWithPose that the scene's octomap came with, or None.
    """
    bits, model = components or EVERYTHING, scene.model
    wants = PlanningSceneComponents
    message = PlanningScene()
    if bits & wants.SCENE_SETTINGS:
        message.name, message.robot_model_name = scene.name, model.name
    if bits & wants.ROBOT_STATE_ATTACHED_OBJECTS or bits & wants.ROBOT_STATE:
        message.robot_state = state_message(model, scene.state, stamp, bool(bits & wants.ROBOT_STATE_ATTACHED_OBJECTS))
    if bits & wants.TRANSFORMS:
        frames = {model.frame: np.eye(4), **scene.transforms}
        for name, pose in frames.items():
            # As MoveIt has it: the header names the frame, the child is the planning frame that it is seen from.
            entry = TransformStamped(child_frame_id=model.frame, transform=transform_of(pose))
            entry.header.frame_id = name
            message.fixed_frame_transforms.append(entry)
    if bits & wants.ALLOWED_COLLISION_MATRIX:
        message.allowed_collision_matrix = matrix_message(scene.allowed)
    if bits & wants.LINK_PADDING_AND_SCALING:
        message.link_padding = [LinkPadding(link, scene.link_padding.get(link, 0.0)) for link in model.links]
        message.link_scale = [LinkScale(link, scene.link_scale.get(link, 1.0)) for link in model.links]
    if bits & wants.OBJECT_COLORS:
        message.object_colors = [ObjectColor(name, ColorRGBA(*colour)) for name, colour in scene.colours.items()]
    if bits & (wants.WORLD_OBJECT_GEOMETRY | wants.WORLD_OBJECT_NAMES):
        message.world.collision_objects = [
            object_message(one, model.frame, geometry=bool(bits & wants.WORLD_OBJECT_GEOMETRY))
            for one in scene.objects.values()]
    if bits & wants.OCTOMAP and octomap is not None:
        message.world.octomap = octomap
    return message


def scene_diff(before: Scene, after: Scene, stamp: genpy.Time | None = None,
               octomap: OctomapWithPose | None = None) -> PlanningScene:
    """Return the PlanningScene diff that leads from one scene to another."""
    model = after.model
    message = PlanningScene(is_diff=True, name=after.name, robot_model_name=model.name)
    message.robot_state.is_diff = True
    if after.state is not before.state:
        message.robot_state = state_message(model, after.state, stamp, attached=False, is_diff=True)
        for name, body in before.state.attached.items():
            if after.state.attached.get(name) is not body:
                gone = AttachedCollisionObject(link_name=body.link)
                gone.object.id, gone.object.operation = name, CollisionObject.REMOVE
                message.robot_state.attached_collision_objects.append(gone)
        for name, body in after.state.attached.items():
            if before.state.attached.get(name) is not body:
                message.robot_state.attached_collision_objects.append(attached_message(body))
    for name, one in before.objects.items():
        if name not in after.objects:
            gone = CollisionObject(id=name, operation=CollisionObject.REMOVE)
            gone.header.frame_id = model.frame
            message.world.collision_objects.append(gone)
        elif after.objects[name] is not one:
            message.world.collision_objects.append(object_message(after.objects[name], model.frame))
    message.world.collision_objects += [object_message(one, model.frame) for name, one in after.objects.items()
                                        if name not in before.objects]
    if after.allowed is not before.allowed:
        message.allowed_collision_matrix = matrix_message(after.allowed)
    changed = {name: colour for name, colour in after.colours.items() if before.colours.get(name) != colour}
    message.object_colors = [ObjectColor(name, ColorRGBA(*colour)) for name, colour in changed.items()]
    if after.octomap is not before.octomap and octomap is not None:
        message.world.octomap = octomap
    return message


def matrix_message(allowed: AllowedCollisions) -> AllowedCollisionMatrix:
    """Return the AllowedCollisionMatrix of an AllowedCollisions."""
    names, matrix, default_names, default_values = allowed.as_matrix()
    return AllowedCollisionMatrix(names, [AllowedCollisionEntry(row.tolist()) for row in matrix], default_names,
                                  default_values)


def trajectory_message(names: Sequence[str], timed: Timed, frame: str,
                       stamp: genpy.Time | None = None) -> RobotTrajectory:
    """Return the RobotTrajectory of a timing.Timed for joints ``names``."""
    message = RobotTrajectory()
    message.joint_trajectory.header.frame_id = frame
    message.joint_trajectory.header.stamp = stamp or rospy.Time()
    message.joint_trajectory.joint_names = list(names)
    message.joint_trajectory.points = [
        JointTrajectoryPoint(positions=q, velocities=v, accelerations=a, time_from_start=rospy.Duration(t))
        for t, q, v, a in zip(timed.times.tolist(), timed.positions.tolist(), timed.velocities.tolist(),
                              timed.accelerations.tolist(), strict=True)]
    return message
