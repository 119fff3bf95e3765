# SPDX-License-Identifier: BSD-3-Clause
"""Requests that move_group answers with success, and the parts that they are made of. Needs messages, no ROS around
them."""
import copy
from dataclasses import dataclass

import genpy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    ExecuteTrajectoryGoal,
    JointConstraint,
    MoveGroupGoal,
    PlanningScene,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningSceneRequest,
    GetCartesianPathRequest,
    GetMotionPlanRequest,
    GetPlanningSceneRequest,
    GetPositionFKRequest,
    GetPositionIKRequest,
    GetStateValidityRequest,
)
from shape_msgs.msg import SolidPrimitive
from trajectory_msgs.msg import JointTrajectoryPoint

IDENTITY = Quaternion(0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Robot:
    """A robot in requests. joints of the group, their upper limits, values where nothing touches and some to go to; its
    last link, where that is at ``aside`` (x, y, z and the quaternion's x, y, z, w) in the planning frame ``frame``."""

    group: str
    joints: tuple
    upper: tuple
    free: tuple
    aside: tuple
    tip: str
    place: tuple
    frame: str


def state_of(robot, values):
    state = RobotState(is_diff=True)
    state.joint_state.name, state.joint_state.position = list(robot.joints), list(values)
    return state


def joint_goal(robot, values, tolerance=1e-3):
    return Constraints(joint_constraints=[JointConstraint(name, value, tolerance, tolerance, 1.0)
                                          for name, value in zip(robot.joints, values, strict=True)])


def plan_request(robot, request=None):
    request = request or GetMotionPlanRequest().motion_plan_request
    request.group_name, request.allowed_planning_time, request.num_planning_attempts = robot.group, 2.0, 1
    request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = 1.0
    request.start_state = state_of(robot, robot.free)
    request.goal_constraints = [joint_goal(robot, robot.aside)]
    return request


def good_requests(robot):
    """{endpoint: a request that is answered with success}"""
    plan = GetMotionPlanRequest(motion_plan_request=plan_request(robot))
    move = MoveGroupGoal()
    plan_request(robot, move.request)
    move.planning_options.plan_only = True
    move.planning_options.planning_scene_diff = diff()
    ik = GetPositionIKRequest()
    ik.ik_request.group_name, ik.ik_request.robot_state = robot.group, state_of(robot, robot.free)
    ik.ik_request.pose_stamped = there(robot)
    fk = GetPositionFKRequest(fk_link_names=[robot.tip], robot_state=state_of(robot, robot.free))
    fk.header.frame_id = robot.frame
    cartesian = GetCartesianPathRequest(group_name=robot.group, start_state=state_of(robot, robot.free), max_step=0.01,
                                        waypoints=[there(robot).pose], avoid_collisions=True)
    cartesian.header.frame_id = robot.frame
    validity = GetStateValidityRequest(group_name=robot.group, robot_state=state_of(robot, robot.free),
                                       constraints=joint_goal(robot, robot.free))
    return {"plan_kinematic_path": plan, "move_group": move, "compute_ik": ik, "compute_fk": fk,
            "compute_cartesian_path": cartesian, "check_state_validity": validity,
            "apply_planning_scene": ApplyPlanningSceneRequest(scene=diff([box(robot, "far", 0.05, (0.0, 0.0, 9.0))])),
            "planning_scene": diff([box(robot, "far", 0.05, (0.0, 0.0, 9.0))]),
            "collision_object": box(robot, "far", 0.05, (0.0, 0.0, 9.0)),
            "attached_collision_object": AttachedCollisionObject(
                link_name=robot.tip, object=box(robot, "held", 0.01, (0.0, 0.0, 9.0)), touch_links=[robot.tip]),
            "get_planning_scene": GetPlanningSceneRequest(),
            "execute_trajectory": trajectory(robot, [robot.free, robot.aside])}


def many_objects(robot, count):
    """An ApplyPlanningSceneRequest of small boxes far from the robot."""
    return ApplyPlanningSceneRequest(scene=diff([
        box(robot, "many_%d" % k, 0.01, (5.0 + 0.02 * (k % 50), 0.02 * (k // 50 % 50), 0.02 * (k // 2500)))
        for k in range(count)]))


def nothing_left():
    """PlanningScenes that empty the scene: what is held first."""
    first, then = PlanningScene(is_diff=True), PlanningScene(is_diff=True)
    first.robot_state.is_diff = then.robot_state.is_diff = True
    first.robot_state.attached_collision_objects = [AttachedCollisionObject(
        object=CollisionObject(operation=CollisionObject.REMOVE))]
    then.world.collision_objects = [CollisionObject(operation=CollisionObject.REMOVE)]
    return first, then


def pose(x, y, z, orientation=IDENTITY):
    return Pose(Point(x, y, z), orientation)


def stamped(robot, x, y, z, orientation=IDENTITY):
    message = PoseStamped(pose=pose(x, y, z, orientation))
    message.header.frame_id = robot.frame
    return message


def there(robot):
    return stamped(robot, *robot.place[:3], Quaternion(*robot.place[3:]))


def box(robot, name, size, at):
    message = CollisionObject(id=name, operation=CollisionObject.ADD, pose=pose(0.0, 0.0, 0.0),
                              primitives=[SolidPrimitive(SolidPrimitive.BOX, [size] * 3)], primitive_poses=[pose(*at)])
    message.header.frame_id = robot.frame
    return message


def diff(objects=(), attached=()):
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.world.collision_objects, scene.robot_state.attached_collision_objects = list(objects), list(attached)
    return scene


def trajectory(robot, points, times=None):
    goal = ExecuteTrajectoryGoal()
    trajectory = goal.trajectory.joint_trajectory
    trajectory.joint_names = list(robot.joints)
    trajectory.points = [JointTrajectoryPoint(positions=list(values), time_from_start=genpy.Duration.from_sec(time))
                         for values, time in zip(points, times or range(len(points)), strict=True)]
    return goal


def changed(message, **fields):
    changed = copy.deepcopy(message)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed


def framed(message, frame):
    message.header.frame_id = frame
    return message
