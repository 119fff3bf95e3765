# SPDX-License-Identifier: BSD-3-Clause
"""Poses, shapes, states and markers as messages, and back."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from moveit_msgs.msg import Constraints, JointConstraint, MoveItErrorCodes, RobotState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from motion_planning.shapes import Cone, TriangleMesh
from motion_planning_rviz.drawing import solid_of
from motion_planning_rviz.playback import Playback
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import axis_rotation, matrix_from_quaternion, quaternion_from_matrix, rigid

if TYPE_CHECKING:
    from moveit_msgs.msg import CollisionObject, DisplayTrajectory, PlanningScene

    from motion_planning.model import PlanningModel
    from motion_planning_rviz.drawing import Colour, DrawnSolid, Solid

#: Tolerance of a joint goal [rad or m], as in MoveIt's programs.
JOINT_TOLERANCE = 1e-4
_KINDS = {"box": Marker.CUBE, "sphere": Marker.SPHERE, "cylinder": Marker.CYLINDER, "mesh": Marker.MESH_RESOURCE,
          "triangles": Marker.TRIANGLE_LIST}
_CODES = {value: name for name, value in vars(MoveItErrorCodes).items() if isinstance(value, int) and name.isupper()}


def code_name(code: int) -> str:
    """Return the name of a value of MoveItErrorCodes."""
    return _CODES.get(code, "error code %d" % code)


def matrix_of(pose: Pose) -> np.ndarray:
    """Return the (4, 4) of a Pose; a quaternion of zeros is the identity. Raises ValueError for what is not a pose."""
    point, turn = pose.position, pose.orientation
    position, quaternion = (point.x, point.y, point.z), (turn.x, turn.y, turn.z, turn.w)
    if not all(math.isfinite(value) for value in (*position, *quaternion)):
        raise ValueError("the pose is not finite: position %s, orientation %s" % (list(position), list(quaternion)))
    return rigid(np.eye(3) if not any(quaternion) else matrix_from_quaternion(quaternion), position)


def pose_message(matrix: np.ndarray) -> Pose:
    """Return the Pose of a (4, 4)."""
    return Pose(Point(*matrix[:3, 3].tolist()), Quaternion(*quaternion_from_matrix(matrix).tolist()))


def state_message(values: Mapping[str, float]) -> RobotState:
    """Return the RobotState that lays ``values`` {joint: value} over the current state."""
    message = RobotState(is_diff=True)
    message.joint_state.name, message.joint_state.position = list(values), list(values.values())
    return message


def state_values(message: RobotState) -> dict[str, float]:
    """Return {joint: value} of a RobotState."""
    return dict(zip(message.joint_state.name, message.joint_state.position, strict=False))


def tells_joints_alone(message: PlanningScene) -> bool:
    """Whether a PlanningScene diff tells where the joints are and nothing else.

    A diff without anything is the sum of changes that undo each other: what was seen between them is gone.
    """
    state, world = message.robot_state, message.world
    return bool(message.is_diff and (state.joint_state.name or state.multi_dof_joint_state.joint_names) and not (
        state.attached_collision_objects or world.collision_objects or world.octomap.octomap.data
        or message.object_colors or message.allowed_collision_matrix.entry_names or message.link_padding
        or message.link_scale))


def goal_constraints(values: Mapping[str, float]) -> Constraints:
    """Return the Constraints that ask for ``values`` {joint: value}."""
    return Constraints(joint_constraints=[JointConstraint(name, value, JOINT_TOLERANCE, JOINT_TOLERANCE, 1.0)
                                          for name, value in values.items()])


def playback_of(model: PlanningModel, message: DisplayTrajectory) -> Playback:
    """Return the Playback of a DisplayTrajectory, whose parts follow on each other. Raises ValueError for an empty one
    and for one that cannot be shown."""
    state = model.default_state()
    q = _laid_over(state.q, model, state_values(message.trajectory_start))
    times, postures, begin = [], [], 0.0
    for part in message.trajectory:
        for point in part.joint_trajectory.points:
            q = _laid_over(q, model, dict(zip(part.joint_trajectory.joint_names, point.positions, strict=False)))
            times.append(begin + point.time_from_start.to_sec())
            postures.append(q)
        begin = times[-1] if times else 0.0
    if not times:
        raise ValueError("the path has no points")
    return Playback(model, times, postures)


def _laid_over(q: np.ndarray, model: PlanningModel, values: Mapping[str, float]) -> np.ndarray:
    q = np.array(q)
    for name, value in values.items():
        if name in model.index:
            q[model.index[name]] = value
    return q


def object_solids(message: CollisionObject) -> list[Solid]:
    """Return the Solids of a CollisionObject; their poses are in its header's frame. Shapes that are none are left out.

    Objects of MoveIt's newer form have a pose; the poses of their shapes are relative to it.
    """
    base, found = matrix_of(message.pose), []
    for primitive, pose in zip(message.primitives, message.primitive_poses, strict=False):
        found.append(solid_of(_primitive(primitive), base @ matrix_of(pose)))
    for mesh, pose in zip(message.meshes, message.mesh_poses, strict=False):
        try:
            shape = TriangleMesh(np.array([(v.x, v.y, v.z) for v in mesh.vertices], dtype=float).reshape(-1, 3),
                                 np.array([tuple(row.vertex_indices) for row in mesh.triangles],
                                          dtype=np.int64).reshape(-1, 3))
        except ValueError:
            continue
        found.append(solid_of(shape, base @ matrix_of(pose)))
    for plane, pose in zip(message.planes, message.plane_poses, strict=False):
        found.append(solid_of(Plane(), base @ matrix_of(pose) @ _plane_pose(plane.coef)))
    return [solid for solid in found if solid is not None]


def _primitive(message: SolidPrimitive) -> Box | Sphere | Cylinder | Cone | None:
    sizes = list(message.dimensions)
    if message.type == SolidPrimitive.BOX and len(sizes) >= 3:
        return Box((sizes[0], sizes[1], sizes[2]))
    if message.type == SolidPrimitive.SPHERE and sizes:
        return Sphere(sizes[0])
    if message.type in (SolidPrimitive.CYLINDER, SolidPrimitive.CONE) and len(sizes) >= 2:
        kind = Cylinder if message.type == SolidPrimitive.CYLINDER else Cone
        return kind(radius=sizes[1], length=sizes[0])
    return None


def _plane_pose(coefficients: Sequence[float]) -> np.ndarray:
    """The pose (4, 4) whose x-y plane is a x + b y + c z + d = 0; the identity for coefficients of no plane."""
    normal, length = np.array(coefficients[:3]), float(np.linalg.norm(coefficients[:3]))
    if not length > 1e-9:
        return np.eye(4)
    normal = normal / length
    axis = np.cross((0.0, 0.0, 1.0), normal)
    sine = float(np.linalg.norm(axis))
    turn = axis_rotation(axis / sine, math.atan2(sine, normal[2])) if sine > 1e-9 else np.eye(3)
    return rigid(turn, -coefficients[3] / length * normal)


def marker_of(one: DrawnSolid, frame: str, prefix: str = "") -> Marker:
    """Return the Marker of a drawing.DrawnSolid whose pose is in ``frame``."""
    solid = one.solid
    marker = Marker(ns=prefix + one.name, id=one.number, type=_KINDS[solid.kind], action=Marker.ADD,
                    pose=pose_message(one.pose), scale=Vector3(*map(float, solid.size)), color=ColorRGBA(*one.colour),
                    mesh_resource=solid.mesh)
    if solid.points is not None:
        marker.points = [Point(*row) for row in solid.points.tolist()]
    marker.header.frame_id = frame
    return marker


def text_marker(text: str, position: Iterable[float], frame: str, height: float) -> Marker:
    """Return a Marker that writes ``text`` above ``position`` (3,); letters of ``height`` [m]."""
    marker = Marker(ns="text", type=Marker.TEXT_VIEW_FACING, action=Marker.ADD, text=text,
                    pose=Pose(Point(*map(float, position)), Quaternion(0.0, 0.0, 0.0, 1.0)),
                    scale=Vector3(0.0, 0.0, height), color=ColorRGBA(1.0, 0.85, 0.8, 1.0))
    marker.header.frame_id = frame
    return marker


def line_marker(name: str, points: Iterable[np.ndarray], frame: str, colour: Colour, width: float) -> Marker:
    """Return a Marker with a line through ``points`` (m, 3), ``width`` [m]."""
    marker = Marker(ns=name, type=Marker.LINE_STRIP, action=Marker.ADD, scale=Vector3(width, 0.0, 0.0),
                    pose=Pose(Point(), Quaternion(0.0, 0.0, 0.0, 1.0)), color=ColorRGBA(*colour),
                    points=[Point(*row) for row in np.asarray(points, dtype=float).tolist()])
    marker.header.frame_id = frame
    return marker
