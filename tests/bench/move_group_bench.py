# SPDX-License-Identifier: BSD-3-Clause
"""PROBOT's move_group with fake controllers: its start-up time and memory; round trips of its services, compared with
empty services with messages of the same sizes; the time until a cancelled goal ends."""
import json
import os
import tempfile
import time

import numpy as np
from labs import Lab, memory_mb

from lab_testing.waiting import wait_until

CALLS, CANCELS = 200, 10
FREE, ASIDE = (0.0, 0.3, 0.4, 0.0, 0.6, 0.0), (1.2, 0.3, 0.4, 0.0, 0.6, 0.5)
JOINTS = ["joint_%d" % number for number in range(1, 7)]
POINTS = 50
LIMIT_S = 60.0


def measure(report, quick, number):
    # The first start compiles code and makes the spheres, unless they are in the cache.
    with Lab(("probot_anno_moveit_config", "demo.launch"), "/clear_octomap", rviz="false"):
        pass
    with Lab(("probot_anno_moveit_config", "demo.launch"), "/clear_octomap", rviz="false") as lab:
        report.add("roslaunch to the last service of move_group", lab.started_s, "s", most=5.0)
        # rospy reads the master's address when it is first used, so import it only now.
        os.environ.update(ROS_MASTER_URI=lab.environment["ROS_MASTER_URI"], ROS_HOSTNAME="localhost")
        times, planning, points = round_trips(lab, CALLS // 10 if quick else CALLS)
        cancels = cancelled(2 if quick else CANCELS)
        report.add("memory of move_group after all of this", memory_mb(lab.process("/move_group").pid), "MB",
                   most=200.0)
    count = len(planning)
    middle = {name: float(np.median(found)) for name, found in times.items()}
    rest = float(np.median(times["plan"] - planning))
    report.add("plan_kinematic_path without its planning time: median", rest, "ms",
               ("empty, same sizes", middle["empty plan"]), samples=count, ratio_most=2.0)
    report.add("plan_kinematic_path: planning time, median", float(np.median(planning)), "ms", samples=count)
    report.add("compute_ik above an empty service of the same sizes: median", middle["ik"] - middle["empty ik"], "ms",
               samples=count, most=2.0)
    report.add("compute_cartesian_path of %d points: median" % points, middle["cartesian"], "ms",
               ("empty, same sizes", middle["empty cartesian"]), samples=count, most=20.0)
    for phase, found in cancels.items():
        report.add("cancel while %s: longest" % phase, max(found), "ms", samples=len(found), most=200.0)
    report.sample("round trip of move_group", "ms", **times)


def round_trips(lab, count):
    """Return ({name: times [ms]}, planning times [ms], points of the Cartesian path); the calls take turns."""
    import rospy
    from moveit_msgs.srv import GetCartesianPath, GetMotionPlan, GetPositionFK, GetPositionFKRequest, GetPositionIK

    rospy.init_node("bench_move_group", anonymous=True, disable_rostime=True, disable_signals=True)
    kinds = {"plan": ("plan_kinematic_path", GetMotionPlan), "ik": ("compute_ik", GetPositionIK),
             "cartesian": ("compute_cartesian_path", GetCartesianPath)}
    pose = rospy.ServiceProxy("compute_fk", GetPositionFK)(GetPositionFKRequest(
        fk_link_names=["tool0"], robot_state=state_of(FREE))).pose_stamped[0]
    requests = requests_of(pose)
    answers = {what: rospy.ServiceProxy(*kinds[what])(request) for what, request in requests.items()}
    for what, answer in answers.items():
        code = getattr(answer, "motion_plan_response", answer).error_code.val
        if code != 1:
            raise SystemExit("%s answers with %d" % (kinds[what][0], code))
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump({what: (kind._type, serialized(answers[what])) for what, (_, kind) in kinds.items()}, file)
        file.flush()
        lab.part("answers", file.name)
    times, planning = {what: [] for name in kinds for what in (name, "empty " + name)}, []
    for turn in range(count + 5):
        for what, (name, kind) in kinds.items():
            for title, service in (("empty " + what, "/bench_answers/" + what), (what, name)):
                begin = time.perf_counter()
                answer = rospy.ServiceProxy(service, kind)(requests[what])
                took = 1e3 * (time.perf_counter() - begin)
                if turn >= 5:  # the first ones open files and fill caches
                    times[title].append(took)
                    if title == "plan":
                        planning.append(1e3 * answer.motion_plan_response.planning_time)
    points = len(answers["cartesian"].solution.joint_trajectory.points)
    return {what: np.array(found) for what, found in times.items()}, np.array(planning), points


def state_of(values):
    from moveit_msgs.msg import RobotState

    state = RobotState(is_diff=True)
    state.joint_state.name, state.joint_state.position = JOINTS, list(values)
    return state


def requests_of(pose):
    """Return {name: request}. pose: of the tool at FREE (PoseStamped)."""
    from geometry_msgs.msg import Point, Pose
    from moveit_msgs.srv import GetCartesianPathRequest, GetMotionPlanRequest, GetPositionIKRequest

    plan = GetMotionPlanRequest()
    asked = plan.motion_plan_request
    asked.group_name, asked.allowed_planning_time, asked.start_state = "manipulator", 5.0, state_of(FREE)
    asked.max_velocity_scaling_factor = asked.max_acceleration_scaling_factor = 1.0
    asked.goal_constraints = [goal_of(ASIDE)]
    ik = GetPositionIKRequest()
    ik.ik_request.group_name, ik.ik_request.robot_state = "manipulator", state_of(ASIDE)
    ik.ik_request.pose_stamped, ik.ik_request.avoid_collisions = pose, True
    at = pose.pose.position
    cartesian = GetCartesianPathRequest(group_name="manipulator", start_state=state_of(FREE), avoid_collisions=True,
                                        waypoints=[Pose(Point(at.x, at.y, at.z - 0.1), pose.pose.orientation)],
                                        max_step=0.1 / (POINTS - 1))
    cartesian.header = pose.header
    return {"plan": plan, "ik": ik, "cartesian": cartesian}


def goal_of(values):
    from moveit_msgs.msg import Constraints, JointConstraint

    return Constraints(joint_constraints=[JointConstraint(name, value, 1e-3, 1e-3, 1.0)
                                          for name, value in zip(JOINTS, values, strict=True)])


def serialized(message):
    from io import BytesIO

    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue().hex()


def cancelled(count):
    """Return {phase: times from the cancel to the result [ms]}."""
    import actionlib
    import rospy
    from moveit_msgs.msg import MoveGroupAction, MoveGroupActionFeedback, MoveGroupGoal, MoveItErrorCodes, PlanningScene
    from moveit_msgs.srv import ApplyPlanningScene

    client = actionlib.SimpleActionClient("move_group", MoveGroupAction)
    client.wait_for_server()
    # The client itself drops feedback that comes before its send_goal() has returned.
    states = []
    feedback = rospy.Subscriber("move_group/feedback", MoveGroupActionFeedback,
                                lambda message: states.append(message.feedback.state))
    wait_until(lambda: feedback.get_num_connections() > 0, "move_group's feedback", LIMIT_S)
    apply = rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)

    def goal(values, speed):
        goal = MoveGroupGoal()
        goal.request.group_name, goal.request.allowed_planning_time = "manipulator", LIMIT_S
        goal.request.max_velocity_scaling_factor = goal.request.max_acceleration_scaling_factor = speed
        goal.request.start_state.is_diff = goal.planning_options.planning_scene_diff.is_diff = True
        goal.planning_options.planning_scene_diff.robot_state.is_diff = True
        goal.request.goal_constraints = [goal_of(values)]
        return goal

    def took(goal, wait_s, phase):
        """Return the time from cancelling a goal to its end [ms]. The goal is cancelled ``wait_s`` after its feedback
        names the phase."""
        states.clear()
        client.send_goal(goal)
        wait_until(lambda: phase in states, phase, LIMIT_S, 0.001)
        time.sleep(wait_s)
        begin = time.perf_counter()
        client.cancel_goal()
        client.wait_for_result(rospy.Duration(LIMIT_S))
        found = 1e3 * (time.perf_counter() - begin)
        if client.get_result().error_code.val != MoveItErrorCodes.PREEMPTED:
            raise SystemExit("a cancelled goal ended with %d" % client.get_result().error_code.val)
        return found

    found = {"waiting for a joint state": [took(goal(ASIDE, 1.0), 0.0, "PLANNING") for _ in range(count)]}
    found["moving"] = [took(goal(ASIDE if k % 2 else FREE, 0.02), 0.2, "MONITOR") for k in range(count)]
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.world.collision_objects = [wall()]
    apply(scene)
    found["looking for a path"] = [took(goal(BEHIND, 1.0), 0.3, "PLANNING") for _ in range(count)]
    return found


# Behind a wall that no path leads around: the first joint cannot make a full turn.
BEHIND = (2.4, 0.3, 0.4, 0.0, 0.6, 0.0)


def wall():
    """Two walls from the arm's axis outwards, higher than the arm reaches, at 1.6 rad and on the opposite side."""
    from geometry_msgs.msg import Point, Pose, Quaternion
    from moveit_msgs.msg import CollisionObject
    from shape_msgs.msg import SolidPrimitive

    message = CollisionObject(id="walls", operation=CollisionObject.ADD)
    message.header.frame_id = "base_link"
    for angle in (1.6, -2.2):
        message.primitives.append(SolidPrimitive(SolidPrimitive.BOX, [1.0, 0.01, 3.0]))
        message.primitive_poses.append(Pose(Point(0.65 * np.cos(angle), 0.65 * np.sin(angle), 0.0), Quaternion(
            0.0, 0.0, np.sin(0.5 * angle), np.cos(0.5 * angle))))
    message.pose.orientation.w = 1.0
    return message
