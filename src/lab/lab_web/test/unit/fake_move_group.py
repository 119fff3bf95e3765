# SPDX-License-Identifier: BSD-3-Clause
"""The action of a move_group that plans straight lines, and fails as the real one does; moves nothing."""
import actionlib
import rospy
from moveit_msgs.msg import MoveGroupAction, MoveGroupResult, MoveItErrorCodes
from trajectory_msgs.msg import JointTrajectoryPoint

from lab_testing.waiting import wait_until

# Goals of the first joint [rad] that are not reached: something is there; the planner looks until it is stopped.
BLOCKED_RAD, ENDLESS_RAD = 1.1, 1.2
DURATION_S = 2.0
IN_COLLISION = "link 'left_hand' and object 'crate' overlap by 0.0113 m"


class FakeMoveGroup:
    """``positions()``: {joint: [rad]}; ``say(kind, ...)`` tells what it gets."""

    def __init__(self, positions, say):
        self._positions = positions
        self._say = say
        self._server = actionlib.SimpleActionServer("/move_group", MoveGroupAction, self._plan, auto_start=False)
        self._server.start()

    def _plan(self, goal):
        request, codes = goal.request, MoveItErrorCodes
        targets = {row.joint_name: row.position for row in request.goal_constraints[0].joint_constraints}
        self._say("plan", request.group_name, targets, goal.planning_options.plan_only, request.start_state.is_diff)
        first = next(iter(targets.values()))
        if first == BLOCKED_RAD:
            self._server.set_aborted(result_of(codes.GOAL_IN_COLLISION), "GOAL_IN_COLLISION: the goal is in "
                                     "collision: " + IN_COLLISION)
        elif first == ENDLESS_RAD:
            wait_until(lambda: self._server.is_preempt_requested() or rospy.is_shutdown(), "the goal to be cancelled")
            self._say("preempted")
            self._server.set_preempted(result_of(codes.PREEMPTED), "PREEMPTED")
        else:
            result = result_of(codes.SUCCESS)
            trajectory = result.planned_trajectory.joint_trajectory
            trajectory.joint_names = list(targets)
            begin = self._positions()
            for share in (0.0, 0.5, 1.0):
                speed = 1.5 / DURATION_S if share == 0.5 else 0.0
                trajectory.points.append(JointTrajectoryPoint(
                    positions=[begin[name] + share * (end - begin[name]) for name, end in targets.items()],
                    velocities=[speed * (end - begin[name]) for name, end in targets.items()],
                    time_from_start=rospy.Duration(share * DURATION_S)))
            self._server.set_succeeded(result, "Motion plan was computed succesfully.")


def result_of(code):
    """A result with this error code."""
    result = MoveGroupResult()
    result.error_code.val = code
    return result
