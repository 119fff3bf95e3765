# SPDX-License-Identifier: BSD-3-Clause
"""Plans of a move_group for :class:`lab_web.planning.PagePlanning`, in rospy."""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from moveit_msgs.msg import Constraints, JointConstraint, MoveGroupAction, MoveGroupGoal, MoveItErrorCodes

from baxter_model import SIDES, joint_names
from lab_web.motion import SPEED_SHARE
from lab_web.planning import PagePlan, PlanFailed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from moveit_msgs.msg import MoveGroupResult

#: The action of a move_group, and the topic by which one is known to be there.
ACTION = "/move_group"
RESULT_TOPIC, RESULT_TYPE = ACTION + "/result", "moveit_msgs/MoveGroupActionResult"
PLANNING_S = 5.0
# Until its connections are there; until it must have answered [s, wall time: the simulation may be paused]. Both
# may take long on a busy machine, and the user can stop the planning.
_CONNECT_S, _ANSWER_S = 15.0, 12.0 * PLANNING_S
# A goal is met within this [rad].
_NEAR_RAD = 1e-3
_GROUPS = {**{(side,): "%s_arm" % side for side in SIDES}, tuple(SIDES): "both_arms"}
_CODES = {value: name.lower() for name, value in vars(MoveItErrorCodes).items()
          if name.isupper() and isinstance(value, int)}


class MoveGroupPlanner:
    """One goal at a time."""

    def __init__(self) -> None:
        self._client: actionlib.SimpleActionClient | None = None
        self._cancelled = threading.Event()

    def plan(self, targets: Mapping[str, float]) -> PagePlan:
        """The PagePlan to ``targets`` {joint: [rad]} of the arms. Waits. Raises PlanFailed."""
        self._cancelled.clear()
        goal = goal_of(targets)
        client = self._client = self._client or actionlib.SimpleActionClient(ACTION, MoveGroupAction)
        self._require_server(client.action_client)
        done = threading.Event()
        client.send_goal(goal, done_cb=lambda *_: done.set())
        deadline = time.monotonic() + _ANSWER_S
        # Until it is done: rospy's own waits end by simulated time.
        while not done.wait(0.05):
            if self._cancelled.is_set() or rospy.is_shutdown():
                client.cancel_goal()
                raise PlanFailed("preempted", "the planning was stopped")
            if time.monotonic() > deadline:
                client.cancel_goal()
                raise PlanFailed("no_answer", "move_group has not answered for %g s" % _ANSWER_S)
        return plan_of(client.get_state(), client.get_result(), client.get_goal_status_text())

    def cancel(self) -> None:
        """End the wait of ``plan`` in another thread."""
        self._cancelled.set()

    def _require_server(self, client: actionlib.ActionClient) -> None:
        deadline = time.monotonic() + _CONNECT_S
        while not (client.pub_goal.get_num_connections() and client.result_sub.get_num_connections()):
            if time.monotonic() > deadline or self._cancelled.is_set():
                raise PlanFailed("no_answer", "there is no move_group to plan with")
            time.sleep(0.05)


def goal_of(targets: Mapping[str, float]) -> MoveGroupGoal:
    """The action's goal for ``targets`` {joint: [rad]}: a plan alone, from where the arms are. Raises PlanFailed."""
    sides = tuple(side for side in SIDES if not set(joint_names(side)).isdisjoint(targets))
    others = set(targets).difference(*map(joint_names, SIDES))
    if not sides or others:
        raise PlanFailed("invalid", "a plan is for the joints of the arms, not for %s" % ", ".join(sorted(others)))
    goal = MoveGroupGoal()
    request, options = goal.request, goal.planning_options
    request.group_name = _GROUPS[sides]
    request.start_state.is_diff = True
    request.goal_constraints = [Constraints(joint_constraints=[
        JointConstraint(name, angle, _NEAR_RAD, _NEAR_RAD, 1.0) for name, angle in targets.items()])]
    request.num_planning_attempts, request.allowed_planning_time = 1, PLANNING_S
    request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = SPEED_SHARE
    options.plan_only = True
    options.planning_scene_diff.is_diff = options.planning_scene_diff.robot_state.is_diff = True
    return goal


def plan_of(state: int, result: MoveGroupResult | None, text: str) -> PagePlan:
    """The PagePlan in a result of the action. Raises PlanFailed."""
    code = result.error_code.val if result is not None else MoveItErrorCodes.FAILURE
    if result is None or state != GoalStatus.SUCCEEDED or code != MoveItErrorCodes.SUCCESS:
        name = _CODES.get(code, "failure")
        raise PlanFailed(name, text.removeprefix(name.upper()).lstrip(": ") or "code %d" % code)
    trajectory: Any = result.planned_trajectory.joint_trajectory
    points = trajectory.points
    if len(points) < 2:
        raise PlanFailed("already_there", "the arms are there")
    velocities = [point.velocities for point in points]
    return PagePlan(list(trajectory.joint_names), [point.time_from_start.to_sec() for point in points],
                    [point.positions for point in points], velocities if all(velocities) else None)
