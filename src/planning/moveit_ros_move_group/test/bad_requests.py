# SPDX-License-Identifier: BSD-3-Clause
"""Requests that move_group must refuse in one sentence, and some that it must survive. The same seed gives the same
requests."""
import copy
import math
import random

import genpy
from bad_plans import CODES, FLOATS, TEXTS, Case, _plans, goals_of, position_of
from geometry_msgs.msg import Point, Quaternion, TransformStamped, Vector3
from good_requests import (
    box,
    changed,
    diff,
    framed,
    good_requests,
    pose,
    stamped,
    state_of,
    there,
    trajectory,
)
from moveit_msgs.msg import (
    AllowedCollisionEntry,
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    ExecuteTrajectoryGoal,
    JointConstraint,
    LinkPadding,
    LinkScale,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningSceneRequest,
    GetPlanningSceneRequest,
    GetPositionIKRequest,
    SetPlannerParamsRequest,
)
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive
from trajectory_msgs.msg import MultiDOFJointTrajectoryPoint

KNOWN_CODES = frozenset(value for name, value in vars(CODES).items() if name.isupper() and isinstance(value, int))


def cases(robot, seed, count):
    """Return ``count`` Cases: every known kind of bad request, in an order that the seed gives, then good ones of which
    a few fields are spoiled."""
    choose = random.Random(seed)
    named = [case for make in (_plans, _scenes, _kinematics, _cartesian, _validity, _executions, _planners)
             for case in make(robot, choose)]
    choose.shuffle(named)
    named = named[:count]
    good = good_requests(robot)
    while len(named) < count:
        endpoint = choose.choice(sorted(good))
        message, what = spoiled(good[endpoint], choose)
        named.append(Case("%s: %s" % (endpoint, what), endpoint, message))
    return named


def outcome(answer):
    """(code, text) of what a service or an action answers: a response, or (status, result, text); None without code."""
    if isinstance(answer, tuple):
        return answer[1].error_code.val, answer[2]
    answer = getattr(answer, "motion_plan_response", answer)
    return getattr(getattr(answer, "error_code", None), "val", None), ""


def flaws_of(case, code, sentences):
    """Flaws of the answer to a Case. code: None where the answer has none; sentences: the failures' texts."""
    flaws = []
    if code is not None and code not in KNOWN_CODES:
        flaws.append("%s is not an error code" % code)
    if case.codes and code not in case.codes:
        flaws.append("the code is none of %s" % sorted(case.codes))
    if code not in (None, CODES.SUCCESS) and len(sentences) != 1:
        flaws.append("%d failures were told" % len(sentences))
    if case.says and sentences and not any(case.says in sentence for sentence in sentences):
        flaws.append("%r is not in %s" % (case.says, sentences))
    flaws += ["%r is no sentence in one line" % sentence for sentence in sentences
              if not sentence or "\n" in sentence or len(sentence) > 1100]
    return flaws


# -- scenes ---------------------------------------------------------------------------------------------------------

