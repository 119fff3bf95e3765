# SPDX-License-Identifier: BSD-3-Clause
"""compute_cartesian_path."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import rospy
from moveit_msgs.msg import MoveItErrorCodes
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathResponse

from motion_planning.cartesian import CartesianError, Steps, cartesian_path
from motion_planning.constraints import holder
from motion_planning.errors import PlanningError
from motion_planning.timing import LONGEST_S, time_path
from moveit_ros_move_group.context import RequestError, answered
from moveit_ros_move_group.convert.constraints import constraint_set_of
from moveit_ros_move_group.convert.geometry import matrix_of
from moveit_ros_move_group.convert.scene_out import state_message, trajectory_message

if TYPE_CHECKING:
    from moveit_msgs.srv import GetCartesianPathRequest

    from motion_planning.model import Group, PlanningModel, State
    from motion_planning.scene import Scene
    from motion_planning.timing import Timed
    from moveit_ros_move_group.context import Context


class CartesianPathService:
    """A fraction below 1 is not an error; the reason why the path ends there is published as a failure."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("compute_cartesian_path", GetCartesianPath, self._serve)

    @answered("compute_cartesian_path", GetCartesianPathResponse)
    def _serve(self, request: GetCartesianPathRequest, response: GetCartesianPathResponse) -> None:
        context, model = self.context, self.context.model
        group = context.group(request.group_name)
        scene = context.scene_from(request.start_state, "compute_cartesian_path")
        response.start_state = state_message(model, scene.state, rospy.Time.now())
        link = request.link_name or (group.tip or group.links[-1])
        frame = self._frame(request, scene, link)
        waypoints = [frame @ matrix_of(pose, "waypoint %d" % (i + 1)) for i, pose in enumerate(request.waypoints)]
        steps = Steps(request.max_step, request.jump_threshold, self._acceptance(request, scene, group))
        try:
            path = cartesian_path(model, group.name, scene.state, self._rigid_link(scene, link, waypoints), waypoints,
                                  steps)
        except CartesianError as error:
            raise RequestError(MoveItErrorCodes.FAILURE, str(error)) from None
        timed = time_path(path.joints, model.velocity[group.indices], model.acceleration[group.indices],
                          "iterative_time_parameterization")
        speed = request.max_cartesian_speed
        if speed > 0.0 and len(timed.times) > 1:
            limited = request.cartesian_speed_limited_link or link
            timed = slowed(model, scene.state, group, limited, timed, speed)
        response.fraction = path.fraction
        # Without a stamp: a controller takes one for the time to begin at, and would leave out points that are due
        # already.
        response.solution = trajectory_message(group.joints, timed, model.frame)
        context.show_path(scene.state, response.solution)
        if path.reason is not None:
            context.failures.tell("compute_cartesian_path", MoveItErrorCodes.SUCCESS,
                                  "the path ends at fraction %.3f: %s" % (path.fraction, path.reason), group.name)

    def _frame(self, request: GetCartesianPathRequest, scene: Scene, link: str) -> np.ndarray:
        """The frame (4, 4) of the waypoints: the header's; where that is the link itself, as it is at the start."""
        if link not in self.context.model.link_index and not scene.has_frame(link):
            raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, "the robot has no link '%s'" % link)
        return self.context.frame(scene, request.header.frame_id)

    def _rigid_link(self, scene: Scene, link: str, waypoints: list[np.ndarray]) -> str:
        """A link of the robot for one that may be an object it holds; the waypoints are changed to fit."""
        if link in self.context.model.link_index:
            return link
        try:
            link, within = holder(scene, link)
        except PlanningError as error:
            raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, str(error)) from None
        waypoints[:] = [waypoint @ np.linalg.inv(within) for waypoint in waypoints]
        return link

    def _acceptance(self, request: GetCartesianPathRequest, scene: Scene,
                    group: Group) -> Callable[[np.ndarray], str | None] | None:
        remarks = []
        constraints = constraint_set_of(request.path_constraints, scene, self.context.monitor.reader, remarks)
        self.context.remark("compute_cartesian_path", remarks, group.name)
        model, exact = self.context.model, self.context.exact
        if not request.avoid_collisions and constraints is None:
            return None

        def accept(q: np.ndarray) -> str | None:
            state = scene.state.with_q(q, group.indices)
            if request.avoid_collisions and not exact.free(scene, state, group.name):
                return "; ".join(map(str, exact.contacts(scene, state, group.name, 3)))
            return constraints.broken(model, state, scene, exact) if constraints is not None else None

        return accept


def slowed(model: PlanningModel, state: State, group: Group, link: str, timed: Timed, speed: float) -> Timed:
    """Return ``timed``, stretched so that the origin of ``link`` is nowhere faster than ``speed`` [m/s].

    Raises RequestError if that would exceed the longest duration of a motion.
    """
    times = np.linspace(0.0, timed.duration, max(2, 4 * len(timed.times)))
    points = np.array([model.frame_of(state.with_q(q, group.indices).q, link, state.base)[:3, 3]
                       for q in timed.sampled(times)[0]])
    fastest = float((np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(times)).max())
    if timed.duration * fastest > speed * LONGEST_S:
        raise RequestError(MoveItErrorCodes.FAILURE, "at %.3g m/s the path would take more than %g s; is "
                           "max_cartesian_speed meant?" % (speed, LONGEST_S))
    return timed.stretched(fastest / speed) if fastest > speed else timed
