# SPDX-License-Identifier: BSD-3-Clause
"""plan_kinematic_path, and the actions move_group and execute_trajectory."""
from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import actionlib
import rospy
from moveit_msgs.msg import (
    ExecuteTrajectoryAction,
    ExecuteTrajectoryFeedback,
    ExecuteTrajectoryResult,
    MotionPlanResponse,
    MoveGroupAction,
    MoveGroupFeedback,
    MoveGroupResult,
    MoveItErrorCodes,
)
from moveit_msgs.srv import ExecuteKnownTrajectory, ExecuteKnownTrajectoryResponse, GetMotionPlan, GetMotionPlanResponse
from std_msgs.msg import String

from motion_planning.errors import PlanningError
from moveit_ros_move_group.context import RequestError, answered, tell
from moveit_ros_move_group.convert.scene_out import state_message, trajectory_message
from moveit_ros_move_group.planning import scene_with_diff
from moveit_ros_move_group.rest_of_the_way import NewWay, Onward, RestOfTheWay
from moveit_ros_move_group.texts import result_text

if TYPE_CHECKING:
    from moveit_msgs.msg import (
        ExecuteTrajectoryGoal,
        MotionPlanRequest,
        MoveGroupGoal,
        PlanningOptions,
        RobotTrajectory,
    )
    from moveit_msgs.srv import ExecuteKnownTrajectoryRequest, GetMotionPlanRequest

    from motion_planning.model import Group
    from motion_planning.pipeline import Plan
    from motion_planning.replanning import Redirection, Running
    from motion_planning.scene import Scene
    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.execution import Executor
    from moveit_ros_move_group.planning import Planner

# Time limit [s] for a joint state newer than the goal.
_STATE_TIMEOUT_S = 1.0
# Number of replanning attempts if neither the goal nor a parameter sets it.
_REPLAN_ATTEMPTS = 5
# What is the same with every goal is logged again after so long [s].
_SAY_AGAIN_S = 60.0


class PlanService:
    """``plan_kinematic_path``"""

    def __init__(self, context: Context, planner: Planner) -> None:
        self.context, self._planner = context, planner
        self._service = rospy.Service("plan_kinematic_path", GetMotionPlan, self._serve)

    def _serve(self, request: GetMotionPlanRequest) -> GetMotionPlanResponse:
        response = MotionPlanResponse()
        wanted = request.motion_plan_request
        response.group_name = wanted.group_name
        begin = time.monotonic()
        try:
            scene = self.context.scene_from(wanted.start_state, "plan_kinematic_path")
            response.trajectory_start = state_message(self.context.model, scene.state, rospy.Time.now())
            plan = self._planner.plan(wanted, scene)
            response.trajectory = show(self.context, wanted.group_name, plan)
            response.planning_time = plan.planning_time
            response.error_code.val = MoveItErrorCodes.SUCCESS
        except Exception as error:  # the node must survive any error of a request
            response.error_code.val = failed(self.context, "plan_kinematic_path", error, wanted.group_name)[0]
            response.planning_time = time.monotonic() - begin
        return GetMotionPlanResponse(response)


