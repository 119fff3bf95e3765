# SPDX-License-Identifier: BSD-3-Clause
"""MotionPlanRequests to plans."""
from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import rospy
from moveit_msgs.msg import MoveItErrorCodes

from motion_planning import pipeline
from motion_planning.constraints import sampler
from motion_planning.errors import PlanningError
from motion_planning.planners import SearchOptions, plan_path, warm_up
from motion_planning.planners.names import config_name, kind_of, planner_of
from motion_planning.replanning import redirected
from motion_planning.scene import Scene
from motion_planning.timing import time_path
from moveit_ros_move_group.capabilities.cartesian import slowed
from moveit_ros_move_group.context import RequestError, wall_clock
from moveit_ros_move_group.convert.constraints import constraint_set_of

if TYPE_CHECKING:
    from moveit_msgs.msg import MotionPlanRequest, MotionSequenceItem, PlanningScene

    from motion_planning.pipeline import Plan, PlanQuery, Tools
    from motion_planning.planners.trees import Planner as PathPlanner
    from motion_planning.replanning import Redirection, Running
    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.industrial import IndustrialPlanner
    from moveit_ros_move_group.settings import Pipeline

# [s], if a request has none.
_USUAL_TIME_S = 5.0
# Polling period while the robot is being prepared [s].
_LOOK_UP_S = 0.05
# Remarks on planners that were logged already; each is logged once.
_MAX_REMARKS = 1000


