# SPDX-License-Identifier: BSD-3-Clause
"""Applies messages to a scene, with MoveIt's meaning of each."""
from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Iterable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from moveit_msgs.msg import CollisionObject

from command_line.options import counted
from motion_planning.errors import PlanningError
from motion_planning.scene import AllowedCollisions, Scene, SceneError, WorldObject, check_object
from moveit_ros_move_group.convert.geometry import (
    MessageError,
    matrix_of,
    mesh_shape_of,
    plane_shape_of,
    shape_of,
)
from moveit_ros_move_group.convert.octomap import octree_of
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from geometry_msgs.msg import Pose, TransformStamped
    from moveit_msgs.msg import AttachedCollisionObject, PlanningScene, PlanningSceneWorld, RobotState

    from motion_planning.model import State

_OPERATIONS = {CollisionObject.ADD: "ADD", CollisionObject.REMOVE: "REMOVE", CollisionObject.APPEND: "APPEND",
               CollisionObject.MOVE: "MOVE"}


# Number of refused parts of a message after which its rest is left out.
_MAX_ERRORS = 1000

M = TypeVar("M")
T = TypeVar("T")


class SceneReader:
    """Applies messages to scenes; frames that a scene does not know are looked up by ``find_frame``.

    find_frame(name): pose (4, 4) in the planning frame; raises PlanningError if there is none.
    """

    def __init__(self, find_frame: Callable[[str], np.ndarray] | None = None) -> None:
        self._find_frame = find_frame

    def frame(self, scene: Scene, name: str) -> np.ndarray:
        """Return the pose (4, 4) of a frame in the planning frame, which an empty name means. Raises PlanningError."""
        name = name.lstrip("/")
        if not name or name == scene.model.frame:
            return np.eye(4)
        if scene.has_frame(name) or self._find_frame is None:
            return scene.frame(name)
        return self._find_frame(name)

    # -- objects ------------------------------------------------------------------------------------------------

    def with_collision_object(self, scene: Scene, message: CollisionObject) -> Scene:
        """Return the scene after a CollisionObject. Raises PlanningError; the sentence names the object."""
        operation = _operation(message)
        try:
            if operation == CollisionObject.REMOVE:
                return scene.without_object(message.id)
            frame = self.frame(scene, message.header.frame_id)
            if operation == CollisionObject.MOVE:
                return _moved(scene, message, frame)
            new = _object_of(message, frame)
            return scene.with_object(new) if operation == CollisionObject.ADD else scene.appended(new)
        except PlanningError as error:
            raise type(error)(_about("collision object", _OPERATIONS[operation], message.id, error)) from None

    def with_attached_object(self, scene: Scene, message: AttachedCollisionObject) -> Scene:
        """Return the scene after an AttachedCollisionObject. Raises PlanningError; the sentence names the object."""
        what = message.object
        operation = _operation(what)
        try:
            if operation == CollisionObject.REMOVE:
                if message.link_name and message.link_name not in scene.model.link_index:
                    raise SceneError("the robot has no link '%s'" % message.link_name)
                return scene.detach(what.id, message.link_name)
            if operation == CollisionObject.MOVE:
                raise SceneError("what is attached moves with its link; MOVE is for objects of the world")
            if not (what.primitives or what.meshes or what.planes):
                return scene.attach(what.id, message.link_name, message.touch_links, message.detach_posture)
            if message.link_name not in scene.model.link_index:
                return scene.attach(what.id, message.link_name)  # raises the error for an unknown link
            link = scene.frame(message.link_name)
            frame = self.frame(scene, what.header.frame_id) if what.header.frame_id else link
            new = _object_of(what, inverse(link) @ frame)
            if operation == CollisionObject.APPEND and what.id in scene.state.attached:
                return scene.attach_more(new, message.link_name)
            return scene.attach(new, message.link_name, message.touch_links, message.detach_posture)
        except PlanningError as error:
            raise type(error)(_about("attached object", _OPERATIONS[operation], what.id, error)) from None

    # -- states -------------------------------------------------------------------------------------------------

    def with_robot_state(self, scene: Scene, message: RobotState, errors: list[str]) -> Scene:
        """Return the scene after a RobotState: over what is there if it is a diff, else without what the robot held.

        Joints that the model does not have are ignored. ``errors`` (list) gets the reasons for refused parts.
        """
        try:
            scene = scene.with_state(state_over(scene, message, self))
        except PlanningError as error:
            errors.append(str(error))
        if not message.is_diff:
            scene = scene.with_state(scene.state.with_attached({}))
        return self._each(scene, message.attached_collision_objects, self.with_attached_object, errors)

    def with_planning_scene(self, scene: Scene, message: PlanningScene) -> tuple[Scene, list[str]]:
        """Return (scene after a PlanningScene message, list of sentences on what could not be applied)."""
        errors = []
        if not message.is_diff:
            scene = Scene(scene.model, scene.state.with_attached({}), name=message.name)
        elif message.name:
            scene = replace(scene, name=message.name)
        if message.fixed_frame_transforms:
            scene = self._with_transforms(scene, message.fixed_frame_transforms, errors)
        held_before = set(scene.state.attached)
        state = message.robot_state
        if state.joint_state.name or state.multi_dof_joint_state.joint_names or state.attached_collision_objects:
            scene = self.with_robot_state(scene, state, errors)
        matrix = message.allowed_collision_matrix
        # A diff with defaults alone leaves the matrix as it is, as in MoveIt.
        if matrix.entry_names or matrix.default_entry_names and not message.is_diff:
            try:
                scene = scene.with_allowed(AllowedCollisions.from_matrix(
                    matrix.entry_names, [row.enabled for row in matrix.entry_values], matrix.default_entry_names,
                    matrix.default_entry_values))
            except ValueError as error:
                errors.append(str(error))
        try:
            scene = scene.with_padding({entry.link_name: entry.padding for entry in message.link_padding},
                                       {entry.link_name: entry.scale for entry in message.link_scale})
        except SceneError as error:
            errors.append(str(error))
        scene = self._with_world(scene, message.world, held_before, errors)
        if message.object_colors:
            scene = scene.with_colours({entry.id: (entry.color.r, entry.color.g, entry.color.b, entry.color.a)
                                        for entry in message.object_colors})
        return scene, errors

    def with_world(self, scene: Scene, message: PlanningSceneWorld) -> tuple[Scene, list[str]]:
        """Return (scene after a PlanningSceneWorld, which replaces the world, errors)."""
        errors = []
        return self._with_world(scene.without_object("").with_octomap(None), message, set(), errors), errors

    def _with_world(self, scene: Scene, message: PlanningSceneWorld, held_before: Container[str],
                    errors: list[str]) -> Scene:
        # Clients that attach an object often remove it from the world in the same message; by then it is no longer
        # there.
        taken = {name for name in scene.state.attached if name not in held_before and name not in scene.objects}
        objects = [one for one in message.collision_objects
                   if not (one.id in taken and one.operation == CollisionObject.REMOVE)]
        scene = self._with_objects(scene, objects, errors)
        if message.octomap.octomap.id:
            try:
                octree = octree_of(message.octomap.octomap)
                pose = self.frame(scene, message.octomap.header.frame_id) @ matrix_of(message.octomap.origin, "octomap")
                scene = scene.with_octomap(octree, pose)
            except PlanningError as error:
                errors.append("octomap: %s" % error)
        return scene

    def _with_objects(self, scene: Scene, messages: Iterable[CollisionObject], errors: list[str]) -> Scene:
        """The scene after CollisionObjects. A message may bring or remove 100,000 of them: they are put in or taken out
        together."""
        own_frames = {"", scene.model.frame, *scene.model.links}

        def kind(message: CollisionObject) -> str:
            adds = message.operation == CollisionObject.ADD and message.header.frame_id.lstrip("/") in own_frames
            return "add" if adds else "remove" if message.operation == CollisionObject.REMOVE and message.id else ""

        for what, some in itertools.groupby(messages, kind):
            if what == "add":
                scene = scene.with_objects(self._made(some, partial(self._added, scene), errors))
            elif what == "remove":
                scene = scene.without_objects(self._made(some, partial(self._gone, scene), errors))
            else:
                scene = self._each(scene, some, self.with_collision_object, errors)
        return scene

    def _gone(self, scene: Scene, message: CollisionObject) -> str:
        """The name of the object that a CollisionObject removes. Raises PlanningError where it is not there."""
        if message.id not in scene.objects:
            self.with_collision_object(scene, message)
        return message.id

    def _added(self, scene: Scene, message: CollisionObject) -> WorldObject:
        """The WorldObject that a CollisionObject adds. Raises PlanningError; the sentence names the object."""
        try:
            new = _object_of(message, self.frame(scene, message.header.frame_id))
            check_object(new)
            return new
        except PlanningError as error:
            raise type(error)(_about("collision object", "ADD", message.id, error)) from None

    def _with_transforms(self, scene: Scene, transforms: Iterable[TransformStamped], errors: list[str]) -> Scene:
        known = {}
        for entry in transforms:
            name, parent = entry.child_frame_id.lstrip("/"), entry.header.frame_id
            if name == scene.model.frame:
                # MoveIt's way: the header names the frame, and the child is the planning frame that it is seen from.
                name, parent = parent.lstrip("/"), name
            try:
                if name != scene.model.frame:
                    known[name] = self.frame(scene, parent) @ matrix_of(entry.transform, name)
            except PlanningError as error:
                errors.append("fixed frame '%s': %s" % (entry.child_frame_id, error))
        return scene.with_transforms({**scene.transforms, **known})

    def _each(self, scene: Scene, messages: Iterable[M], apply: Callable[[Scene, M], Scene],
              errors: list[str]) -> Scene:
        def step(message: M) -> None:
            nonlocal scene
            scene = apply(scene, message)

        self._made(messages, step, errors)
        return scene

    def _made(self, messages: Iterable[M], make: Callable[[M], T], errors: list[str]) -> list[T]:
        """[make(message), ...] of the valid ones; ``errors`` gets the reasons for the others."""
        made = []
        for message in messages:
            if len(errors) >= _MAX_ERRORS:
                errors.append("after %d errors the rest of the message is left out" % _MAX_ERRORS)
                break
            try:
                made.append(make(message))
            except PlanningError as error:
                errors.append(str(error))
        return made


