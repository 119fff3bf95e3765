# SPDX-License-Identifier: BSD-3-Clause
"""The actions pickup and place."""
from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import actionlib
import numpy as np
import rospy
from moveit_msgs.msg import (
    Constraints,
    JointConstraint,
    MotionPlanRequest,
    MoveItErrorCodes,
    PickupAction,
    PickupFeedback,
    PickupResult,
    PlaceAction,
    PlaceFeedback,
    PlaceLocation,
    PlaceResult,
)
from visualization_msgs.msg import MarkerArray

from motion_planning.errors import PlanningError
from motion_planning.manipulation import (
    ManipulationFailure,
    ManipulationTools,
    PickTask,
    PlaceTask,
    hand_links,
    places_on,
    plan_manipulation,
)
from motion_planning.scene import SceneError
from moveit_ros_move_group.capabilities.motion import failed, finish, require_state
from moveit_ros_move_group.context import RequestError, wall_clock
from moveit_ros_move_group.convert.geometry import stamped
from moveit_ros_move_group.convert.grasps import grasp_candidate, hand_trajectory, place_candidate, usual_grasp
from moveit_ros_move_group.convert.scene_out import state_message, trajectory_message
from moveit_ros_move_group.grasp_markers import hands
from moveit_ros_move_group.planning import scene_with_diff
from moveit_ros_move_group.rest_of_the_way import RestOfTheWay
from moveit_ros_move_group.texts import result_text

if TYPE_CHECKING:
    from moveit_msgs.msg import Grasp, PickupGoal, PlaceGoal, RobotTrajectory
    from trajectory_msgs.msg import JointTrajectory

    from motion_planning.exact import Contact
    from motion_planning.manipulation import Candidate, Manipulation, ManipulationStage
    from motion_planning.pipeline import Plan
    from motion_planning.scene import Scene
    from motion_planning.srdf import EndEffector
    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.execution import ExecutionOutcome
    from moveit_ros_move_group.planning import Planner

# [s], if a goal has none.
_USUAL_TIME_S = 5.0
# Time limit [s] for a joint state newer than the goal.
_STATE_TIMEOUT_S = 1.0
# Tolerance [rad or m] between the path's end and the start of the approach.
_JOINED = 1e-4
# If move_group itself chooses the place: length of the vertical approach and retreat, desired and least [m].
_WAY_M, _MIN_WAY_M = 0.1, 0.03


class PickPlaceActions:
    """Both actions. ``~pick_place/max_velocity_scaling_factor`` and ``~pick_place/max_acceleration_scaling_factor``
    (1.0) say how fast, as their goals do not."""

    def __init__(self, context: Context, planner: Planner, may_execute: bool) -> None:
        self.context, self.planner = context, planner
        self.may_execute = may_execute and context.executor is not None
        self.scaling = (_share("~pick_place/max_velocity_scaling_factor"),
                        _share("~pick_place/max_acceleration_scaling_factor"))
        self.hands = rospy.Publisher("~display_grasp_markers", MarkerArray, queue_size=1, latch=True)
        self._actions = [_Action(self, _Pick), _Action(self, _Place)]


