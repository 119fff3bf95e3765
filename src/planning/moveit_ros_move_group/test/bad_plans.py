# SPDX-License-Identifier: BSD-3-Clause
"""Requests for plans that cannot be had, each with what it is refused for."""
import copy
import math
from dataclasses import dataclass

from geometry_msgs.msg import Point, Quaternion
from good_requests import (
    IDENTITY,
    box,
    changed,
    diff,
    framed,
    good_requests,
    joint_goal,
    plan_request,
    pose,
    stamped,
    state_of,
    there,
)
from moveit_msgs.msg import (
    AttachedCollisionObject,
    BoundingVolume,
    Constraints,
    JointConstraint,
    MoveItErrorCodes,
    OrientationConstraint,
    PositionConstraint,
    RobotState,
    VisibilityConstraint,
)
from moveit_msgs.srv import GetMotionPlanRequest
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive

CODES = MoveItErrorCodes
# The goal cannot be met: MoveIt's planners answer with one or the other of these.
UNMET = frozenset((CODES.PLANNING_FAILED, CODES.TIMED_OUT, CODES.INVALID_GOAL_CONSTRAINTS, CODES.NO_IK_SOLUTION,
                   CODES.GOAL_CONSTRAINTS_VIOLATED, CODES.GOAL_STATE_INVALID, CODES.INVALID_MOTION_PLAN))
NOT_UNDERSTOOD = frozenset((CODES.INVALID_GOAL_CONSTRAINTS, CODES.FRAME_TRANSFORM_FAILURE, CODES.INVALID_LINK_NAME))
FLOATS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-320, 0.0, -1.0, 1e9, -1e9)
TEXTS = ("", " ", "/", "//", "no such thing", "\N{SNOWMAN}", "%s%n{0}", "a\nb", "x" * 10000, "../..", "<octomap>")


@dataclass(frozen=True)
class Case:
    """A request for ``endpoint``: an action, a service or a topic. codes: those that MoveIt could give, empty for any;
    says: what the sentence must name."""

    name: str
    endpoint: str
    message: object
    codes: frozenset = frozenset()
    says: str = ""


def position_of(robot, link=None, frame=None, shapes=None, poses=None):
    one = PositionConstraint(link_name=robot.tip if link is None else link, weight=1.0)
    one.header.frame_id = robot.frame if frame is None else frame
    shapes = [SolidPrimitive(SolidPrimitive.SPHERE, [1e-3])] if shapes is None else shapes
    one.constraint_region = BoundingVolume(
        primitives=shapes, primitive_poses=[there(robot).pose] * len(shapes) if poses is None else poses)
    return one


def _orientation(robot, orientation, tolerance=0.01, link=None, frame=None):
    one = OrientationConstraint(orientation=orientation, link_name=robot.tip if link is None else link, weight=1.0,
                                absolute_x_axis_tolerance=tolerance, absolute_y_axis_tolerance=tolerance,
                                absolute_z_axis_tolerance=tolerance)
    one.header.frame_id = robot.frame if frame is None else frame
    return one