def state_over(scene: Scene, message: RobotState, reader: SceneReader) -> State:
    """Return the scene's State with the joints and the base of a RobotState message in place.

    Raises MessageError for lists of different lengths and values that are not finite.
    """
    model, state = scene.model, scene.state
    joints = message.joint_state
    if len(joints.name) != len(joints.position):
        raise MessageError("the robot state has %s but %s"
                           % (counted(len(joints.name), "joint name"), counted(len(joints.position), "position")))
    bad = [name for name, value in zip(joints.name, joints.position, strict=True) if not math.isfinite(value)]
    if bad:
        raise MessageError("the robot state's value of joint '%s' is not finite" % bad[0])
    state = state.with_joints({name: value for name, value in zip(joints.name, joints.position, strict=True)
                               if name in model.index})
    multi = message.multi_dof_joint_state
    if len(multi.joint_names) != len(multi.transforms):
        raise MessageError("the robot state has %d multi-DOF joints but %s"
                           % (len(multi.joint_names), counted(len(multi.transforms), "transform")))
    for name, transform in zip(multi.joint_names, multi.transforms, strict=True):
        if model.virtual_joint is not None and name == model.virtual_joint.name:
            frame = reader.frame(scene, multi.header.frame_id)
            state = state.with_base(frame @ matrix_of(transform, "joint '%s'" % name))
    return state