class MoveAction:
    """The action ``move_group``: plan, or plan and execute. replan_attempts: where a goal does not say how many."""

    def __init__(self, context: Context, planner: Planner, may_execute: bool) -> None:
        self.context, self._planner, self._may_execute = context, planner, may_execute
        self.replan_attempts = rospy.get_param("~plan_execution/max_replan_attempts", _REPLAN_ATTEMPTS)
        self._changed = threading.Event()
        self._told = ""
        context.monitor.on_change(self._changed.set)
        self._server = actionlib.SimpleActionServer("move_group", MoveGroupAction, self._run, auto_start=False)
        self._server.start()

    def _run(self, goal: MoveGroupGoal) -> None:
        result = MoveGroupResult()
        group = goal.request.group_name
        plan_only = goal.planning_options.plan_only or not self._may_execute or self.context.executor is None
        reason = ""
        try:
            self._feedback("PLANNING")
            self.context.group(group)
            self._wait_for_state(group)
            with self.context.monitor.asking_for(self._server.is_preempt_requested):
                reason = self._plan_only(goal, result) if plan_only else self._plan_and_execute(goal, result)
        except Exception as error:  # the node must survive any error of a request
            if self._server.is_preempt_requested():
                error = RequestError(MoveItErrorCodes.PREEMPTED, "stopped on request (%s)" % error)
            result.error_code.val, reason = failed(self.context, "move_group", error, group)
        finally:
            self._feedback("IDLE")
        empty = len(result.planned_trajectory.joint_trajectory.points) < 2
        code = result.error_code.val
        finish(self._server, result, result_text(code, reason, empty=empty and not (
            plan_only and code == MoveItErrorCodes.SUCCESS), plan_only=plan_only))

    def _wait_for_state(self, group: str) -> None:
        joints = self.context.model.groups[group].joints
        late = self.context.monitor.wait_for_state(rospy.Time.now(), _STATE_TIMEOUT_S, joints,
                                                   self._server.is_preempt_requested)
        if self._server.is_preempt_requested():
            raise RequestError(MoveItErrorCodes.PREEMPTED, "stopped on request before anything was planned")
        if late:
            rospy.logwarn("move_group: %s", late)

    def _plan_only(self, goal: MoveGroupGoal, result: MoveGroupResult) -> str:
        context, options = self.context, goal.planning_options
        scene = context.scene_from(goal.request.start_state, "move_group")
        scene = scene_with_diff(context, scene, options.planning_scene_diff, "move_group", keep_robot=False)
        plan = self._plan(goal.request, scene, result)
        result.error_code.val = MoveItErrorCodes.SUCCESS
        return "; ".join(plan.remarks)

    def _plan(self, request: MotionPlanRequest, scene: Scene, result: MoveGroupResult) -> Plan:
        result.trajectory_start = state_message(self.context.model, scene.state, rospy.Time.now())
        plan = self._planner.plan(request, scene, self._server.is_preempt_requested)
        result.planned_trajectory = show(self.context, request.group_name, plan)
        result.planning_time = plan.planning_time
        return plan

    def _plan_and_execute(self, goal: MoveGroupGoal, result: MoveGroupResult) -> str:
        """Fill the result; return the reason if it fails, else what was planned otherwise than asked."""
        context, options, request = self.context, goal.planning_options, goal.request
        executor = context.require_executor()
        if request.start_state.joint_state.name and not request.start_state.is_diff:
            rospy.logwarn("move_group: the start state is for planning alone; the robot starts where it is")
        if options.look_around:
            rospy.logwarn_throttle(_SAY_AGAIN_S, "move_group: look_around: nothing here points a sensor; planned with "
                                   "what the scene knows")
        group = context.model.groups[request.group_name]
        require_state(context, group)
        left = _Attempts(max(0, options.replan_attempts or self.replan_attempts) if options.replan else 0)
        while True:
            self._changed.clear()
            scene = context.monitor.scene()
            scene = scene_with_diff(context, scene, options.planning_scene_diff, "move_group", keep_robot=True)
            plan = self._plan(request, scene, result)
            if len(plan.timed.times) < 2:
                result.error_code.val = MoveItErrorCodes.SUCCESS
                return "; ".join(plan.remarks)
            self._feedback("MONITOR")
            watch = RestOfTheWay(context.exact, group, plan.timed, self._scene_after_change(options),
                                 self._onward(request, left, result) if options.replan else None,
                                 executor.began)
            try:
                outcome = executor.execute(result.planned_trajectory, self._server.is_preempt_requested,
                                           self._telling(watch))
            finally:
                watch.end_search()
            result.executed_trajectory = result.planned_trajectory
            result.error_code.val = outcome.code
            again = outcome.code == MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
            if not again or not left.take():
                break
            rospy.loginfo("move_group: %s; planning again", outcome.text)
            self._pause(options.replan_delay)
            self._feedback("PLANNING")
        if outcome.code != MoveItErrorCodes.SUCCESS:
            context.failures.tell("move_group", outcome.code, outcome.text, request.group_name, watch.contacts,
                                  outcome.joints)
        return "; ".join(plan.remarks) if outcome.code == MoveItErrorCodes.SUCCESS else outcome.text

    def _scene_after_change(self, options: PlanningOptions) -> Callable[[], Scene | None]:
        """A function that returns the scene if it has changed since the last call, else None."""
        def changed() -> Scene | None:
            if not self._changed.is_set():
                return None
            self._changed.clear()
            scene = self.context.monitor.scene()
            return scene_with_diff(self.context, scene, options.planning_scene_diff, "move_group", keep_robot=True)

        return changed

    def _onward(self, request: MotionPlanRequest, left: _Attempts, result: MoveGroupResult) -> Onward:
        """How another way is found for joints that move."""
        def search(scene: Scene, running: Running, stop: Callable[[], bool]) -> Redirection:
            if not left.any():
                raise RequestError(MoveItErrorCodes.FAILURE, "all attempts to plan again are used up")
            return self._planner.redirected(request, scene, running,
                                            lambda: stop() or self._server.is_preempt_requested())

        def follows(found: Redirection, seconds: float) -> None:
            # Where there is no way while the joints move, the attempt is the plan from rest.
            left.take()
            rospy.loginfo("move_group: something new is in the way; another one was found in %.3f s, %s",
                          seconds, "without a stop" if found.overlap else "with a stop")
            result.planned_trajectory = trajectory_message(self.context.model.groups[request.group_name].joints,
                                                           found.timed, self.context.model.frame)
            self.context.show_path(found.plan.start, result.planned_trajectory)

        return Onward(search, lambda: self._feedback("PLANNING"), follows)

    def _telling(self, watch: RestOfTheWay) -> Callable[[], str | NewWay | None]:
        """``watch.hit``, of which a client hears when a search has ended and the joints go on."""
        def told() -> str | NewWay | None:
            found = watch.hit()
            if not watch.searching and (found is None or isinstance(found, NewWay) and not found.stops):
                self._feedback("MONITOR")
            return found

        return told

    def _pause(self, seconds: float) -> None:
        end = time.monotonic() + max(0.0, min(seconds, 60.0))
        while time.monotonic() < end and not self._server.is_preempt_requested() and not rospy.is_shutdown():
            time.sleep(0.01)

    def _feedback(self, state: str) -> None:
        """Tell the client what is done now. A plan from rest after none was found on the way is one state."""
        if state != self._told and self._server.is_active():
            self._server.publish_feedback(MoveGroupFeedback(state))
        self._told = state