class _Action:
    """One of the two actions."""

    def __init__(self, shared: PickPlaceActions, kind: type[_Pick] | type[_Place]) -> None:
        self._shared, self._kind, self._context = shared, kind, shared.context
        self._changed = threading.Event()
        self._context.monitor.on_change(self._changed.set)
        self._server = actionlib.SimpleActionServer(kind.name, kind.action, self._run, auto_start=False)
        self._server.start()

    def _run(self, goal: PickupGoal | PlaceGoal) -> None:
        result, reason, name = self._kind.result(), "", self._kind.name
        plan_only = goal.planning_options.plan_only or not self._shared.may_execute
        begin = wall_clock()
        try:
            self._feedback("PLANNING")
            self._wait_for_state(goal.group_name)
            job = self._kind(self._context, goal)
            found = self._plan(job, goal)
            result.planning_time = wall_clock() - begin
            self._fill(result, job, found)
            result.error_code.val = MoveItErrorCodes.SUCCESS
            if not plan_only:
                self._feedback("MONITOR")
                result.error_code.val, reason = self._execute(job, found)
        except Exception as error:  # the node must survive any error of a request
            result.error_code.val, reason = failed(self._context, name, error, goal.group_name)
            result.planning_time = result.planning_time or wall_clock() - begin
        finally:
            self._feedback("IDLE")
        empty = not result.trajectory_stages
        finish(self._server, result, result_text(result.error_code.val, reason, empty=empty, plan_only=plan_only))

    def _wait_for_state(self, group: str) -> None:
        monitor, groups = self._context.monitor, self._context.model.groups
        joints = groups[group].joints if group in groups else ()
        late = monitor.wait_for_state(rospy.Time.now(), _STATE_TIMEOUT_S, joints, self._server.is_preempt_requested)
        if late:
            rospy.logwarn("%s: %s", self._kind.name, late)

    # -- planning -----------------------------------------------------------------------------------------------

    def _plan(self, job: _Pick | _Place, goal: PickupGoal | PlaceGoal) -> Manipulation:
        seconds = goal.allowed_planning_time
        seconds = seconds if math.isfinite(seconds) and seconds > 0.0 else _USUAL_TIME_S
        stop = self._server.is_preempt_requested

        def plan(scene: Scene, q: np.ndarray, seconds: float) -> Plan:
            return self._shared.planner.plan(self._request(job, goal, q, seconds), scene, stop)

        tools = ManipulationTools(self._context.exact, plan, wall_clock, lambda: stop() or rospy.is_shutdown(),
                                  self._shared.scaling)
        try:
            found = plan_manipulation(job.task, job.candidates, seconds, tools)
        except ManipulationFailure as failure:
            self._shared.hands.publish(hands(job, None, failure.falls))
            raise
        self._shared.hands.publish(hands(job, found.candidate, found.falls))
        for fall in found.falls:
            rospy.loginfo("%s: %s", self._kind.name, fall)
        return found

    def _request(self, job: _Pick | _Place, goal: PickupGoal | PlaceGoal, q: np.ndarray,
                 seconds: float) -> MotionPlanRequest:
        names = self._context.model.groups[job.task.group].joints
        request = MotionPlanRequest(
            group_name=job.task.group, planner_id=goal.planner_id, allowed_planning_time=seconds,
            path_constraints=goal.path_constraints, max_velocity_scaling_factor=self._shared.scaling[0],
            max_acceleration_scaling_factor=self._shared.scaling[1])
        request.goal_constraints = [Constraints(joint_constraints=[
            JointConstraint(name, value, _JOINED, _JOINED, 1.0)
            for name, value in zip(names, q.tolist(), strict=True)])]
        return request

    def _fill(self, result: PickupResult | PlaceResult, job: _Pick | _Place, found: Manipulation) -> None:
        model = self._context.model
        start = job.task.scene.state
        result.trajectory_start = state_message(model, start, rospy.Time.now())
        job.choose(result, found.candidate)
        for stage in found.stages:
            message = self._message(job, found, stage, stage.scene.state.positions)
            if message is not None:
                result.trajectory_stages.append(message)
                result.trajectory_descriptions.append(stage.description)
        self._context.show_path(start, *result.trajectory_stages)

    def _message(self, job: _Pick | _Place, found: Manipulation, stage: ManipulationStage,
                 values: Mapping[str, float]) -> RobotTrajectory | None:
        """The RobotTrajectory of a stage, None where nothing moves in it."""
        model = self._context.model
        if stage.timed is not None:
            moves = len(stage.timed.times) > 1
            names = model.groups[job.task.group].joints
            return trajectory_message(names, stage.timed, model.frame) if moves else None
        posture, force = job.posture(found.candidate, stage.description)
        return hand_trajectory(posture, values, model, force) if posture.points else None

    # -- execution ----------------------------------------------------------------------------------------------

    def _execute(self, job: _Pick | _Place, found: Manipulation) -> tuple[int, str]:
        """Return (code, reason)."""
        context, name = self._context, self._kind.name
        require_state(context, context.model.groups[job.task.group])
        for stage in found.stages:
            message = self._message(job, found, stage, stage.scene.state.positions)
            lacking = message and context.require_executor().why_not(message.joint_trajectory.joint_names)
            if lacking:
                raise RequestError(MoveItErrorCodes.CONTROL_FAILED, "stage '%s': %s" % (stage.description, lacking))
        for stage in found.stages:
            outcome, contacts = self._execute_stage(job, found, stage)
            if outcome is not None and outcome.code != MoveItErrorCodes.SUCCESS:
                text = "stage '%s': %s" % (stage.description, outcome.text)
                context.failures.tell(name, outcome.code, text, job.task.group, contacts, outcome.joints)
                return outcome.code, text
            if stage.description == "grasp":
                job.hand_over(found.candidate)
        return MoveItErrorCodes.SUCCESS, ""

    def _execute_stage(self, job: _Pick | _Place, found: Manipulation,
                       stage: ManipulationStage) -> tuple[ExecutionOutcome | None, list[Contact]]:
        """(ExecutionOutcome, contacts that ended it); (None, []) where nothing moves."""
        context, stop = self._context, self._server.is_preempt_requested
        message = self._message(job, found, stage, context.monitor.joint_values())
        if message is None:
            return None, []
        if stage.timed is None:
            return context.require_executor().execute(message, stop, from_anywhere=True), []
        self._changed.clear()
        group = context.model.groups[job.task.group]
        watch = RestOfTheWay(context.exact, group, stage.timed, lambda: self._changed_scene(stage))
        return context.require_executor().execute(message, stop, watch.hit), watch.contacts

    def _changed_scene(self, stage: ManipulationStage) -> Scene | None:
        if not self._changed.is_set():
            return None
        self._changed.clear()
        return self._context.monitor.scene().with_allowed(stage.scene.allowed)

    def _feedback(self, state: str) -> None:
        if self._server.is_active():
            self._server.publish_feedback(self._kind.feedback(state))