def _operation(message: CollisionObject) -> int:
    value = message.operation
    # rospy reads a byte as a number, but clients in Python may set any type.
    value = value[0] if isinstance(value, bytes) and value else value
    if value not in _OPERATIONS:
        raise MessageError("operation %r of object '%s' is none of ADD 0, REMOVE 1, APPEND 2, MOVE 3"
                           % (value, message.id))
    return value


def _about(kind: str, operation: str, name: str, error: PlanningError) -> str:
    return "%s of %s '%s' refused: %s" % (operation, kind, name, error)


def _is_unset(pose: Pose) -> bool:
    return not any((pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.y,
                    pose.orientation.z, pose.orientation.w))


def _object_of(message: CollisionObject, frame: np.ndarray) -> WorldObject:
    """The WorldObject of a CollisionObject's shapes; ``frame`` (4, 4): its header's, in which the poses are
    returned."""
    shapes = []
    primitives = [partial(shape_of, one) for one in message.primitives]
    meshes = [partial(mesh_shape_of, one) for one in message.meshes]
    planes = [partial(plane_shape_of, one) for one in message.planes]
    for kind, made, poses in (("primitives", primitives, message.primitive_poses),
                              ("meshes", meshes, message.mesh_poses), ("planes", planes, message.plane_poses)):
        if len(poses) > len(made):
            raise MessageError("%d %s but %s" % (len(made), kind, counted(len(poses), "pose")))
        for i, make in enumerate(made):
            pose = matrix_of(poses[i], "the pose of a shape") if i < len(poses) else np.eye(4)
            shape = make()
            if isinstance(shape, tuple):
                shape, inner = shape
                pose = pose @ inner
            shapes.append((shape, pose))
    if len(message.subframe_names) != len(message.subframe_poses):
        raise MessageError("%s but %s" % (counted(len(message.subframe_names), "subframe"),
                                          counted(len(message.subframe_poses), "pose")))
    subframes = {name: matrix_of(pose, "subframe '%s'" % name)
                 for name, pose in zip(message.subframe_names, message.subframe_poses, strict=True)}
    pose = matrix_of(message.pose, "its pose")
    if _is_unset(message.pose) and len(shapes) == 1:
        shape, pose = shapes[0]
        shapes = [(shape, np.eye(4))]
    return WorldObject(message.id, frame @ pose, tuple(shapes), subframes, (message.type.key, message.type.db))


def _moved(scene: Scene, message: CollisionObject, frame: np.ndarray) -> Scene:
    if message.primitives or message.meshes or message.planes:
        raise MessageError("a MOVE carries poses only, this one has shapes too; ADD replaces an object")
    poses = [matrix_of(pose, "the pose of a shape")
             for pose in (*message.primitive_poses, *message.mesh_poses, *message.plane_poses)]
    if _is_unset(message.pose) and len(poses) == 1:
        return scene.moved(message.id, frame @ poses[0], [np.eye(4)])
    return scene.moved(message.id, frame @ matrix_of(message.pose, "its pose"), poses or None)
