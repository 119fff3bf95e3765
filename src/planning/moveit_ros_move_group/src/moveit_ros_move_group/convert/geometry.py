# SPDX-License-Identifier: BSD-3-Clause
"""Poses and shapes."""
from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, Vector3
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

from command_line.options import counted
from motion_planning.errors import PlanningError
from motion_planning.shapes import Cone, TriangleMesh
from urdf_model import Box, Cylinder, Sphere
from urdf_model import Plane as PlaneShape
from urdf_model.transforms import axis_rotation, matrix_from_quaternion, quaternion_from_matrix, rigid

if TYPE_CHECKING:
    import rospy
    from moveit_msgs.msg import CollisionObject

    from motion_planning.shapes import Geometry, Placed

# The quaternion's length may be off by this much; clients round.
_ROUNDED = 0.1


class MessageError(PlanningError):
    """A message that cannot be understood, with the reason."""


def matrix_of(pose: Pose | Transform, what: str = "pose") -> np.ndarray:
    """Return the (4, 4) of a Pose or a Transform. A quaternion of zeros is taken for the identity, as MoveIt does.

    Raises MessageError for numbers that are not finite and for a quaternion that is not a rotation; ``what`` names it.
    """
    if isinstance(pose, Transform):
        point, turn = pose.translation, pose.rotation
    else:
        point, turn = pose.position, pose.orientation
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    position = np.array([point.x, point.y, point.z])
    if not (np.isfinite(quaternion).all() and np.isfinite(position).all()):
        raise MessageError("%s is not finite: position %s, orientation %s"
                           % (what, position.tolist(), quaternion.tolist()))
    length = float(np.linalg.norm(quaternion))
    if length == 0.0:
        return rigid(np.eye(3), position)
    if abs(length - 1.0) > _ROUNDED:
        raise MessageError("the quaternion (x y z w) %s of %s has length %.3g; a rotation needs length 1"
                           % (quaternion.tolist(), what, length))
    return rigid(matrix_from_quaternion(quaternion), position)


def pose_of(matrix: np.ndarray) -> Pose:
    """Return the Pose of a (4, 4)."""
    return Pose(Point(*matrix[:3, 3].tolist()), Quaternion(*quaternion_from_matrix(matrix).tolist()))


def transform_of(matrix: np.ndarray) -> Transform:
    """Return the Transform of a (4, 4)."""
    return Transform(Vector3(*matrix[:3, 3].tolist()), Quaternion(*quaternion_from_matrix(matrix).tolist()))


def stamped(matrix: np.ndarray, frame: str, stamp: rospy.Time) -> PoseStamped:
    """Return the PoseStamped of a (4, 4)."""
    message = PoseStamped(pose=pose_of(matrix))
    message.header.frame_id, message.header.stamp = frame, stamp
    return message


def shape_of(primitive: SolidPrimitive) -> Box | Sphere | Cylinder | Cone:
    """Return the shape of a SolidPrimitive. Raises MessageError for an unknown kind, and missing or bad dimensions."""
    kind, sizes = primitive.type, list(primitive.dimensions)
    needed = {SolidPrimitive.BOX: 3, SolidPrimitive.SPHERE: 1, SolidPrimitive.CYLINDER: 2, SolidPrimitive.CONE: 2}
    if kind not in needed:
        raise MessageError("solid primitives are boxes (1), spheres (2), cylinders (3) and cones (4); got type %d"
                           % kind)
    sizes = sizes[:needed[kind]]
    if len(sizes) < needed[kind] or not all(math.isfinite(size) and size > 0.0 for size in sizes):
        raise MessageError("a solid primitive of type %d needs %s above 0, got %s"
                           % (kind, counted(needed[kind], "size"), list(primitive.dimensions)))
    if kind == SolidPrimitive.BOX:
        return Box((sizes[0], sizes[1], sizes[2]))
    if kind == SolidPrimitive.SPHERE:
        return Sphere(sizes[0])
    height, radius = sizes[SolidPrimitive.CYLINDER_HEIGHT], sizes[SolidPrimitive.CYLINDER_RADIUS]
    return Cylinder(radius, height) if kind == SolidPrimitive.CYLINDER else Cone(radius, height)


def mesh_shape_of(mesh: Mesh) -> TriangleMesh:
    """Return the TriangleMesh of a Mesh message. Raises MessageError."""
    try:
        return TriangleMesh(np.array([(v.x, v.y, v.z) for v in mesh.vertices], dtype=float).reshape(-1, 3),
                            np.array([triangle.vertex_indices for triangle in mesh.triangles],
                                     dtype=np.int64).reshape(-1, 3))
    except ValueError as error:
        raise MessageError(str(error)) from None


def plane_shape_of(plane: Plane) -> tuple[PlaneShape, np.ndarray]:
    """Return (shape, pose (4, 4)) of a Plane message: a x + b y + c z + d = 0. Raises MessageError."""
    normal, offset = np.array(plane.coef[:3]), plane.coef[3]
    length = float(np.linalg.norm(normal))
    if not (math.isfinite(length) and math.isfinite(offset) and length > 1e-9):
        raise MessageError("a plane needs finite coefficients and a normal, got %s" % list(plane.coef))
    normal = normal / length
    # The shortest turn that takes z to the normal, so that a plane is returned as it was sent.
    axis, cosine = np.cross((0.0, 0.0, 1.0), normal), normal[2]
    sine = float(np.linalg.norm(axis))
    if sine > 1e-9:
        rotation = axis_rotation(axis / sine, math.atan2(sine, cosine))
    else:
        rotation = np.diag([1.0, 1.0 if cosine > 0.0 else -1.0, 1.0 if cosine > 0.0 else -1.0])
    return PlaneShape(), rigid(rotation, -offset / length * normal)


def add_shapes(message: CollisionObject, shapes: Iterable[Placed]) -> None:
    """Append shapes ((shape, pose (4, 4)), ...) to a message with primitives, meshes, planes and their poses.

    An octree is left out: it has no message type there.
    """
    for shape, pose in shapes:
        if isinstance(shape, TriangleMesh):
            mesh = Mesh([MeshTriangle(tuple(row)) for row in shape.triangles.tolist()],
                        [Point(*row) for row in shape.vertices.tolist()])
            message.meshes.append(mesh)
            message.mesh_poses.append(pose_of(pose))
        elif isinstance(shape, PlaneShape):
            if not hasattr(message, "planes"):
                continue
            message.planes.append(Plane((0.0, 0.0, 1.0, 0.0)))
            message.plane_poses.append(pose_of(pose))
        else:
            primitive = _primitive(shape)
            if primitive is not None:
                message.primitives.append(primitive)
                message.primitive_poses.append(pose_of(pose))


def _primitive(shape: Geometry) -> SolidPrimitive | None:
    if isinstance(shape, Box):
        return SolidPrimitive(SolidPrimitive.BOX, list(shape.size))
    if isinstance(shape, Sphere):
        return SolidPrimitive(SolidPrimitive.SPHERE, [shape.radius])
    if isinstance(shape, Cylinder):
        return SolidPrimitive(SolidPrimitive.CYLINDER, [shape.length, shape.radius])
    if isinstance(shape, Cone):
        return SolidPrimitive(SolidPrimitive.CONE, [shape.length, shape.radius])
    return None
