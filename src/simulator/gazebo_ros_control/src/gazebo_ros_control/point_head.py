# SPDX-License-Identifier: BSD-3-Clause
"""robot_controllers/PointHeadController: a head that pans and tilts looks at a point."""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from control_msgs.msg import PointHeadAction, PointHeadFeedback

from controller_manager import POSITION, VELOCITY, ControllerError
from gazebo_ros.transforms import TransformSource
from gazebo_ros_control.cascade import motion
from gazebo_ros_control.goal_controller import GoalController
from sim_time.pace import Pace
from urdf_model import UrdfError
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from gazebo_ros_control.cascade import CascadeHardware
    from gazebo_ros_control.goal_controller import Crew
    from loop_ros.action_server import GoalHandle
    from urdf_model import Robot

FEEDBACK_HZ = 50.0
# A joint has arrived within so much [rad]; it may be late by so long, and so may the transform of a target's frame [s].
ARRIVED_RAD, LATE_S = 0.02, 1.0
# Of joints whose description has no limit [rad/s].
SPEED_RAD_S = 1.0
# Of a target's coordinates [m] and the velocity [rad/s]; squares of larger numbers may be infinite.
LARGEST = 1e9


class HeadGeometry:
    """Where a pan joint and the tilt joint on its child point: along x of the tilt joint's child."""

    def __init__(self, robot: Robot, pan: str, tilt: str) -> None:
        """``robot``: ``urdf_model.Robot``. Raises KeyError or UrdfError where it has no such joints."""
        self._robot = robot
        self._pan, self._tilt = robot.joints[pan], robot.joints[tilt]
        robot.chain(self._pan.child, self._tilt.parent)

    def angles(self, point: npt.ArrayLike, positions: Mapping[str, float]) -> tuple[float, float]:
        """(pan, tilt) [rad] that point at ``point`` (3,) in the robot's root frame, with the other joints at
        ``positions`` {name: [rad, m]}.

        Exact where the axes are z and y of their frames and cross; else nearly, as heads are built.
        """
        x, y, _ = self._seen_from(self._pan, point, positions)
        pan = math.copysign(1.0, self._pan.axis[2]) * math.atan2(y, x)
        x, _, z = self._seen_from(self._tilt, point, {**positions, self._pan.name: pan})
        return pan, math.copysign(1.0, self._tilt.axis[1]) * math.atan2(-z, x)

    def error(self, point: npt.ArrayLike, positions: Mapping[str, float]) -> float:
        """The angle between where it points and ``point``, as in :meth:`angles` [rad]."""
        frame = self.pose(self._tilt.child, positions)
        way = np.asarray(point) - frame[:3, 3]
        length = float(np.linalg.norm(way))
        return math.acos(min(1.0, max(-1.0, float(frame[:3, 0] @ way) / length))) if length > 0.0 else 0.0

    def pose(self, link: str, positions: Mapping[str, float]) -> np.ndarray:
        """Pose (4, 4) of a link's frame in the root's. Raises UrdfError for an unknown link."""
        frame = np.eye(4)
        for joint in self._robot.chain(self._robot.root, link):
            frame = frame @ joint.origin @ motion(joint, positions.get(joint.name, 0.0)) @ joint.child_offset
        return frame

    def _seen_from(self, joint, point, positions):
        frame = self.pose(joint.parent, positions) @ joint.origin
        return inverse(frame)[:3] @ np.append(point, 1.0)


