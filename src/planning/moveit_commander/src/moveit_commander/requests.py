# SPDX-License-Identifier: BSD-3-Clause
"""Requests and goals for move_group, built from a commander's settings."""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import Pose, PoseStamped, Quaternion, Vector3
from moveit_msgs.msg import (
    BoundingVolume,
    Constraints,
    Grasp,
    JointConstraint,
    MotionPlanRequest,
    MoveGroupGoal,
    MoveItErrorCodes,
    OrientationConstraint,
    PickupGoal,
    PlaceGoal,
    PlaceLocation,
    PlanningOptions,
    PositionConstraint,
    TrajectoryConstraints,
)
from shape_msgs.msg import SolidPrimitive

from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from moveit_msgs.msg import RobotState

    from motion_planning.model import Group

#: Kinds of goal: joints, or a pose and what of it counts.
JOINTS = "joints"
POSE, POSITION, ORIENTATION = "pose", "position", "orientation"
_CODES = {value: name for name, value in vars(MoveItErrorCodes).items() if name.isupper() and isinstance(value, int)}
#: Length of approach and retreat for a place that is given as a pose only: desired and least [m].
_PLACE_DISTANCE_M, _PLACE_MIN_DISTANCE_M = 0.2, 0.1


def code_name(code: int) -> str | int:
    """The name of one of MoveItErrorCodes, or the number where it has none."""
    return _CODES.get(code, code)


@dataclass
class RequestSettings:
    """Settings of a commander. Lengths in m, angles in rad, times in s; scaling 0 to 1."""

    planning_time: float = 5.0
    attempts: int = 1
    pipeline_id: str = ""
    planner_id: str = ""
    velocity_scaling: float = 0.1
    acceleration_scaling: float = 0.1
    cartesian_speed: float = 0.0
    cartesian_speed_link: str = ""
    joint_tolerance: float = 1e-4
    position_tolerance: float = 1e-4
    orientation_tolerance: float = 1e-3
    workspace: tuple[float, ...] = (0.0,) * 6
    looking: bool = False
    replanning: bool = False
    replan_attempts: int = 1
    replan_delay: float = 2.0
    support_surface: str = ""
    start_state: RobotState | None = None  # None for the current state
    path_constraints: Constraints = field(default_factory=Constraints)
    trajectory_constraints: TrajectoryConstraints = field(default_factory=TrajectoryConstraints)


def joint_goal(names: Sequence[str], values: Sequence[float], tolerance: float) -> Constraints:
    """Return the Constraints that hold joints at ``values``, up to ``tolerance``."""
    return Constraints(joint_constraints=[
        JointConstraint(joint_name=name, position=value, tolerance_above=tolerance, tolerance_below=tolerance,
                        weight=1.0)
        for name, value in zip(names, values, strict=True)])


def pose_goals(poses: Mapping[str, Sequence[PoseStamped]], kind: str, settings: RequestSettings) -> list[Constraints]:
    """Return the alternatives, a list of Constraints, that ``poses``, {link: [PoseStamped]}, mean.

    The first poses of all links belong together, the second ones, and so on. ``kind``: POSE, POSITION or ORIENTATION.
    """
    goals = [Constraints() for _ in range(max(map(len, poses.values()), default=0))]
    for link, alternatives in poses.items():
        for goal, pose in zip(goals, alternatives, strict=False):
            if kind != ORIENTATION:
                goal.position_constraints.append(_position_constraint(link, pose, settings.position_tolerance))
            if kind != POSITION:
                goal.orientation_constraints.append(_orientation_constraint(link, pose, settings.orientation_tolerance))
    return goals


def _position_constraint(link: str, pose: PoseStamped, tolerance: float) -> PositionConstraint:
    sphere = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[tolerance])
    place = Pose(position=pose.pose.position, orientation=Quaternion(0.0, 0.0, 0.0, 1.0))
    return PositionConstraint(header=pose.header, link_name=link, weight=1.0,
                              constraint_region=BoundingVolume(primitives=[sphere], primitive_poses=[place]))


def _orientation_constraint(link: str, pose: PoseStamped, tolerance: float) -> OrientationConstraint:
    return OrientationConstraint(
        header=pose.header, link_name=link, orientation=pose.pose.orientation, absolute_x_axis_tolerance=tolerance,
        absolute_y_axis_tolerance=tolerance, absolute_z_axis_tolerance=tolerance, weight=1.0)