class Planner:
    """Plans requests. Calls may come from any thread."""

    def __init__(self, context: Context, industrial: IndustrialPlanner) -> None:
        """industrial: IndustrialPlanner, for the pipelines that are."""
        self._context, self._industrial = context, industrial
        self._remarks = set()
        self._seeds = itertools.count()
        self._prepared = threading.Event()
        self._prepared.set()

    def plan(self, request: MotionPlanRequest, scene: Scene, stop: Callable[[], bool] = lambda: False) -> Plan:
        """Return a pipeline.Plan for a MotionPlanRequest from the state of ``scene``. Raises PlanningError."""
        context = self._context
        pipe = self._pipeline(request.pipeline_id)
        self._wait_until_prepared(stop)
        if pipe.industrial:
            return self._limited(request, self._industrial.plan(request, scene, pipe, self._tools(stop)))
        query, remarks = self._query(request, scene, pipe)
        try:
            plan = pipeline.plan(query, self._tools(stop))
        except PlanningError as error:
            raise RequestError(getattr(error, "code", MoveItErrorCodes.FAILURE), "; ".join([str(error), *remarks]),
                               getattr(error, "contacts", ()), getattr(error, "joints", None)) from None
        remarks += plan.remarks
        context.remark("planning", remarks, request.group_name)
        return self._limited(request, plan._replace(remarks=tuple(remarks)))

    def redirected(self, request: MotionPlanRequest, scene: Scene, running: Running,
                   stop: Callable[[], bool] = lambda: False) -> Redirection:
        """Return a replanning.Redirection for joints that move by a MotionPlanRequest already, see there. Raises
        PlanningError."""
        pipe = self._pipeline(request.pipeline_id)
        if pipe.industrial or request.max_cartesian_speed > 0.0:
            raise RequestError(MoveItErrorCodes.FAILURE, "motions of this planner, and those with a limit on a link's "
                               "speed, are not changed while they run")
        query, _ = self._query(request, scene, pipe)
        return redirected(query, self._tools(stop), running)

    def _query(self, request: MotionPlanRequest, scene: Scene, pipe: Pipeline) -> tuple[PlanQuery, list[str]]:
        """(pipeline.PlanQuery, remarks) of a MotionPlanRequest. Raises RequestError."""
        remarks, reader = [], self._context.monitor.reader
        try:
            found = [constraint_set_of(goal, scene, reader, remarks) for goal in request.goal_constraints]
            path_constraints = constraint_set_of(request.path_constraints, scene, reader, remarks)
        except PlanningError as error:
            raise RequestError(getattr(error, "code", MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS), str(error)) from None
        goals = [goal for goal in found if goal is not None]
        if len(goals) < len(found):
            raise RequestError(MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS, "; ".join(
                ["a goal without any constraint says nothing", *remarks]))
        query = pipeline.PlanQuery(
            scene, request.group_name, goals, path_constraints, self._planner(request, pipe),
            request.allowed_planning_time if request.allowed_planning_time > 0.0 else _USUAL_TIME_S,
            request.num_planning_attempts, _scaling(request.max_velocity_scaling_factor),
            _scaling(request.max_acceleration_scaling_factor), pipe.timing, pipe.start_bounds_error, pipe.jiggle)
        return query, remarks

    def plan_sequence(self, items: Sequence[MotionSequenceItem], scene: Scene,
                      stop: Callable[[], bool] = lambda: False) -> list[tuple[str, Plan]]:
        """Return [(group name, pipeline.Plan), ...] for MotionSequenceItems from the state of ``scene``.

        Raises PlanningError.
        """
        pipelines = self._context.pipelines
        usual = pipelines[self._context.default_pipeline]
        usual = usual if usual.industrial else next((pipe for pipe in pipelines.values() if pipe.industrial), usual)
        pipes = [self._pipeline(item.req.pipeline_id) if item.req.pipeline_id else usual for item in items]
        other = next((pipe.name for pipe in pipes if not pipe.industrial), None)
        if other is not None:
            raise RequestError(MoveItErrorCodes.FAILURE, "pipeline '%s' plans no sequences; load "
                               "pilz_industrial_motion_planner and name it as pipeline_id" % other)
        self._wait_until_prepared(stop)
        return self._industrial.plan_sequence(items, scene, pipes, self._tools(stop))

    def prepare(self, patience_s: float, done: Callable[[], object] = lambda: None) -> None:
        """Load compiled code and make the robot's spheres, so that the first request does not wait for them. Returns
        when that is done, or after ``patience_s`` [s], and goes on beside: plans wait for it, nothing else does.
        ``done()`` is called in the end."""
        def work() -> None:
            begin = wall_clock()
            try:
                self._warm_up()
            except Exception as error:  # a plan for the same group will say it as well
                rospy.logerr("the robot could not be prepared for planning: %s: %s", type(error).__name__, error)
            else:
                rospy.loginfo("the robot was prepared for planning in %.1f s", wall_clock() - begin)
            self._prepared.set()
            done()

        self._prepared.clear()
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(patience_s)
        if thread.is_alive():
            rospy.logwarn("the robot is still being prepared for planning; the first time its links are covered by "
                          "spheres, which may take half a minute. Plans wait for that, everything else answers already")

    def _wait_until_prepared(self, stop: Callable[[], bool]) -> None:
        while not self._prepared.wait(_LOOK_UP_S):
            if stop() or rospy.is_shutdown():
                raise RequestError(MoveItErrorCodes.PREEMPTED, "stopped while the robot was prepared for planning")

    def _warm_up(self) -> None:
        # What these plans do not call, a later one does, while an arm moves.
        warm_up()
        context = self._context
        scene = Scene(context.model)
        for name, group in context.model.groups.items():
            if not group.joints:
                continue
            q = scene.state.q[group.indices]
            near = np.clip(q + 0.1, *context.model.bounds[group.indices].T)
            try:
                plan_path(scene, name, q, near[None], SearchOptions(context.exact, 0, 1.0, wall_clock))
            except PlanningError:
                pass  # for example if the robot touches itself in its zero position
            time_path(np.array([q, near]), context.model.velocity[group.indices],
                      context.model.acceleration[group.indices])

    def _tools(self, stop: Callable[[], bool]) -> Tools:
        return pipeline.Tools(self._context.exact, plan_path, sampler, wall_clock, next(self._seeds),
                              lambda: stop() or rospy.is_shutdown())

    def _limited(self, request: MotionPlanRequest, plan: Plan) -> Plan:
        """The plan, slowed to ``max_cartesian_speed`` where the request limits a link's speed."""
        speed, link = request.max_cartesian_speed, request.cartesian_speed_limited_link
        group = self._context.group(request.group_name)
        link = link or group.tip
        if not speed > 0.0 or len(plan.timed.times) < 2 or link not in self._context.model.link_index:
            return plan
        return plan._replace(timed=slowed(self._context.model, plan.start, group, link, plan.timed, speed))

    def _pipeline(self, name: str) -> Pipeline:
        name = name or self._context.default_pipeline
        if name not in self._context.pipelines:
            raise RequestError(MoveItErrorCodes.FAILURE, "there is no planning pipeline '%s'; there are %s"
                               % (name, ", ".join(self._context.pipelines)))
        return self._context.pipelines[name]

    def _planner(self, request: MotionPlanRequest, pipe: Pipeline) -> PathPlanner:
        """The planner that a request names; what is to be said of it is said once."""
        asked = request.planner_id or pipe.default_planner(request.group_name)
        planner, remarks = planner_of(kind_of(asked, pipe.planners),
                                      pipe.settings(request.group_name, config_name(asked)))
        for remark in remarks:
            if remark not in self._remarks and len(self._remarks) < _MAX_REMARKS:
                self._remarks.add(remark)
                rospy.logwarn("%s", remark)
        return planner


def _scaling(factor: float) -> float:
    """A scaling factor as MoveIt takes it: 1 for what is not above 0 or above 1."""
    return factor if math.isfinite(factor) and 0.0 < factor <= 1.0 else 1.0


def scene_with_diff(context: Context, scene: Scene, diff: PlanningScene, request: str, keep_robot: bool) -> Scene:
    """Return ``scene`` with a request's planning_scene_diff applied; ``keep_robot``: without its robot state.

    Raises RequestError for a diff that cannot be applied as a whole.
    """
    if not diff.is_diff and not (diff.world.collision_objects or diff.robot_state.joint_state.name):
        return scene  # nothing was filled in
    before = scene.state
    changed, errors = context.monitor.reader.with_planning_scene(scene, _as_diff(diff))
    if errors:
        raise RequestError(MoveItErrorCodes.FAILURE, "%s: planning_scene_diff: %s" % (request, errors[0]))
    return changed.with_state(replace(changed.state, q=before.q, base=before.base)) if keep_robot else changed


def _as_diff(message: PlanningScene) -> PlanningScene:
    message.is_diff = True
    message.robot_state.is_diff = True
    return message
