# SPDX-License-Identifier: BSD-3-Clause
"""State that the node's services and actions share."""
from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from moveit_msgs.msg import DisplayTrajectory, MoveItErrorCodes

from motion_planning.errors import PlanningError
from moveit_ros_move_group.convert.scene_out import state_message
from moveit_ros_move_group.texts import one_line

if TYPE_CHECKING:
    from moveit_msgs.msg import RobotState, RobotTrajectory

    from motion_planning.exact import Contact, ExactChecker
    from motion_planning.model import Group, PlanningModel, State
    from motion_planning.scene import Scene
    from moveit_ros_move_group.execution import Executor
    from moveit_ros_move_group.failures import Failures
    from moveit_ros_move_group.monitor import SceneMonitor
    from moveit_ros_move_group.settings import Pipeline


class RequestError(PlanningError):
    """A request that cannot be done, with a value of MoveItErrorCodes."""

    def __init__(self, code: int, text: str, contacts: Iterable[Contact] = (),
                 joints: Mapping[str, float] | None = None) -> None:
        super().__init__(text)
        self.code, self.contacts, self.joints = code, list(contacts), dict(joints or {})


@dataclass
class Context:
    """model: PlanningModel; monitor: SceneMonitor; exact: ExactChecker; failures: Failures; pipelines: {name:
    Pipeline}, default_pipeline: name; executor: Executor, None if the node only plans."""

    model: PlanningModel
    monitor: SceneMonitor
    exact: ExactChecker
    failures: Failures
    pipelines: dict[str, Pipeline]
    default_pipeline: str
    executor: Executor | None

    def __post_init__(self) -> None:
        self._paths = rospy.Publisher("~display_planned_path", DisplayTrajectory, queue_size=10, latch=True)

    def require_executor(self) -> Executor:
        """Return the Executor. Raises RequestError if the node only plans."""
        if self.executor is None:
            raise RequestError(MoveItErrorCodes.CONTROL_FAILED, "~allow_trajectory_execution is false")
        return self.executor

    def group(self, name: str) -> Group:
        """Return a Group. Raises RequestError."""
        if name not in self.model.groups:
            raise RequestError(MoveItErrorCodes.INVALID_GROUP_NAME, "robot '%s' has no group '%s'; its groups are %s"
                               % (self.model.name, name, ", ".join(self.model.groups) or "none"))
        return self.model.groups[name]

    def scene_from(self, state: RobotState, request: str) -> Scene:
        """Return the scene with the robot in the RobotState of a request, over where it is now or a scene message has
        placed it since its joints moved.

        Raises RequestError for one that cannot be understood. A state without joints that is not a diff is taken for
        the current one with a warning: many clients forget the flag.
        """
        scene, errors = self.monitor.scene(as_told=True), []
        empty = not (state.joint_state.name or state.multi_dof_joint_state.joint_names)
        if empty and not state.is_diff and not state.attached_collision_objects:
            rospy.logwarn_throttle(60.0, "%s: the robot state is empty and no diff; taken as the current state"
                                   % request)
            return scene
        scene = self.monitor.reader.with_robot_state(scene, state, errors)
        if errors:
            raise RequestError(MoveItErrorCodes.INVALID_ROBOT_STATE, errors[0])
        return scene

    def remark(self, request: str, remarks: Iterable[str], group: str = "") -> None:
        """Log what was left out of a request or done otherwise than asked."""
        for text in remarks:
            rospy.logwarn("%s%s: %s", request, " of group '%s'" % group if group else "", one_line(text))

    def frame(self, scene: Scene, name: str) -> np.ndarray:
        """Return the pose (4, 4) of a frame in the planning frame. Raises RequestError."""
        try:
            return self.monitor.reader.frame(scene, name)
        except PlanningError as error:
            raise RequestError(MoveItErrorCodes.FRAME_TRANSFORM_FAILURE, str(error)) from None

    def show_path(self, start: State, *trajectories: RobotTrajectory) -> None:
        """Publish RobotTrajectories, of which the first begins in a State, as the planned path."""
        self._paths.publish(DisplayTrajectory(self.model.name, list(trajectories),
                                              state_message(self.model, start, attached=True)))


def answered(name: str,
             response_type: type[rospy.Message]) -> Callable[[Callable[..., None]], Callable[..., rospy.Message]]:
    """A decorator for methods ``f(self, request, response)`` that serve ``name``: failures become error codes.

    The response's ``error_code``, if it has one, is SUCCESS unless the method raises RequestError, which is passed to
    the context's failures, or any other exception, which becomes FAILURE.
    """
    def decorate(method: Callable[..., None]) -> Callable[..., rospy.Message]:
        @functools.wraps(method)
        def serve(self: Any, request: rospy.Message) -> rospy.Message:
            response = response_type()
            code = MoveItErrorCodes.SUCCESS
            try:
                method(self, request, response)
            except PlanningError as error:
                code = tell(self.context, name, error, _group_of(request))
            except Exception as error:  # the node must survive any error of a request
                code = tell(self.context, name, RequestError(MoveItErrorCodes.FAILURE, "%s: %s" % (
                    type(error).__name__, error)), _group_of(request))
            answer = getattr(response, "error_code", None)
            if answer is not None:
                answer.val = answer.val or code
            return response
        return serve
    return decorate


def tell(context: Context, name: str, error: Exception, group: str = "") -> int:
    """Tell the context's failures of a PlanningError; return its code."""
    code = int(getattr(error, "code", MoveItErrorCodes.FAILURE))
    context.failures.tell(name, code, str(error), group, getattr(error, "contacts", ()), getattr(error, "joints", None))
    return code


def _group_of(request: rospy.Message) -> str:
    return getattr(request, "group_name", "") or getattr(getattr(request, "ik_request", None), "group_name", "")


def wall_clock() -> float:
    """Planning takes wall time, whatever the simulation's clock does."""
    return time.monotonic()