def goals_of(robot):
    """(what is wrong, goal constraints, codes, what the sentence names)"""
    bad, beyond = NOT_UNDERSTOOD, tuple(value + 0.5 for value in robot.upper)
    first = robot.joints[0]
    for value in (math.nan, math.inf, -math.inf):
        yield "a joint at %r" % value, [joint_goal(robot, (value, *robot.aside[1:]))], bad, first
        yield "a tolerance of %r" % value, [joint_goal(robot, robot.aside, value)], bad, first
    yield "no goal", [], {CODES.INVALID_GOAL_CONSTRAINTS}, ""
    yield "an empty goal", [Constraints(name="nothing")], {CODES.INVALID_GOAL_CONSTRAINTS}, ""
    yield "an unknown joint", [Constraints(joint_constraints=[JointConstraint("elbow_9", 0.0, 0.1, 0.1, 1.0)])], bad, \
        "elbow_9"
    yield "a tolerance below 0", [joint_goal(robot, robot.aside, -0.1)], bad, first
    yield "a goal beyond limits", [joint_goal(robot, beyond)], (), first
    twice = joint_goal(robot, robot.aside)
    twice.joint_constraints += joint_goal(robot, robot.free).joint_constraints[:1]
    twice.joint_constraints[-1].position = twice.joint_constraints[0].position + 0.2
    yield "two values of a joint", [twice], UNMET, first
    yield "two places of a link", [Constraints(position_constraints=[
        position_of(robot), position_of(robot, poses=[pose(-0.3, -0.1, 0.3)])])], UNMET, ""
    yield "two orientations of a link", [Constraints(orientation_constraints=[
        _orientation(robot, IDENTITY), _orientation(robot, Quaternion(1.0, 0.0, 0.0, 0.0))])], UNMET, ""
    yield "out of reach", [Constraints(position_constraints=[
        position_of(robot, poses=[pose(50.0, 0.0, 0.0)])])], UNMET, ""
    yield "an unknown frame", [Constraints(position_constraints=[position_of(robot, frame="nowhere")])], bad, "nowhere"
    yield "an unknown link", [Constraints(position_constraints=[position_of(robot, link="tail")])], bad, "tail"
    yield "no link", [Constraints(position_constraints=[position_of(robot, link="")])], bad, ""
    yield "the link of no group", [Constraints(position_constraints=[position_of(robot, link=robot.frame)])], UNMET, ""
    yield "a region without shapes", [Constraints(position_constraints=[position_of(robot, shapes=[])])], bad, robot.tip
    yield "a region without poses", [Constraints(position_constraints=[position_of(robot, poses=[])])], bad, robot.tip
    for sizes in ([], [0.1], [0.0, 0.0, 0.0], [-1.0, 1.0, 1.0], [math.nan] * 3, [1e308] * 3):
        yield "a region of %s" % sizes, [Constraints(position_constraints=[position_of(
            robot, shapes=[SolidPrimitive(SolidPrimitive.BOX, sizes)])])], bad if sizes != [1e308] * 3 else (), ""
    yield "a region of an unknown kind", [Constraints(position_constraints=[position_of(
        robot, shapes=[SolidPrimitive(77, [1.0])])])], bad, "77"
    for triangles in ([], [(0, 1, 9)], [(0, 0, 0)]):
        one = position_of(robot, shapes=[])
        one.constraint_region.meshes = [Mesh([MeshTriangle(row) for row in triangles], [Point(), Point(x=1.0)])]
        one.constraint_region.mesh_poses = [there(robot).pose]
        yield "a mesh of triangles %s" % triangles, [Constraints(position_constraints=[one])], \
            bad if triangles != [(0, 0, 0)] else (), ""
    for turn, codes in ((Quaternion(), ()), (Quaternion(0.0, 0.0, 0.0, 5.0), ()),
                        (Quaternion(math.nan, 0.0, 0.0, 1.0), bad)):
        yield "a quaternion of %s" % [turn.x, turn.y, turn.z, turn.w], [Constraints(
            position_constraints=[position_of(robot)], orientation_constraints=[_orientation(robot, turn)])], codes, ""
    yield "an orientation's tolerance below 0", [Constraints(orientation_constraints=[
        _orientation(robot, IDENTITY, -1.0)])], (), robot.tip
    for sides, radius, axis in ((2**31 - 1, 0.1, 0), (-5, 0.1, 0), (8, math.nan, 0), (8, -1.0, 0), (8, 0.1, 9)):
        one = VisibilityConstraint(target_radius=radius, cone_sides=sides, sensor_view_direction=axis, weight=1.0,
                                   target_pose=stamped(robot, 1.0, 0.0, 1.0), sensor_pose=stamped(robot, 0.0, 0.0, 1.0))
        yield "visibility of %d sides, radius %r, axis %d" % (sides, radius, axis), [
            Constraints(visibility_constraints=[one])], bad if radius != radius or axis == 9 else (), ""


