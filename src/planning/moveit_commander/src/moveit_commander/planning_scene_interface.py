# SPDX-License-Identifier: BSD-3-Clause
"""The world of move_group's planning scene, and attached objects."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningSceneComponents
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from model_files.resources import ResourceFinder
from motion_planning.model import MeshReader, MeshUnreadable

from . import acm, scene_calls
from .connection import connect
from .conversions import matrix_of
from .exception import MoveItCommanderException
from .wrapped import WrappedScene

if TYPE_CHECKING:
    from geometry_msgs.msg import PoseStamped
    from moveit_msgs.msg import PlanningScene

__all__ = ["PlanningSceneInterface"]

acm.add_methods()
_OBJECTS = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
_HELD = PlanningSceneComponents.ROBOT_STATE | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS


class PlanningSceneInterface:
    """Adds, attaches and removes objects, and asks for them. Lengths in m; poses are PoseStamped.

    ns: namespace of move_group. synchronous: every change is in the scene when its method returns; else it goes out
    on a topic and is in the scene some time later. Methods that change the scene tell whether that was done; on topics
    it always counts as done. They raise MoveItCommanderException when move_group does not answer.
    """

    def __init__(self, ns: str = "", synchronous: bool = True) -> None:
        self._connection, self._synchronous = connect(ns), synchronous
        # Programs use these three by the names in MoveIt's class, which has not always had a method to add or move any
        # object. They are created at the start, so that no message is lost.
        self._pub_co = self._connection.advertise("collision_object")
        self._pub_aco = self._connection.advertise("attached_collision_object")
        self._apply_planning_scene_diff = self._connection.service("apply_planning_scene")
        self._psi = WrappedScene(self)
        if not synchronous:
            self._connection.advertise("planning_scene")

    # -- objects of the world ---------------------------------------------------------------------------------------

    def add_object(self, collision_object: CollisionObject) -> bool:
        """Add a CollisionObject."""
        return self._change(collision_object)

    def add_sphere(self, name: str, pose: PoseStamped, radius: float = 1) -> bool:
        """Add a sphere."""
        return self._change(self.make_sphere(name, pose, radius))

    def add_cylinder(self, name: str, pose: PoseStamped, height: float, radius: float) -> bool:
        """Add a cylinder along z, its middle at ``pose``."""
        return self._change(self.make_cylinder(name, pose, height, radius))

    def add_cone(self, name: str, pose: PoseStamped, height: float, radius: float) -> bool:
        """Add a cone along z, half its height at ``pose``."""
        return self._change(self.make_cone(name, pose, height, radius))

    def add_box(self, name: str, pose: PoseStamped, size: Sequence[float] = (1, 1, 1)) -> bool:
        """Add a box, its middle at ``pose``."""
        return self._change(self.make_box(name, pose, size))

    def add_mesh(self, name: str, pose: PoseStamped, filename: str, size: Sequence[float] = (1, 1, 1)) -> bool:
        """Add the mesh in a file (path, file:// or package://), scaled by ``size``."""
        return self._change(self.make_mesh(name, pose, filename, size))

    def add_plane(self, name: str, pose: PoseStamped, normal: Sequence[float] = (0, 0, 1), offset: float = 0) -> bool:
        """Add the plane normal . x + offset = 0, in the frame that ``pose`` is."""
        return self._change(self.make_plane(name, pose, normal, offset))

    def remove_world_object(self, name: str | None = None) -> bool:
        """Remove an object of the world, or all of them."""
        return self._change(CollisionObject(id=name or "", operation=CollisionObject.REMOVE))

    # -- objects that the robot holds -------------------------------------------------------------------------------

    def attach_object(self, attached_collision_object: AttachedCollisionObject | CollisionObject | str,
                      link: str | None = None, touch_links: Iterable[str] | None = None) -> bool:
        """Attach an AttachedCollisionObject, or a CollisionObject or an object of the world (its name) to ``link``."""
        attached = attached_collision_object
        if isinstance(attached, str):
            attached = self.make_existing(attached)
        if isinstance(attached, CollisionObject):
            attached = self._attached(link, attached, touch_links)
        return self._attach(attached)

    def attach_box(self, link: str, name: str, pose: PoseStamped | None = None, size: Sequence[float] = (1, 1, 1),
                   touch_links: Iterable[str] = ()) -> bool:
        """Attach a box to a link; without a pose the object of the world that has this name."""
        made = self.make_box(name, pose, size) if pose is not None else self.make_existing(name)
        return self._attach(self._attached(link, made, touch_links))

    def attach_sphere(self, link: str, name: str, pose: PoseStamped | None = None, radius: float = 1,
                      touch_links: Iterable[str] = ()) -> bool:
        """Attach a sphere to a link; without a pose the object of the world that has this name."""
        made = self.make_sphere(name, pose, radius) if pose is not None else self.make_existing(name)
        return self._attach(self._attached(link, made, touch_links))

    def attach_cylinder(self, link: str, name: str, pose: PoseStamped | None = None, height: float = 1,
                        radius: float = 1, touch_links: Iterable[str] = ()) -> bool:
        """Attach a cylinder to a link; without a pose the object of the world that has this name."""
        made = self.make_cylinder(name, pose, height, radius) if pose is not None else self.make_existing(name)
        return self._attach(self._attached(link, made, touch_links))

    def attach_mesh(self, link: str, name: str, pose: PoseStamped | None = None, filename: str = "",
                    size: Sequence[float] = (1, 1, 1), touch_links: Iterable[str] = ()) -> bool:
        """Attach the mesh in a file to a link; without a pose the object of the world that has this name."""
        made = self.make_mesh(name, pose, filename, size) if pose is not None else self.make_existing(name)
        return self._attach(self._attached(link, made, touch_links))

    def remove_attached_object(self, link: str | None = None, name: str | None = None) -> bool:
        """Put what the robot holds back into the world: an object, all of a link, or everything."""
        return self._attach(scene_calls.attached_object(name or "", link or "", CollisionObject.REMOVE))

    def clear(self) -> bool:
        """Remove everything from the robot's hands and from the world."""
        held = self.remove_attached_object()
        return self.remove_world_object() and held

    @staticmethod
    def _attached(link: str | None, collision_object: CollisionObject,
                  touch_links: Iterable[str] | None) -> AttachedCollisionObject:
        if not link:
            raise MoveItCommanderException("attaching '%s' needs the name of a link" % collision_object.id)
        return AttachedCollisionObject(object=collision_object, link_name=link, touch_links=list(touch_links or [link]))

    # -- asking -----------------------------------------------------------------------------------------------------

    def get_known_object_names(self, with_type: bool = False) -> list[str]:
        """Return the names of the world's objects; ``with_type``: of those alone whose kind is known."""
        return [one.id for one in self._objects() if one.type.key or not with_type]

    def get_known_object_names_in_roi(self, minx: float, miny: float, minz: float, maxx: float, maxy: float,
                                      maxz: float, with_type: bool = False) -> list[str]:
        """Return the names of the objects whose shapes all have their origin in a box of the planning frame."""
        low, high = np.array([minx, miny, minz]), np.array([maxx, maxy, maxz])
        names = []
        for one in self._objects():
            poses = [*one.primitive_poses, *one.mesh_poses, *one.plane_poses] or [Pose()]
            origins = [(matrix_of(one.pose) @ matrix_of(pose))[:3, 3] for pose in poses]
            if all((low <= origin).all() and (origin <= high).all() for origin in origins) and (
                    one.type.key or not with_type):
                names.append(one.id)
        return names

    def get_object_poses(self, object_ids: Sequence[str]) -> dict[str, Pose]:
        """Return {name: Pose} of those of the objects that are in the world, in the planning frame."""
        return {one.id: one.pose for one in self._objects() if one.id in object_ids}

    def get_objects(self, object_ids: Sequence[str] = ()) -> dict[str, CollisionObject]:
        """Return {name: CollisionObject} of those of these objects that are in the world; of all without names."""
        return {one.id: one for one in self._objects() if not object_ids or one.id in object_ids}

    def get_attached_objects(self, object_ids: Sequence[str] = ()) -> dict[str, AttachedCollisionObject]:
        """Return {name: AttachedCollisionObject} of what the robot holds; of all unless some are named."""
        held = scene_calls.scene(self._connection, _HELD).robot_state.attached_collision_objects
        return {one.object.id: one for one in held if not object_ids or one.object.id in object_ids}

    def get_planning_scene(self, components: int) -> PlanningScene:
        """Return a PlanningScene with what ``components`` (a sum of PlanningSceneComponents' numbers) names."""
        return scene_calls.scene(self._connection, components)

    def apply_planning_scene(self, planning_scene_message: PlanningScene) -> bool:
        """Apply a PlanningScene, whole or as a difference."""
        if not self._synchronous:
            self._connection.publish("planning_scene", planning_scene_message)
            return True
        return self._connection.call("apply_planning_scene", scene=planning_scene_message).success

    def _objects(self) -> list[CollisionObject]:
        return scene_calls.scene(self._connection, _OBJECTS).world.collision_objects

    # -- changing ---------------------------------------------------------------------------------------------------

    def _change(self, collision_object: CollisionObject) -> bool:
        if not self._synchronous:
            self._connection.publish("collision_object", collision_object)
            return True
        message = scene_calls.difference()
        message.world.collision_objects = [collision_object]
        return self.apply_planning_scene(message)

    def _attach(self, attached: AttachedCollisionObject) -> bool:
        if not self._synchronous:
            self._connection.publish("attached_collision_object", attached)
            return True
        return scene_calls.attach(self._connection, attached)

    # -- making -----------------------------------------------------------------------------------------------------

    @staticmethod
    def make_existing(name: str) -> CollisionObject:
        """Return a CollisionObject that stands for the world's object of this name."""
        return CollisionObject(id=name, operation=CollisionObject.ADD)

    @staticmethod
    def make_sphere(name: str, pose: PoseStamped, radius: float) -> CollisionObject:
        """Return a CollisionObject."""
        return _of_primitive(name, pose, SolidPrimitive.SPHERE, [radius])

    @staticmethod
    def make_cylinder(name: str, pose: PoseStamped, height: float, radius: float) -> CollisionObject:
        """Return a CollisionObject."""
        return _of_primitive(name, pose, SolidPrimitive.CYLINDER, [height, radius])

    @staticmethod
    def make_cone(name: str, pose: PoseStamped, height: float, radius: float) -> CollisionObject:
        """Return a CollisionObject."""
        return _of_primitive(name, pose, SolidPrimitive.CONE, [height, radius])

    @staticmethod
    def make_box(name: str, pose: PoseStamped, size: Sequence[float]) -> CollisionObject:
        """Return a CollisionObject."""
        return _of_primitive(name, pose, SolidPrimitive.BOX, size)

    @staticmethod
    def make_plane(name: str, pose: PoseStamped, normal: Sequence[float] = (0, 0, 1),
                   offset: float = 0) -> CollisionObject:
        """Return a CollisionObject."""
        made = _placed(name, pose)
        made.planes, made.plane_poses = [Plane(coef=[*map(float, normal), float(offset)])], [_here()]
        return made

    @staticmethod
    def make_mesh(name: str, pose: PoseStamped, filename: str, scale: Sequence[float] = (1, 1, 1)) -> CollisionObject:
        """Return a CollisionObject. Raises MoveItCommanderException for a file that cannot be read."""
        try:
            mesh = MeshReader(ResourceFinder())(filename)
        except MeshUnreadable as error:
            raise MoveItCommanderException(str(error)) from None
        made = _placed(name, pose)
        vertices = mesh.vertices * np.asarray(scale, dtype=float)
        made.meshes = [Mesh(triangles=[MeshTriangle(vertex_indices=corners) for corners in mesh.triangles.tolist()],
                            vertices=[Point(*vertex) for vertex in vertices.tolist()])]
        made.mesh_poses = [_here()]
        return made


def _here() -> Pose:
    return Pose(orientation=Quaternion(w=1.0))


def _placed(name: str, pose: PoseStamped) -> CollisionObject:
    return CollisionObject(id=name, header=pose.header, pose=pose.pose, operation=CollisionObject.ADD)


def _of_primitive(name: str, pose: PoseStamped, kind: int, dimensions: Sequence[float]) -> CollisionObject:
    made = _placed(name, pose)
    made.primitives = [SolidPrimitive(type=kind, dimensions=[float(value) for value in dimensions])]
    made.primitive_poses = [_here()]
    return made
