# SPDX-License-Identifier: BSD-3-Clause
"""``libgazebo_ros_joint_pose_trajectory.so``: moves joints through a list of positions, without physics."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from gazebo_msgs.srv import SetJointTrajectory, SetJointTrajectoryResponse
from trajectory_msgs.msg import JointTrajectory

from bullet_sim import BulletSimError, Pose
from command_line.options import counted
from gazebo_ros.convert import pose_from_msg
from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros.urdf_extras import unscoped
from urdf_model import bounds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gazebo_msgs.srv import SetJointTrajectoryRequest

    from gazebo_ros.model_plugin import PluginContext

_WORLD = ("", "world", "map")


class PosePlayback:
    """Decides which point of a trajectory is next, and when.

    :param points: list of (positions (n,), seconds until the point after it)
    :param start_s: when the first is due [s]
    """

    def __init__(self, points: Sequence[tuple[np.ndarray, float]], start_s: float) -> None:
        self._points, self._next, self._due_s = points, 0, start_s

    @property
    def is_over(self) -> bool:
        return self._next >= len(self._points)

    def take(self, time_s: float) -> np.ndarray | None:
        """The positions (n,) that are due at ``time_s`` [s], or None. As in Gazebo, one point at a time."""
        if self.is_over or time_s < self._due_s - 1e-9:
            return None
        positions, lasts_s = self._points[self._next]
        self._next += 1
        self._due_s += lasts_s
        return positions


class JointPoseTrajectory(ModelPlugin):
    """Listens to trajectory_msgs/JointTrajectory on ``topicName``, serves gazebo_msgs/SetJointTrajectory on
    ``serviceName`` (both set_joint_trajectory).

    Each point's ``time_from_start`` is its duration until the next one, as in Gazebo. Joints that the model
    does not have are left out with a warning. The link that ``header.frame_id`` names stays where it is.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        self._playback: PosePlayback | None = None
        # Of the trajectory: its joints in the model and in its points, the link that stays where it is.
        self._index = context.model.index([])
        self._columns: list[int] = []
        self._anchor: str | None = None
        self._now_s = 0.0
        # Last, since a trajectory may come at once.
        self._commands = context.subscription(context.element_text("topicName", "set_joint_trajectory"),
                                              JointTrajectory)
        self._service = context.service(context.element_text("serviceName", "set_joint_trajectory"),
                                        SetJointTrajectory, self._serve)

    def update(self, time_s: float, dt: float) -> None:
        self._now_s = time_s
        self._commands.handle(self._take)
        playback = self._playback
        if playback is None:
            return
        positions = playback.take(time_s)
        if positions is None:
            return
        model, anchor = self.context.model, self._anchor
        if anchor is None:
            model.set_joint_positions(self._index, positions[self._columns])
        else:
            place = model.link_pose(anchor).matrix()
            model.set_joint_positions(self._index, positions[self._columns])
            moved = model.link_pose(anchor).matrix()
            model.set_base_pose(Pose.from_matrix(place @ np.linalg.inv(moved) @ model.base_pose().matrix()))
        if playback.is_over:
            self._playback = None

    def _take(self, trajectory: JointTrajectory) -> None:
        why = self._begin(trajectory)
        if why:
            self.context.log.error_throttle(1.0, "%s: %s" % (self._what, why))

    def _serve(self, request: SetJointTrajectoryRequest) -> SetJointTrajectoryResponse:
        if request.model_name not in ("", self.context.model.name):
            return SetJointTrajectoryResponse(False, "this plugin moves model '%s', not '%s'"
                                              % (self.context.model.name, request.model_name))
        if request.set_model_pose:
            try:
                pose = pose_from_msg(request.model_pose)
            except BulletSimError as error:
                return SetJointTrajectoryResponse(False, str(error))
        why = self._begin(request.joint_trajectory)
        if not why and request.set_model_pose:
            self.context.model.set_base_pose(pose)
        return SetJointTrajectoryResponse(not why, why or "the trajectory begins")

    def _begin(self, trajectory: JointTrajectory) -> str:
        """Start a trajectory; returns the reason of a refusal, or ""."""
        model = self.context.model
        frame = unscoped(model.name, trajectory.header.frame_id.strip("/"))
        if frame not in _WORLD and frame not in model.link_names:
            return ("frame_id is '%s', expected world, map or one of the links %s"
                    % (trajectory.header.frame_id, ", ".join(model.link_names)))
        names = [unscoped(model.name, name) for name in trajectory.joint_names]
        known = [name for name in names if name in model.joint_names]
        if not known:
            return "none of the joints %s; expected some of %s" % (", ".join(names), ", ".join(model.joint_names))
        if len(known) < len(names):
            self.context.log.warn_throttle(5.0, "%s: no joints %s, which stay out of the trajectory" % (
                self._what, ", ".join(sorted(set(names) - set(known)))))
        points = []
        for number, point in enumerate(trajectory.points):
            if len(point.positions) != len(names):
                return ("point %d has %s for %s; send one for each"
                        % (number, counted(len(point.positions), "position"), counted(len(names), "joint")))
            try:
                positions = np.array(bounds.JOINT_POSITION.check(point.positions, "point %d" % number), dtype=float)
            except ValueError as error:
                return str(error)
            points.append((positions, max(point.time_from_start.to_sec(), 0.0)))
        self._index = model.index(known)
        self._columns = [names.index(name) for name in known]
        self._anchor = None if frame in _WORLD else frame
        self._playback = PosePlayback(points, max(trajectory.header.stamp.to_sec(), self._now_s))
        return ""

    def reset(self) -> None:
        self._playback = None
        self._commands.take()