def motion_plan_request(group: str, frame: str, goals: Sequence[Constraints],
                        settings: RequestSettings) -> MotionPlanRequest:
    """Return the MotionPlanRequest for one of ``goals`` (Constraints). ``frame``: of the workspace, planning's own."""
    request = MotionPlanRequest(
        group_name=group, goal_constraints=goals, pipeline_id=settings.pipeline_id, planner_id=settings.planner_id,
        num_planning_attempts=settings.attempts, allowed_planning_time=settings.planning_time,
        max_velocity_scaling_factor=settings.velocity_scaling,
        max_acceleration_scaling_factor=settings.acceleration_scaling,
        cartesian_speed_limited_link=settings.cartesian_speed_link, max_cartesian_speed=settings.cartesian_speed,
        path_constraints=settings.path_constraints, trajectory_constraints=settings.trajectory_constraints)
    request.workspace_parameters.header.frame_id = frame
    request.workspace_parameters.min_corner = Vector3(*settings.workspace[:3])
    request.workspace_parameters.max_corner = Vector3(*settings.workspace[3:])
    set_start(request.start_state, settings)
    return request


def set_start(start_state: RobotState, settings: RequestSettings) -> None:
    """Fill a request's start state in place: the one that was set, or nothing, which means the current one."""
    start_state.is_diff = True
    if settings.start_state is not None:
        for name in settings.start_state.__slots__:
            setattr(start_state, name, getattr(settings.start_state, name))


def planning_options(settings: RequestSettings, plan_only: bool) -> PlanningOptions:
    """Return the PlanningOptions of a goal; the scene is left as it is."""
    options = PlanningOptions(
        plan_only=plan_only, look_around=settings.looking, replan=settings.replanning,
        replan_attempts=settings.replan_attempts, replan_delay=settings.replan_delay)
    options.planning_scene_diff.is_diff = options.planning_scene_diff.robot_state.is_diff = True
    return options


def move_group_goal(request: MotionPlanRequest, settings: RequestSettings, plan_only: bool) -> MoveGroupGoal:
    """Return the goal of the action move_group."""
    options = planning_options(settings, plan_only)
    if plan_only:
        options.look_around = options.replan = False
    return MoveGroupGoal(request, options)


def pickup_goal(group: Group, target: str, grasps: Sequence[Grasp], settings: RequestSettings,
                plan_only: bool) -> PickupGoal:
    """Return the goal of the action pickup. ``group``: the core's Group of the arm."""
    return PickupGoal(
        target_name=target, group_name=group.name, end_effector=next(iter(group.end_effectors), ""),
        possible_grasps=grasps, support_surface_name=settings.support_surface,
        allow_gripper_support_collision=bool(settings.support_surface), path_constraints=settings.path_constraints,
        planner_id=settings.planner_id, allowed_planning_time=settings.planning_time,
        planning_options=planning_options(settings, plan_only))


def place_goal(group: Group, target: str, locations: Sequence[PlaceLocation], settings: RequestSettings,
               plan_only: bool) -> PlaceGoal:
    """Return the goal of the action place. ``group``: the core's Group of the arm."""
    return PlaceGoal(
        group_name=group.name, attached_object_name=target, place_locations=locations,
        support_surface_name=settings.support_surface, allow_gripper_support_collision=bool(settings.support_surface),
        path_constraints=settings.path_constraints, planner_id=settings.planner_id,
        allowed_planning_time=settings.planning_time, planning_options=planning_options(settings, plan_only))


def grasps_of(grasp: Grasp | str | Iterable[Grasp | str]) -> list[Grasp]:
    """Return a list of Grasps from one, or from a list of them."""
    given = list(grasp) if isinstance(grasp, list | tuple) else [grasp]
    grasps = [one for one in given if isinstance(one, Grasp)]
    if len(grasps) != len(given):
        raise MoveItCommanderException("expected a Grasp or a list of them, got %r" % (grasp,))
    return grasps


def place_locations(location: Any, frame: str, root: str, tip: str) -> list[PlaceLocation]:
    """Return a list of PlaceLocations from what :meth:`MoveGroupCommander.place` takes; None makes an empty list.

    ``frame``: of a Pose. A pose alone is approached from above (down in ``root``); the hand retreats along its axis (-x
    of ``tip``).
    """
    if location is None:
        return []
    found = []
    for one in location if isinstance(location, list | tuple) else [location]:
        if isinstance(one, Pose):
            one = PoseStamped(pose=one)
            one.header.frame_id = frame
        if isinstance(one, PoseStamped):
            one = _location_at(one, root, tip)
        if not isinstance(one, PlaceLocation):
            raise MoveItCommanderException("expected a Pose, PoseStamped or PlaceLocation, or a list of them, got %s"
                                           % type(one).__name__)
        found.append(one)
    return found


def _location_at(pose: PoseStamped, root: str, tip: str) -> PlaceLocation:
    place = PlaceLocation(place_pose=pose)
    for way, link, direction in ((place.pre_place_approach, root, Vector3(0.0, 0.0, -1.0)),
                                 (place.post_place_retreat, tip, Vector3(-1.0, 0.0, 0.0))):
        way.direction.header.frame_id, way.direction.vector = link, direction
        way.desired_distance, way.min_distance = _PLACE_DISTANCE_M, _PLACE_MIN_DISTANCE_M
    return place