def _objects(robot):
    """(what is wrong, CollisionObject, what the sentence names)"""
    def thing(**fields):
        return changed(box(robot, "thing", 0.1, (0.0, 0.0, 9.0)), **fields)

    yield "no name", thing(id=""), ""
    yield "the octomap's name", thing(id="<octomap>"), "<octomap>"
    yield "an unknown operation", thing(operation=9), "9"
    yield "removing what is not there", CollisionObject(id="ghost", operation=CollisionObject.REMOVE), "ghost"
    yield "moving what is not there", CollisionObject(id="ghost", operation=CollisionObject.MOVE), "ghost"
    yield "no shapes", thing(primitives=[], primitive_poses=[]), "thing"
    yield "an unknown frame", framed(thing(), "nowhere"), "nowhere"
    for sizes in ([], [1.0], [0.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [math.nan, 1.0, 1.0], [math.inf, 1.0, 1.0],
                  [1e300, 1.0, 1.0]):
        yield "a box of %s" % sizes, thing(primitives=[SolidPrimitive(SolidPrimitive.BOX, sizes)]), "thing"
    for kind, sizes in ((SolidPrimitive.SPHERE, [0.0]), (SolidPrimitive.CYLINDER, [1.0]), (SolidPrimitive.CONE, []),
                        (0, [1.0]), (99, [1.0])):
        yield "a primitive of kind %d, %s" % (kind, sizes), thing(primitives=[SolidPrimitive(kind, sizes)]), "thing"
    for where in (pose(math.nan, 0.0, 0.0), pose(1e300, 0.0, 0.0), pose(0.0, 0.0, 0.0, Quaternion(9.0, 0.0, 0.0, 1.0)),
                  pose(0.0, 0.0, 0.0, Quaternion(math.inf, 0.0, 0.0, 1.0))):
        yield "a pose of %s" % str(where).replace("\n", " "), thing(pose=where), "thing"
        yield "a shape's pose of %s" % str(where).replace("\n", " "), thing(primitive_poses=[where]), "thing"
    yield "more poses than shapes", thing(primitive_poses=[pose(0.0, 0.0, 9.0)] * 3), "thing"
    corners = [Point(), Point(x=1.0), Point(y=1.0)]
    for what, mesh in (("no triangles", Mesh([], corners)), ("no vertices", Mesh([MeshTriangle((0, 1, 2))], [])),
                       ("an index too far", Mesh([MeshTriangle((0, 1, 2**32 - 1))], corners)),
                       ("a vertex of NaN", Mesh([MeshTriangle((0, 1, 2))], [*corners[:2], Point(z=math.nan)])),
                       ("a vertex far away", Mesh([MeshTriangle((0, 1, 2))], [*corners[:2], Point(z=1e200)]))):
        yield "a mesh with %s" % what, thing(primitives=[], primitive_poses=[], meshes=[mesh],
                                             mesh_poses=[pose(0.0, 0.0, 9.0)]), "thing"
    for coefficients in ((0.0, 0.0, 0.0, 1.0), (math.nan, 0.0, 1.0, 0.0), (0.0, 0.0, 1.0, math.inf)):
        yield "a plane of %s" % (coefficients,), thing(primitives=[], primitive_poses=[], planes=[Plane(coefficients)],
                                                       plane_poses=[pose(0.0, 0.0, 9.0)]), "thing"
    yield "subframes without poses", thing(subframe_names=["a", "b"]), "thing"


def _held(robot):
    """(what is wrong, AttachedCollisionObject, what the sentence names)"""
    crate = box(robot, "thing", 0.1, (0.0, 0.0, 9.0))
    yield "an unknown link", AttachedCollisionObject(link_name="tail", object=crate), "tail"
    yield "no link", AttachedCollisionObject(object=crate), ""
    yield "nothing of that name", AttachedCollisionObject(
        link_name=robot.tip, object=CollisionObject(id="ghost", operation=CollisionObject.ADD)), "ghost"
    yield "letting go of what is not held", AttachedCollisionObject(
        link_name=robot.tip, object=CollisionObject(id="ghost", operation=CollisionObject.REMOVE)), "ghost"
    yield "moving it", AttachedCollisionObject(link_name=robot.tip, object=changed(
        crate, operation=CollisionObject.MOVE)), "thing"
    for what, one, says in _objects(robot):
        if one.operation == CollisionObject.ADD and one.primitives + one.meshes + one.planes:
            yield what, AttachedCollisionObject(link_name=robot.tip, object=one), says


def _settings(robot):
    """(what is wrong, PlanningScene)"""
    def scene(**fields):
        return changed(diff(), **fields)

    for value in (math.nan, -1.0, math.inf):
        yield "padding of %r" % value, scene(link_padding=[LinkPadding(robot.tip, value)])
        yield "scale of %r" % value, scene(link_scale=[LinkScale(robot.tip, value)])
    yield "padding of an unknown link", scene(link_padding=[LinkPadding("tail", 0.1)])
    ragged = diff()
    ragged.allowed_collision_matrix.entry_names = ["a", "b"]
    ragged.allowed_collision_matrix.entry_values = [AllowedCollisionEntry([True])]
    yield "a ragged matrix", ragged
    defaults = diff()
    defaults.allowed_collision_matrix.default_entry_names = ["a", "b"]
    yield "defaults without values", defaults
    tree = TransformStamped(child_frame_id="a")
    tree.header.frame_id = "nowhere"
    yield "a fixed frame in an unknown one", scene(fixed_frame_transforms=[tree])
    bad = TransformStamped(child_frame_id="a")
    bad.header.frame_id, bad.transform.translation = robot.frame, Vector3(math.nan, 0.0, 0.0)
    yield "a fixed frame of NaN", scene(fixed_frame_transforms=[bad])
    for kind, resolution, data in (("OcTree", 0.0, [1, 2]), ("OcTree", math.nan, [1, 2]), ("OcTree", 1e308, [1] * 40),
                                   ("Cabbage", 0.1, [1, 2]), ("OcTree", 0.1, [-1] * 7), ("OcTree", 1e-320, [-86] * 9)):
        for binary in (True, False):
            one = diff()
            octomap = one.world.octomap
            octomap.header.frame_id, octomap.origin = robot.frame, pose(0.0, 0.0, 0.0)
            octomap.octomap.id, octomap.octomap.resolution, octomap.octomap.binary = kind, resolution, binary
            octomap.octomap.data = data
            yield "an octomap %s of %r m, %d bytes, binary %s" % (kind, resolution, len(data), binary), one
    state = diff()
    state.robot_state = RobotState(is_diff=True)
    state.robot_state.joint_state.name, state.robot_state.joint_state.position = list(robot.joints), [math.nan]
    yield "a robot state of one value", state


def _scenes(robot, choose):
    for what, one, says in _objects(robot):
        yield Case("object: %s" % what, "apply_planning_scene", ApplyPlanningSceneRequest(scene=diff([one])), says=says)
        if choose.random() < 0.3:
            yield Case("object's topic: %s" % what, "collision_object", one, says=says)
    for what, one, says in _held(robot):
        yield Case("held: %s" % what, "apply_planning_scene", ApplyPlanningSceneRequest(scene=diff((), [one])),
                   says=says)
        if choose.random() < 0.3:
            yield Case("held's topic: %s" % what, "attached_collision_object", one, says=says)
    for what, scene in _settings(robot):
        if choose.random() < 0.5:
            yield Case("scene's topic: %s" % what, "planning_scene", scene)
        else:
            yield Case("scene: %s" % what, "apply_planning_scene", ApplyPlanningSceneRequest(scene=scene))
    for bits in (0, 1, 2**32 - 1):
        yield Case("get: %d" % bits, "get_planning_scene", _components(bits))


def _components(bits):
    request = GetPlanningSceneRequest()
    request.components.components = bits
    return request


# -- the rest -------------------------------------------------------------------------------------------------------

def _kinematics(robot, choose):
    good = good_requests(robot)

    def ik(what, codes=(), says="", **fields):
        request = GetPositionIKRequest(ik_request=changed(good["compute_ik"].ik_request, **fields))
        return Case("ik: %s" % what, "compute_ik", request, frozenset(codes), says)

    yield ik("no group", {CODES.INVALID_GROUP_NAME}, group_name="")
    yield ik("an unknown group", {CODES.INVALID_GROUP_NAME}, "legs", group_name="legs")
    yield ik("an unknown link", {CODES.INVALID_LINK_NAME, CODES.NO_IK_SOLUTION}, "tail", ik_link_name="tail")
    yield ik("a link that it cannot move", {CODES.NO_IK_SOLUTION, CODES.INVALID_LINK_NAME}, ik_link_name=robot.frame)
    yield ik("an unknown frame", {CODES.FRAME_TRANSFORM_FAILURE}, "nowhere",
             pose_stamped=framed(there(robot), "nowhere"))
    yield ik("out of reach", {CODES.NO_IK_SOLUTION}, pose_stamped=stamped(robot, 40.0, 0.0, 0.0))
    for turn in (Quaternion(0.0, 0.0, 0.0, 7.0), Quaternion(math.nan, 0.0, 0.0, 1.0)):
        yield ik("a quaternion of %s" % [turn.x, turn.w], {CODES.FAILURE, CODES.NO_IK_SOLUTION},
                 pose_stamped=stamped(robot, 0.3, 0.1, 0.4, turn))
    yield ik("a quaternion of zeros", pose_stamped=stamped(robot, 0.3, 0.1, 0.4, Quaternion()))
    for value in FLOATS:
        yield ik("x at %r" % value, pose_stamped=stamped(robot, value, 0.1, 0.4))
    yield ik("poses without links", {CODES.INVALID_LINK_NAME, CODES.NO_IK_SOLUTION},
             pose_stamped_vector=[there(robot)] * 2)
    yield ik("two poses of a link", {CODES.NO_IK_SOLUTION, CODES.INVALID_LINK_NAME}, ik_link_names=[robot.tip] * 2,
             pose_stamped_vector=[there(robot), stamped(robot, -0.3, 0.1, 0.4)])
    for seconds in (-2**31, -1, 2**31 - 1):
        yield ik("%d s, and nothing will do" % seconds, {CODES.NO_IK_SOLUTION}, timeout=genpy.Duration(seconds, 0),
                 constraints=Constraints(joint_constraints=[JointConstraint(
                     robot.joints[0], robot.upper[0] + 1.0, 0.0, 0.0, 1.0)]))
    yield ik("constraints of an unknown joint", says="elbow_9", constraints=Constraints(
        joint_constraints=[JointConstraint("elbow_9", 0.0, 0.1, 0.1, 1.0)]))
    state = state_of(robot, robot.free)
    state.joint_state.position = [0.0]
    yield ik("a state of too few values", {CODES.INVALID_ROBOT_STATE}, robot_state=state)
    for what, links, frame, codes in (
            ("an unknown link", ["tail"], robot.frame, {CODES.INVALID_LINK_NAME}),
            ("no link", [], robot.frame, {CODES.INVALID_LINK_NAME}),
            ("one of two is unknown", [robot.tip, "tail"], "", {CODES.INVALID_LINK_NAME}),
            ("an unknown frame", [robot.tip], "nowhere", {CODES.FRAME_TRANSFORM_FAILURE}),
            ("20,000 links", ["tail_%d" % k for k in range(20000)], "", {CODES.INVALID_LINK_NAME})):
        request = framed(changed(good["compute_fk"], fk_link_names=links), frame)
        yield Case("fk: %s" % what, "compute_fk", request, frozenset(codes))


def _cartesian(robot, choose):
    good = good_requests(robot)["compute_cartesian_path"]

    def path(what, codes=(), says="", frame=None, **fields):
        request = changed(good, **fields)
        if frame is not None:
            request.header.frame_id = frame
        return Case("cartesian: %s" % what, "compute_cartesian_path", request, frozenset(codes), says)

    yield path("no group", {CODES.INVALID_GROUP_NAME}, group_name="")
    yield path("an unknown link", {CODES.INVALID_LINK_NAME}, "tail", link_name="tail")
    yield path("a link that it cannot move", link_name=robot.frame)
    yield path("an unknown frame", {CODES.FRAME_TRANSFORM_FAILURE}, "nowhere", frame="nowhere")
    for value in FLOATS:
        codes = {CODES.FAILURE} if not value > 0.0 or value in (math.inf, 1e-320) else ()
        yield path("steps of %r" % value, codes, max_step=value)
        yield path("a jump of %r" % value, jump_threshold=value)
        yield path("a speed of %r" % value, max_cartesian_speed=value)
        yield path("x at %r" % value, waypoints=[pose(value, 0.1, 0.4)])
    yield path("no waypoints", waypoints=[])
    yield path("a quaternion of 7", {CODES.FAILURE}, "waypoint 1",
               waypoints=[pose(0.3, 0.1, 0.4, Quaternion(0.0, 0.0, 0.0, 7.0))])
    yield path("5,000 waypoints far apart", waypoints=[pose(50.0 * (-1) ** k, 0.1, 0.4) for k in range(5000)])
    yield path("constraints of an unknown link", says="tail", path_constraints=Constraints(position_constraints=[
        position_of(robot, link="tail")]))


def _validity(robot, choose):
    good = good_requests(robot)["check_state_validity"]
    yield Case("validity: an unknown group", "check_state_validity", changed(good, group_name="legs"))
    state = state_of(robot, robot.free)
    state.joint_state.position = [math.nan]
    yield Case("validity: a bad state", "check_state_validity", changed(good, robot_state=state))
    for what, goals, _, _ in goals_of(robot):
        if goals:
            yield Case("validity: %s" % what, "check_state_validity", changed(good, constraints=goals[0]))


def _executions(robot, choose):
    failed = frozenset((CODES.CONTROL_FAILED,))

    def execute(what, goal, says=""):
        return Case("execute: %s" % what, "execute_trajectory", goal, failed, says)

    def changed(**fields):
        goal = trajectory(robot, [robot.free, robot.aside])
        for name, value in fields.items():
            setattr(goal.trajectory.joint_trajectory.points[1], name, value)
        return goal

    yield execute("nothing", ExecuteTrajectoryGoal())
    for what, names in (("no joints", []), ("a joint twice", [robot.joints[0]] * len(robot.joints)),
                        ("an unknown joint", [*robot.joints[:-1], "elbow_9"])):
        goal = trajectory(robot, [robot.free, robot.aside])
        goal.trajectory.joint_trajectory.joint_names = names
        yield execute(what, goal, "elbow_9" if "elbow_9" in names else "")
    for value in (math.nan, math.inf):
        yield execute("a position of %r" % value, changed(positions=[value] * len(robot.joints)), "point 2")
        yield execute("a velocity of %r" % value, changed(velocities=[value] * len(robot.joints)), "point 2")
        yield execute("an effort of %r" % value, changed(effort=[value] * len(robot.joints)), "point 2")
    for field in ("positions", "velocities", "accelerations", "effort"):
        yield execute("one of %s" % field, changed(**{field: [0.0]}), "point 2")
        yield execute("too many %s" % field, changed(**{field: [0.0] * 99}), "point 2")
    yield execute("times that fall", trajectory(robot, [robot.free, robot.aside], [1.0, 0.5]), "point 2")
    yield execute("times below 0", trajectory(robot, [robot.free, robot.aside], [-2.0, -1.0]), "point 1")
    yield execute("a start elsewhere", trajectory(robot, [[value + 0.5 for value in robot.free], robot.free]),
                  "deviates")
    multi = ExecuteTrajectoryGoal()
    multi.trajectory.multi_dof_joint_trajectory.joint_names = ["world_joint"]
    multi.trajectory.multi_dof_joint_trajectory.points = [MultiDOFJointTrajectoryPoint()]
    yield execute("a flying base", multi, "world_joint")


def _planners(robot, choose):
    for what, pipeline, group, keys, values in (
            ("an unknown pipeline", "no_pipeline", "", ["range"], ["0.1"]),
            ("an unknown group", "", "legs", ["range"], ["0.1"]),
            ("keys without values", "", "", ["range", "goal_bias"], []),
            ("values without keys", "", "", [], ["1"] * 100),
            ("10,000 keys", "", robot.group, ["k%d" % k for k in range(10000)], ["v"] * 10000)):
        request = SetPlannerParamsRequest(pipeline_id=pipeline, group=group, planner_config="RRT")
        request.params.keys, request.params.values = keys, values
        yield Case("planner: %s" % what, "set_planner_params", request)


# -- spoiling -------------------------------------------------------------------------------------------------------

def spoiled(message, choose):
    """Return (a copy of a message with one to three of its fields spoiled, which ones)."""
    message = copy.deepcopy(message)
    fields = list(_fields(message, ""))
    some = choose.sample(fields, min(len(fields), choose.randint(1, 3)))
    for owner, name, kind, _ in some:
        setattr(owner, name, _wrong(kind, getattr(owner, name), choose))
    return message, ", ".join(path for *_, path in some)


def _fields(message, path):
    """(owner, field's name, its type, its path) of all fields of a message that are not messages themselves."""
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        value, here = getattr(message, name), "%s.%s" % (path, name)
        if isinstance(value, genpy.Message):
            yield from _fields(value, here)
        else:
            yield message, name, kind, here
            if isinstance(value, list):
                for k, one in enumerate(value[:3]):
                    if isinstance(one, genpy.Message):
                        yield from _fields(one, "%s[%d]" % (here, k))


def _wrong(kind, value, choose):
    if kind.endswith("]"):
        element = kind[:kind.index("[")]
        if kind[-2] != "[":  # as many as there have to be
            return [_wrong(element, one, choose) for one in value]
        way = choose.randrange(3)
        if way == 0 or not len(value):
            return []
        if way == 1:
            return list(value) * choose.choice((2, 5))
        return [_wrong(element, value[0], choose), *value[1:]]
    if kind in ("float32", "float64"):
        return choose.choice(FLOATS)
    if kind == "string":
        return choose.choice(TEXTS)
    if kind == "bool":
        return not value
    if kind == "time":
        return genpy.Time(choose.choice((0, 1, 2**32 - 1)), 0)
    if kind == "duration":
        return genpy.Duration(choose.choice((-2**31, -1, 0, 2**31 - 1)), 0)
    if kind in ("int8", "byte"):
        return choose.choice((-128, -1, 0, 127))
    if kind == "int32":
        return choose.choice((-2**31, -1, 0, 2**31 - 1))
    if kind.startswith("u") or kind == "char":
        return choose.choice((0, 1, 200))
    return type(value)() if isinstance(value, genpy.Message) else value