class _Job:
    """One goal. task: PickTask or PlaceTask; candidates: list of Candidates. Raises PlanningError."""

    #: Of the action: its name, what one candidate is called, and its types.
    name: str
    one: str
    action: type[rospy.Message]
    result: type[PickupResult] | type[PlaceResult]
    feedback: type[rospy.Message]

    def __init__(self, context: Context, goal: Any) -> None:
        self.context, self.goal = context, goal
        scene = scene_with_diff(context, context.monitor.scene(), goal.planning_options.planning_scene_diff, self.name,
                                keep_robot=True)
        self.effector = effector = self._effector(scene)
        self.hand = hand_links(context.model, effector)
        self.group = goal.group_name if goal.group_name in context.model.groups and \
            goal.group_name != effector.group else effector.parent_group
        context.group(self.group)
        self.link = effector.parent_link
        surface = goal.support_surface_name
        if surface and surface not in scene.objects:
            rospy.logwarn("%s: the support surface '%s' is not in the scene", self.name, surface)
        try:
            self.task = self._task(scene)
        except SceneError as error:
            raise RequestError(MoveItErrorCodes.INVALID_OBJECT_NAME, str(error)) from None
        self._listed = self._list(scene)
        names = _unique([one.id or "%s %d" % (self.one, number) for number, one in enumerate(self._listed, 1)])
        try:
            self.candidates = [self._candidate(one, name, scene)
                               for one, name in zip(self._listed, names, strict=True)]
        except PlanningError as error:
            raise RequestError(getattr(error, "code", MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS), str(error)) from None

    def common(self) -> dict[str, Any]:
        """Arguments that both tasks have."""
        goal = self.goal
        return {"group": self.group, "link": self.link, "hand": self.hand, "support": goal.support_surface_name,
                "hand_may_touch_support": goal.allow_gripper_support_collision}

    def chosen(self, candidate: Candidate) -> Any:
        """The Grasp or PlaceLocation of a Candidate."""
        return self._listed[self.candidates.index(candidate)]

    def _effectors(self) -> list[EndEffector]:
        """srdf.EndEffectors of the goal's group, all where it names none; by their own name, too."""
        model, name = self.context.model, self.goal.group_name
        found = list(model.end_effectors.values())
        if name in model.groups:
            found = [one for one in found if one.name in model.groups[name].end_effectors or one.group == name]
        elif name:
            found = [one for one in found if one.name == name]
            if not found:
                self.context.group(name)
        if not found:
            raise RequestError(MoveItErrorCodes.INVALID_GROUP_NAME, "no end effector is mounted on group '%s'; the "
                               "SRDF has %s" % (name, ", ".join(model.end_effectors) or "none"))
        return found

    def _effector(self, scene: Scene) -> EndEffector:
        raise NotImplementedError

    def _task(self, scene: Scene) -> Any:
        raise NotImplementedError

    def _list(self, scene: Scene) -> list[Any]:
        raise NotImplementedError

    def _candidate(self, one: Any, name: str, scene: Scene) -> Candidate:
        raise NotImplementedError