class PointHead(GoalController):
    """A goal starts it. Its motion is a cubic from where the joints are: at least ``min_duration`` long, no faster than
    ``max_velocity`` or the joints' limits. Parameters: ``pan_joint``, ``tilt_joint``. As on Fetch, the goal's
    pointing frame and axis do not count: x of the tilted link points at the target.
    """

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: Crew) -> None:
        super().__init__(name, hardware, context, crew)
        joints = context.param("pan_joint", "head_pan_joint"), context.param("tilt_joint", "head_tilt_joint")
        self._index = self.claim(POSITION, joints)
        try:
            self._geometry = HeadGeometry(context.robot, *joints)
        except (KeyError, UrdfError) as error:
            raise ControllerError("%s: %s and %s are no joints of a head, the second on the child of the first: %s"
                                  % (context.namespace, *joints, error)) from error
        limits = [context.robot.joints[joint].limit for joint in joints]
        self._lower = np.array([-math.inf if limit.lower is None else limit.lower for limit in limits])
        self._upper = np.array([math.inf if limit.upper is None else limit.upper for limit in limits])
        self._speed = np.minimum(hardware.velocity_limit[self._index], np.where(
            np.isfinite(hardware.velocity_limit[self._index]), math.inf, SPEED_RAD_S))
        self._waiting: GoalHandle | None = None
        self._tf: TransformSource | None = None
        self._asked_s = 0.0
        self._from = self._to = np.zeros(2)
        self._begin_s, self._length_s, self._point = 0.0, 0.0, np.zeros(3)
        self._pace = Pace(FEEDBACK_HZ)
        self.serve("point_head", PointHeadAction)

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        self._from = self._to = self.hardware.position[self._index].copy()
        self._length_s = 0.0

    def idle(self, time_s: float) -> None:
        super().idle(time_s)
        if self._waiting is not None:
            self._begin(self._waiting)

    def update(self, time_s: float, dt: float) -> None:
        self.idle(time_s)
        share = 1.0
        if self._length_s > 0.0:
            share = min(max((time_s - self._begin_s) / self._length_s, 0.0), 1.0)
        way = self._to - self._from
        self.hardware.command[POSITION][self._index] = self._from + way * share * share * (3.0 - 2.0 * share)
        self.hardware.command[VELOCITY][self._index] = (
            way * 6.0 * share * (1.0 - share) / self._length_s if share < 1.0 else 0.0)
        if self._goal is not None:
            self._watch(self._goal, time_s, share)

    def close(self) -> None:
        self._stop_listening()

    def _on_goal(self, handle: GoalHandle) -> None:
        wanted = handle.goal
        point = wanted.target.point
        numbers = point.x, point.y, point.z, wanted.max_velocity
        if not all(abs(number) < LARGEST for number in numbers):
            handle.reject(text="the target's point and max_velocity are %r, %r, %r and %r; each must be below %g"
                               % (*numbers, LARGEST))
            return
        self._forget_waiting("another goal took its place")
        self._waiting, self._asked_s = handle, self._time_s
        self._begin(handle)

    def _on_cancel(self, handle: GoalHandle) -> None:
        if handle is self._waiting:
            self._forget_waiting("")
        elif handle is self._goal:
            # The head stays where it is.
            self._from = self._to = self.hardware.position[self._index].copy()
            self._length_s = 0.0
            self._end("")

    def _begin(self, handle: GoalHandle) -> None:
        """Start the motion of the goal that waits, if the pose of its frame is known."""
        wanted = handle.goal
        frame = wanted.target.header.frame_id.lstrip("/")
        placed = self._pose_of(frame)
        if placed is None:
            self._asked_s = min(self._asked_s, self._time_s)  # time may have gone back in a reset
            if self._time_s - self._asked_s > LATE_S:
                self._waiting = None
                self._stop_listening()
                handle.reject(text="the target's frame %r is no link of the robot, nor connected with one by tf"
                                   % frame)
            return
        self._waiting = None
        self._stop_listening()
        if not self._take(handle):
            return
        point = wanted.target.point
        self._point = placed[:3] @ (point.x, point.y, point.z, 1.0)
        self._from = self.hardware.position[self._index].copy()
        self._to = np.clip(self._geometry.angles(self._point, self._positions()), self._lower, self._upper)
        speed = np.minimum(self._speed, wanted.max_velocity) if wanted.max_velocity > 0.0 else self._speed
        # A cubic is at most 1.5 times as fast as on average.
        least_s = float((1.5 * np.abs(self._to - self._from) / speed).max())
        self._begin_s, self._length_s = self._time_s, max(least_s, wanted.min_duration.to_sec())
        self._pace.restart()

    def _pose_of(self, frame):
        """Pose (4, 4) of a frame in the robot's root frame, or None where it is not known yet."""
        if frame in self.context.robot.links:
            return self._geometry.pose(frame, self._positions())
        if self._tf is None:
            self._tf = TransformSource(self.context)
        self._tf.take()
        robot = self.context.robot
        # Its root is often a link that tf does not have, as the world's is.
        for link in (robot.root, *robot.links):
            found = self._tf.look_up(link, frame)
            if found is not None:
                return self._geometry.pose(link, self._positions()) @ found
        return None

    def _positions(self):
        return dict(zip(self.hardware.joint_names, self.hardware.position.tolist(), strict=True))

    def _watch(self, handle: GoalHandle, time_s: float, share: float) -> None:
        if self._pace.take(time_s) and self._server.feedback_is_heard:
            handle.publish_feedback(PointHeadFeedback(pointing_angle_error=self._error()))
        off = float(np.abs(self._to - self.hardware.position[self._index]).max())
        if share >= 1.0 and off < ARRIVED_RAD:
            self._goal = None
            handle.succeed(text="it points %.3f rad beside the target" % self._error())
        elif time_s - self._begin_s > self._length_s + LATE_S:
            self._goal = None
            handle.abort(text="the head is %.3f rad from where it was sent, after %.1f s"
                              % (off, time_s - self._begin_s))

    def _error(self):
        return self._geometry.error(self._point, self._positions())

    def _forget_waiting(self, why):
        handle, self._waiting = self._waiting, None
        self._stop_listening()
        if handle is not None:
            handle.cancel(text=why)

    def _stop_listening(self):
        if self._tf is not None:
            self._tf.close()
            self._tf = None
