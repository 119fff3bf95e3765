# SPDX-License-Identifier: BSD-3-Clause
"""compute_ik and compute_fk."""
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import rospy
from moveit_msgs.msg import MoveItErrorCodes
from moveit_msgs.srv import GetPositionFK, GetPositionFKResponse, GetPositionIK, GetPositionIKResponse

from command_line.options import counted
from motion_planning.constraints import holder
from motion_planning.errors import PlanningError
from motion_planning.kinematics import ik
from moveit_ros_move_group.context import RequestError, answered
from moveit_ros_move_group.convert.constraints import constraint_set_of
from moveit_ros_move_group.convert.geometry import matrix_of, stamped
from moveit_ros_move_group.convert.scene_out import state_message
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from moveit_msgs.msg import PositionIKRequest
    from moveit_msgs.srv import GetPositionFKRequest, GetPositionIKRequest

    from motion_planning.model import Group
    from motion_planning.scene import Scene
    from moveit_ros_move_group.context import Context

# [s], for a request without a time-out.
_TIMEOUT_S = 0.05
# [s], upper bound of a request's time limit if all solutions are refused: a service cannot be cancelled.
_LONGEST_S = 5.0


class Kinematics:
    """Both services. timeouts: {group: kinematics_solver_timeout [s]}."""

    def __init__(self, context: Context, timeouts: Mapping[str, float]) -> None:
        self.context, self._timeouts = context, timeouts
        self._services = [rospy.Service("compute_ik", GetPositionIK, self._ik),
                          rospy.Service("compute_fk", GetPositionFK, self._fk)]

    @answered("compute_ik", GetPositionIKResponse)
    def _ik(self, request: GetPositionIKRequest, response: GetPositionIKResponse) -> None:
        wanted, context = request.ik_request, self.context
        group = context.group(wanted.group_name)
        scene = context.scene_from(wanted.robot_state, "compute_ik")
        poses = self._poses(wanted, group, scene)
        timeout = wanted.timeout.to_sec() or self._timeouts.get(group.name, _TIMEOUT_S)
        timeout = min(timeout, _LONGEST_S)
        remarks, touching = [], []
        constraints = constraint_set_of(wanted.constraints, scene, context.monitor.reader, remarks)
        context.remark("compute_ik", remarks, group.name)

        def accept(q: np.ndarray) -> str | None:
            state = scene.state.with_q(q)
            if wanted.avoid_collisions and not context.exact.free(scene, state, group.name):
                touching[:] = context.exact.contacts(scene, state, group.name)
                return "; ".join(map(str, touching[:3]))
            return constraints.broken(context.model, state, scene, context.exact) if constraints is not None else None

        try:
            q = ik(context.model, group, poses, scene.state, timeout, accept)
        except PlanningError as error:
            raise RequestError(MoveItErrorCodes.NO_IK_SOLUTION, str(error), touching) from None
        response.solution = state_message(context.model, scene.state.with_q(q), rospy.Time.now(), attached=False)

    def _poses(self, request: PositionIKRequest, group: Group, scene: Scene) -> dict[str, np.ndarray]:
        """{link: pose (4, 4) in the planning frame} that a PositionIKRequest asks for."""
        if request.pose_stamped_vector:
            links, poses = list(request.ik_link_names), request.pose_stamped_vector
            if len(links) != len(poses):
                raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, "%s but %s; name a link for "
                                   "each" % (counted(len(poses), "pose"), counted(len(links), "ik_link_name")))
        else:
            link = request.ik_link_name or group.tip
            if link is None:
                raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, "group '%s' is not a chain; name a link for the "
                                   "pose" % group.name)
            links, poses = [link], [request.pose_stamped]
        found = {}
        for name, pose in zip(links, poses, strict=True):
            try:
                link, within = holder(scene, name)
            except PlanningError as error:
                raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, str(error)) from None
            if link in found:
                raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, "two poses are given for link '%s'" % link)
            frame = self.context.frame(scene, pose.header.frame_id)
            found[link] = frame @ matrix_of(pose.pose, "the pose of '%s'" % name) @ inverse(within)
        return found

    @answered("compute_fk", GetPositionFKResponse)
    def _fk(self, request: GetPositionFKRequest, response: GetPositionFKResponse) -> None:
        context, model = self.context, self.context.model
        scene = context.scene_from(request.robot_state, "compute_fk")
        frame = request.header.frame_id.lstrip("/") or model.frame
        seen_from = inverse(context.frame(scene, frame))
        frames, stamp = scene.link_frames, rospy.Time.now()
        for link in request.fk_link_names:
            if link in model.link_index:
                response.fk_link_names.append(link)
                response.pose_stamped.append(stamped(seen_from @ frames[model.link_index[link]], frame, stamp))
        unknown = [link for link in request.fk_link_names if link not in model.link_index]
        if unknown or not request.fk_link_names:
            raise RequestError(MoveItErrorCodes.INVALID_LINK_NAME, "the robot has no link %s"
                               % ", ".join("'%s'" % link for link in unknown) if unknown else "no link is named")