class _Attempts:
    """How often may still be planned again, moving or not."""

    def __init__(self, count: int) -> None:
        self._left = count

    def any(self) -> bool:
        """Whether there is one more."""
        return self._left > 0

    def take(self) -> bool:
        """Whether there was one more, which is used then."""
        self._left -= 1
        return self._left >= 0


class ExecuteAction:
    """The action ``execute_trajectory``."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._server = actionlib.SimpleActionServer("execute_trajectory", ExecuteTrajectoryAction, self._run,
                                                    auto_start=False)
        self._server.start()

    def _run(self, goal: ExecuteTrajectoryGoal) -> None:
        result, reason = ExecuteTrajectoryResult(), ""
        try:
            executor = self.context.require_executor()
            if not (goal.trajectory.joint_trajectory.points or goal.trajectory.multi_dof_joint_trajectory.points):
                raise RequestError(MoveItErrorCodes.CONTROL_FAILED, "the trajectory to execute has no points; was it "
                                   "planned with success?")
            self._server.publish_feedback(ExecuteTrajectoryFeedback("MONITOR"))
            outcome = executor.execute(goal.trajectory, self._server.is_preempt_requested)
            result.error_code.val, reason = outcome.code, outcome.text
            if outcome.code != MoveItErrorCodes.SUCCESS:
                self.context.failures.tell("execute_trajectory", outcome.code, outcome.text, joints=outcome.joints)
        except Exception as error:  # the node must survive any error of a request
            result.error_code.val, reason = failed(self.context, "execute_trajectory", error)
        self._server.publish_feedback(ExecuteTrajectoryFeedback("IDLE"))
        finish(self._server, result, result_text(result.error_code.val, reason))


class ExecuteService:
    """``execute_kinematic_path``, which old clients look for."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("execute_kinematic_path", ExecuteKnownTrajectory, self._serve)

    @answered("execute_kinematic_path", ExecuteKnownTrajectoryResponse)
    def _serve(self, request: ExecuteKnownTrajectoryRequest, response: ExecuteKnownTrajectoryResponse) -> None:
        self.context.require_executor()
        if request.wait_for_execution:
            response.error_code.val = self._execute(request.trajectory)
        else:
            threading.Thread(target=self._execute, args=(request.trajectory,), daemon=True).start()

    def _execute(self, trajectory: RobotTrajectory) -> int:
        try:
            outcome = self.context.require_executor().execute(trajectory)
        except Exception as error:  # the caller may have ended, so the node logs it
            return failed(self.context, "execute_kinematic_path", error)[0]
        if outcome.code != MoveItErrorCodes.SUCCESS:
            self.context.failures.tell("execute_kinematic_path", outcome.code, outcome.text, joints=outcome.joints)
        return outcome.code