def _requests(robot, choose):
    """(what is wrong, MotionPlanRequest, codes, what the sentence names)"""
    good = plan_request(robot)
    for what, goals, codes, says in goals_of(robot):
        yield what, changed(good, goal_constraints=goals), codes, says
    for name in TEXTS[1:]:
        yield "group %.12r" % name, changed(good, group_name=name), {CODES.INVALID_GROUP_NAME}, ""
    yield "no group", changed(good, group_name=""), {CODES.INVALID_GROUP_NAME}, ""
    yield "an unknown pipeline", changed(good, pipeline_id="no_pipeline"), {CODES.FAILURE}, "no_pipeline"
    yield "an unknown planner", changed(good, planner_id="no_planner"), (), ""
    for value in FLOATS:
        yield "planning time %r" % value, changed(good, allowed_planning_time=value), (), ""
        yield "velocity scaling %r" % value, changed(good, max_velocity_scaling_factor=value), (), ""
        yield "acceleration scaling %r" % value, changed(good, max_acceleration_scaling_factor=value), (), ""
        yield "link speed %r" % value, changed(good, max_cartesian_speed=value), (), ""
    for value in (1e-5, 1e-9, 1e-14):
        yield "scaling %r" % value, changed(good, max_velocity_scaling_factor=value,
                                             max_acceleration_scaling_factor=value), (), ""
    yield "speed of an unknown link", changed(good, max_cartesian_speed=0.1,
                                              cartesian_speed_limited_link="tail"), (), ""
    for count in (-5, 0, 2**31 - 1):
        yield "%d attempts" % count, changed(good, num_planning_attempts=count), (), ""
    states = (("a state of too few values", robot.joints, robot.free[1:], "positions"),
              ("a state of NaN", robot.joints, (math.nan, *robot.free[1:]), robot.joints[0]),
              ("a state of inf", robot.joints, (math.inf, *robot.free[1:]), robot.joints[0]))
    for what, names, values, says in states:
        state = RobotState(is_diff=True)
        state.joint_state.name, state.joint_state.position = list(names), list(values)
        yield what, changed(good, start_state=state), {CODES.INVALID_ROBOT_STATE}, says
    yield "a start beyond limits", changed(good, start_state=state_of(
        robot, (*robot.free[:-1], robot.upper[-1] + 1.0))), {CODES.START_STATE_INVALID}, robot.joints[-1]
    state = state_of(robot, robot.free)
    state.multi_dof_joint_state.joint_names = ["world_joint"]
    yield "a base without a pose", changed(good, start_state=state), {CODES.INVALID_ROBOT_STATE}, ""
    held = AttachedCollisionObject(link_name="tail", object=box(robot, "held", 0.05, (0.0, 0.0, 9.0)))
    state = state_of(robot, robot.free)
    state.attached_collision_objects = [held]
    yield "something held by an unknown link", changed(good, start_state=state), {CODES.INVALID_ROBOT_STATE}, "tail"
    yield "path constraints that the start violates", changed(good, path_constraints=joint_goal(
        robot, robot.aside)), {CODES.START_STATE_VIOLATES_PATH_CONSTRAINTS}, robot.joints[0]
    yield "path constraints of an unknown link", changed(good, path_constraints=Constraints(position_constraints=[
        position_of(robot, link="tail")])), (), "tail"
    many = changed(good, goal_constraints=[joint_goal(robot, [value + choose.uniform(0.0, 0.01) for value in
                                                               robot.aside]) for _ in range(300)])
    yield "300 goals", many, (), ""


def _plans(robot, choose):
    for what, request, codes, says in _requests(robot, choose):
        yield Case("plan: %s" % what, "plan_kinematic_path", GetMotionPlanRequest(motion_plan_request=request),
                   frozenset(codes), says)
        if choose.random() < 0.5:
            goal = copy.deepcopy(good_requests(robot)["move_group"])
            goal.request = request
            yield Case("move: %s" % what, "move_group", goal, frozenset(codes), says)
    for what, scene, codes, says in (
            ("a start in collision", diff([box(robot, "crate", 6.0, (0.0, 0.0, 0.0))]), (), ""),
            ("a diff with a bad object", diff([box(robot, "crate", -1.0, (0.0, 0.0, 0.0))]), (), "crate"),
            ("a diff of an unknown frame", diff([framed(box(robot, "crate", 1.0, (9.0, 0.0, 0.0)), "nowhere")]), (),
             "nowhere")):
        goal = copy.deepcopy(good_requests(robot)["move_group"])
        goal.planning_options.planning_scene_diff = scene
        yield Case("move: %s" % what, "move_group", goal, frozenset(codes), says)


