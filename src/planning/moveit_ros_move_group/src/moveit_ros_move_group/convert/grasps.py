# SPDX-License-Identifier: BSD-3-Clause
"""Grasps, places and postures of hands."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
import rospy
from moveit_msgs.msg import Grasp, RobotTrajectory
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from command_line.options import counted
from motion_planning.manipulation import Candidate, Translation
from moveit_ros_move_group.convert.geometry import MessageError, matrix_of

if TYPE_CHECKING:
    from moveit_msgs.msg import GripperTranslation, PlaceLocation

    from motion_planning.manipulation import PlaceTask
    from motion_planning.model import PlanningModel
    from motion_planning.scene import Scene
    from moveit_ros_move_group.convert.scene_in import SceneReader

# Least duration of a hand's posture without a time [s].
_POSTURE_S = 0.5
# The grasp for a goal without grasps: distance in front of the object's origin along x [m], and the length of approach
# and retreat, desired and least [m].
_IN_FRONT_M, _WAY_M, _MIN_WAY_M = 0.2, 0.2, 0.1


def grasp_candidate(grasp: Grasp, name: str, scene: Scene, reader: SceneReader, link: str) -> Candidate:
    """Return the Candidate of a Grasp for ``link``. Raises PlanningError, MessageError among them."""
    what = "grasp '%s'" % name
    pose = reader.frame(scene, grasp.grasp_pose.header.frame_id) @ matrix_of(grasp.grasp_pose.pose, what)
    return Candidate(
        name, pose, _way(grasp.pre_grasp_approach, what + ", approach", scene, reader, link),
        _way(grasp.post_grasp_retreat, what + ", retreat", scene, reader, link), _number(grasp.grasp_quality, what),
        posture_of(grasp.pre_grasp_posture, scene.model, what), posture_of(grasp.grasp_posture, scene.model, what),
        frozenset(grasp.allowed_touch_objects))


def place_candidate(place: PlaceLocation, name: str, reader: SceneReader, task: PlaceTask,
                    of_hand: bool = False) -> Candidate:
    """Return the Candidate of a PlaceLocation for a PlaceTask; its pose is the object's, or the hand's (``of_hand``).

    Without a posture of the hand, it opens as before the object was grasped. Raises PlanningError.
    """
    what, scene = "place '%s'" % name, task.scene
    pose = reader.frame(scene, place.place_pose.header.frame_id) @ matrix_of(place.place_pose.pose, what)
    opened = place.post_place_posture
    if not opened.points:
        # The core keeps what it was given.
        opened = cast("JointTrajectory | None", scene.state.attached[task.target].detach_posture) or opened
    pose = pose if of_hand else task.hand_pose(pose)
    return Candidate(
        name, pose, _way(place.pre_place_approach, what + ", approach", scene, reader, task.link),
        _way(place.post_place_retreat, what + ", retreat", scene, reader, task.link), _number(place.quality, what),
        {}, posture_of(opened, scene.model, what), frozenset(place.allowed_touch_objects))


def usual_grasp(target: str, frame: str, hand: Sequence[str]) -> Grasp:
    """The Grasp that stands for an empty list: along x to the object's origin, then up.

    frame: the planning frame; hand: names of the hand's joints, which open as wide as they can and close.
    """
    grasp = Grasp(id="usual")
    grasp.grasp_pose.header.frame_id = target
    grasp.grasp_pose.pose.position.x, grasp.grasp_pose.pose.orientation.w = -_IN_FRONT_M, 1.0
    for way, axis in ((grasp.pre_grasp_approach, "x"), (grasp.post_grasp_retreat, "z")):
        way.direction.header.frame_id = frame
        setattr(way.direction.vector, axis, 1.0)
        way.desired_distance, way.min_distance = _WAY_M, _MIN_WAY_M
    if hand:
        far = np.finfo(float).max
        grasp.pre_grasp_posture = JointTrajectory(joint_names=list(hand),
                                                  points=[JointTrajectoryPoint(positions=[far] * len(hand))])
        grasp.grasp_posture = JointTrajectory(joint_names=list(hand),
                                              points=[JointTrajectoryPoint(positions=[-far] * len(hand))])
    return grasp


def posture_of(trajectory: JointTrajectory, model: PlanningModel, what: str) -> dict[str, float]:
    """Return {joint: value} at the end of a hand's JointTrajectory, joints that mimic others left out.

    Raises MessageError for unknown joints, and values that are missing or not numbers.
    """
    if not trajectory.points:
        return {}
    end = trajectory.points[-1].positions
    if len(end) != len(trajectory.joint_names):
        raise MessageError("%s: a posture has %s for %s"
                           % (what, counted(len(end), "position"), counted(len(trajectory.joint_names), "joint")))
    unknown = [name for name in trajectory.joint_names if name not in model.robot.joints]
    if unknown:
        raise MessageError("%s: a posture names joint '%s', unknown to robot '%s'" % (what, unknown[0], model.name))
    if not all(map(math.isfinite, end)):
        raise MessageError("%s: a posture is not finite: %s" % (what, list(end)))
    return {name: value for name, value in zip(trajectory.joint_names, end, strict=True) if name in model.index}


def hand_trajectory(posture: JointTrajectory, values: Mapping[str, float], model: PlanningModel,
                    force: float = 0.0) -> RobotTrajectory:
    """Return the RobotTrajectory that brings a hand from ``values`` {joint: value} to a posture (JointTrajectory).

    Values beyond a joint's limits are clamped. A posture without times lasts as long as its joints need.
    force: effort of the last point where that has none, if above 0.
    """
    names = list(posture.joint_names)
    limits = np.array([_limits(model, name) for name in names])
    points = [JointTrajectoryPoint(
        positions=np.clip(point.positions, *limits.T).tolist(), velocities=list(point.velocities),
        accelerations=list(point.accelerations), effort=list(point.effort), time_from_start=point.time_from_start)
        for point in posture.points]
    begin = [values.get(name, points[0].positions[i]) for i, name in enumerate(names)]
    if len(points) == 1 and points[0].time_from_start <= rospy.Duration():
        speeds = np.array([model.velocity[model.index[name]] if name in model.index else math.inf for name in names])
        longest = float((2.0 * np.abs(np.subtract(points[0].positions, begin)) / speeds).max())
        points[0].time_from_start = rospy.Duration.from_sec(max(_POSTURE_S, longest))
    if points[0].time_from_start > rospy.Duration():
        rest = [0.0] * len(names) if points[0].velocities else []
        points.insert(0, JointTrajectoryPoint(
            positions=begin, velocities=rest, accelerations=[0.0] * len(names) if points[0].accelerations else [],
            effort=[0.0] * len(names) if points[0].effort else []))
    if force > 0.0 and not points[-1].effort:
        for point in points:
            point.effort = [float(force)] * len(names)
    message = RobotTrajectory()
    message.joint_trajectory = JointTrajectory(joint_names=names, points=points)
    message.joint_trajectory.header.frame_id = model.frame
    return message


def _limits(model: PlanningModel, joint: str) -> np.ndarray | tuple[float, float]:
    return model.bounds[model.index[joint]] if joint in model.index else (-math.inf, math.inf)


def _number(value: float, what: str) -> float:
    if not math.isfinite(value):
        raise MessageError("%s: its quality is %s; expected a finite number" % (what, value))
    return value


def _way(message: GripperTranslation, what: str, scene: Scene, reader: SceneReader, link: str) -> Translation:
    """The Translation of a GripperTranslation. Directions in a frame that the hand carries along turn with it."""
    vector = message.direction.vector
    direction = np.array([vector.x, vector.y, vector.z])
    desired, least = message.desired_distance, message.min_distance
    if not (np.isfinite(direction).all() and math.isfinite(desired) and math.isfinite(least)):
        raise MessageError("%s: direction %s and distances %s, %s have to be finite"
                           % (what, direction.tolist(), desired, least))
    if not desired > 0.0:
        return Translation(np.zeros(3))
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        raise MessageError("%s: %.3g m along a direction of length 0; give it one" % (what, desired))
    frame = message.direction.header.frame_id
    turn = reader.frame(scene, frame)[:3, :3]
    carried = _carried(scene, frame.lstrip("/"), link)
    if carried:
        turn = scene.frame(link)[:3, :3].T @ turn
    return Translation(turn @ direction / length, carried, desired, least)


def _carried(scene: Scene, frame: str, link: str) -> bool:
    """Whether ``frame`` moves with ``link`` as one piece: a link fixed to it, or something that such a link holds."""
    model = scene.model
    body = scene.state.attached.get(frame.partition("/")[0])
    holder = body.link if body is not None else frame
    if holder not in model.link_index:
        return False
    ways = [[joint.name for joint in model.robot.chain(model.root, one) if joint.type != "fixed"]
            for one in (holder, link)]
    return ways[0] == ways[1] and bool(ways[1])