class StopEvent:
    """The topic ``trajectory_execution_event``: "stop" ends what is being executed."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._subscriber = rospy.Subscriber("trajectory_execution_event", String, self._on_event, queue_size=10)

    def _on_event(self, message: String) -> None:
        if message.data == "stop":
            self._executor.stop()
        else:
            rospy.logwarn("trajectory_execution_event knows 'stop', not '%s'", message.data)


def require_state(context: Context, group: Group) -> None:
    """Raise RequestError where no joint state has told of a joint of a Group."""
    silent = [name for name in group.joints if name in context.monitor.missing_joints()]
    if silent:
        raise RequestError(MoveItErrorCodes.INVALID_ROBOT_STATE, "the complete state of the robot is not yet "
                           "known: no joint state has come for %s on %s"
                           % (", ".join(silent), context.monitor.joint_state_topic))


def show(context: Context, group: str, plan: Plan) -> RobotTrajectory:
    """Publish a pipeline.Plan as the planned path; return its RobotTrajectory."""
    trajectory = trajectory_message(context.model.groups[group].joints, plan.timed, context.model.frame)
    context.show_path(plan.start, trajectory)
    return trajectory


def failed(context: Context, request: str, error: Exception, group: str = "") -> tuple[int, str]:
    """Tell of an exception; return (code, reason)."""
    if isinstance(error, PlanningError):
        return tell(context, request, error, group), str(error)
    text = "%s: %s" % (type(error).__name__, error)
    context.failures.tell(request, MoveItErrorCodes.FAILURE, text, group)
    return MoveItErrorCodes.FAILURE, text


def finish(server: actionlib.SimpleActionServer, result: Any, text: str, code: int | None = None) -> None:
    """End an action's goal as MoveIt does: succeeded, preempted or aborted. code: the result's unless given."""
    code = result.error_code.val if code is None else code
    if code == MoveItErrorCodes.SUCCESS:
        server.set_succeeded(result, text)
    elif code == MoveItErrorCodes.PREEMPTED:
        server.set_preempted(result, text)
    else:
        server.set_aborted(result, text)