class _Pick(_Job):
    name, one, action, result, feedback = "pickup", "grasp", PickupAction, PickupResult, PickupFeedback

    def _effector(self, scene: Scene) -> EndEffector:
        found, name = self._effectors(), self.goal.end_effector
        if name:
            found = [one for one in found if one.name == name]
            if not found:
                raise RequestError(MoveItErrorCodes.INVALID_GROUP_NAME, "there is no end effector '%s' on group '%s'; "
                                   "the SRDF has %s" % (name, self.goal.group_name,
                                                        ", ".join(self.context.model.end_effectors) or "none"))
        return found[0]

    def _task(self, scene: Scene) -> PickTask:
        goal = self.goal
        return PickTask(scene, target=goal.target_name, touch_links=frozenset(goal.attached_object_touch_links),
                        minimize_distance=goal.minimize_object_distance or not goal.possible_grasps, **self.common())

    def _list(self, scene: Scene) -> list[Grasp]:
        model = self.context.model
        return list(self.goal.possible_grasps) or [
            usual_grasp(self.goal.target_name, model.frame, model.groups[self.effector.group].joints)]

    def _candidate(self, one: Grasp, name: str, scene: Scene) -> Candidate:
        found = grasp_candidate(one, name, scene, self.context.monitor.reader, self.link)
        return _touching(found, self.goal.allowed_touch_objects)

    def choose(self, result: PickupResult | PlaceResult, candidate: Candidate) -> None:
        assert isinstance(result, PickupResult)
        result.grasp = self.chosen(candidate)

    def posture(self, candidate: Candidate, stage: str) -> tuple[JointTrajectory, float]:
        """(JointTrajectory of the hand in a stage, force)."""
        grasp = self.chosen(candidate)
        if stage == "pre_grasp":
            return grasp.pre_grasp_posture, 0.0
        return grasp.grasp_posture, grasp.max_contact_force

    def hand_over(self, candidate: Candidate) -> None:
        """The object is in the hand."""
        task, opened = self.task, self.chosen(candidate).pre_grasp_posture
        links = task.touch_links or task.hand
        monitor = self.context.monitor
        monitor.change(lambda _: monitor.scene().attach(task.target, task.link, links, opened), self.name)


class _Place(_Job):
    name, one, action, result, feedback = "place", "place", PlaceAction, PlaceResult, PlaceFeedback

    def _effector(self, scene: Scene) -> EndEffector:
        """The one whose hand holds the object."""
        found, held = self._effectors(), scene.state.attached
        if self.goal.attached_object_name in held:
            link = held[self.goal.attached_object_name].link
            return next((one for one in found if link == one.parent_link or link in hand_links(
                self.context.model, one)), found[0])
        return found[0]

    def _task(self, scene: Scene) -> PlaceTask:
        name = self.goal.attached_object_name
        if not name:
            names = [one for one, body in scene.state.attached.items()
                     if body.link == self.link or body.link in self.hand]
            if len(names) != 1:
                raise SceneError("the goal names no object, and the hand holds %s" % (", ".join(names) or "none"))
            name = names[0]
        return PlaceTask(scene, target=name, **self.common())

    def _list(self, scene: Scene) -> list[PlaceLocation]:
        goal = self.goal
        if goal.place_locations or not goal.support_surface_name:
            return list(goal.place_locations)
        body = scene.state.attached[self.task.target]
        try:
            poses = places_on(scene, goal.support_surface_name, body.object.at(scene.attached_pose(body)))
        except SceneError as error:
            raise RequestError(MoveItErrorCodes.INVALID_OBJECT_NAME, str(error)) from None
        return [self._from_above(one) for one in poses]

    def _from_above(self, pose: np.ndarray) -> PlaceLocation:
        place = PlaceLocation(place_pose=stamped(pose, self.context.model.frame, rospy.Time()))
        for way, direction in ((place.pre_place_approach, -1.0), (place.post_place_retreat, 1.0)):
            way.direction.header.frame_id = self.context.model.frame
            way.direction.vector.z = direction
            way.desired_distance, way.min_distance = _WAY_M, _MIN_WAY_M
        return place

    def _candidate(self, one: PlaceLocation, name: str, scene: Scene) -> Candidate:
        found = place_candidate(one, name, self.context.monitor.reader, self.task, self.goal.place_eef)
        return _touching(found, self.goal.allowed_touch_objects)

    def choose(self, result: PickupResult | PlaceResult, candidate: Candidate) -> None:
        assert isinstance(result, PlaceResult)
        result.place_location = self.chosen(candidate)

    def posture(self, candidate: Candidate, stage: str) -> tuple[JointTrajectory, float]:
        """(JointTrajectory of the hand in a stage, force)."""
        place = self.chosen(candidate)
        held = self.task.scene.state.attached[self.task.target].detach_posture
        return place.post_place_posture if place.post_place_posture.points or not held else held, 0.0

    def hand_over(self, candidate: Candidate) -> None:
        """The object stands where it was put."""
        monitor = self.context.monitor
        monitor.change(lambda _: monitor.scene().detach(self.task.target), self.name)


def _touching(candidate: Candidate, names: Iterable[str]) -> Candidate:
    return replace(candidate, touch=candidate.touch | set(names))


def _unique(names: Sequence[str]) -> list[str]:
    """The names, with a number where one comes more than once."""
    count = Counter(names)
    return [name if count[name] == 1 else "%s (%d)" % (name, number) for number, name in enumerate(names, 1)]


def _share(parameter: str) -> float:
    value = rospy.get_param(parameter, 1.0)
    if isinstance(value, (int, float)) and 0.0 < value <= 1.0:
        return float(value)
    rospy.logwarn("%s is %r, expected a number above 0 and at most 1; 1 is taken", parameter, value)
    return 1.0
