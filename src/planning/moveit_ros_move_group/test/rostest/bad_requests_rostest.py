#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A running move_group with fake controllers gets 500 bad requests: each is answered in one sentence; nothing dies.

~group, ~free, ~aside: a group of joints, and values of them where nothing touches. ~seed, ~requests: which, how many.
"""
import itertools
import sys
import time
import unittest
from pathlib import Path

import actionlib
import rosgraph
import rospy
from motion_planning_msgs.msg import Failure
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    ExecuteTrajectoryAction,
    MoveGroupAction,
    MoveItErrorCodes,
    PlanningScene,
    PlanningSceneComponents,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetCartesianPath,
    GetMotionPlan,
    GetPlanningScene,
    GetPlanningSceneRequest,
    GetPositionFK,
    GetPositionFKRequest,
    GetPositionIK,
    GetStateValidity,
    SetPlannerParams,
)

from lab_testing.waiting import stretched, wait_until
from motion_planning.model import PlanningModel

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bad_requests import cases, flaws_of, outcome  # noqa: E402
from good_requests import Robot, box, diff, good_requests, many_objects, nothing_left, state_of  # noqa: E402

TIMEOUT_S = stretched(120.0)
SERVICES = {"plan_kinematic_path": GetMotionPlan, "compute_ik": GetPositionIK, "compute_fk": GetPositionFK,
            "compute_cartesian_path": GetCartesianPath, "check_state_validity": GetStateValidity,
            "apply_planning_scene": ApplyPlanningScene, "get_planning_scene": GetPlanningScene,
            "set_planner_params": SetPlannerParams}
ACTIONS = {"move_group": MoveGroupAction, "execute_trajectory": ExecuteTrajectoryAction}
TOPICS = {"planning_scene": PlanningScene, "collision_object": CollisionObject,
          "attached_collision_object": AttachedCollisionObject}


def robot():
    """The Robot of the parameters."""
    model = PlanningModel.from_xml(rospy.get_param("robot_description"), rospy.get_param("robot_description_semantic"))
    group = model.groups[rospy.get_param("~group")]
    return Robot(group.name, group.joints, tuple(model.bounds[group.indices, 1]), tuple(rospy.get_param("~free")),
                 tuple(rospy.get_param("~aside")), group.tip, (), model.frame)


class BadRequestsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = robot()
        cls.services = {name: rospy.ServiceProxy(name, kind, persistent=True) for name, kind in SERVICES.items()}
        cls.actions = {name: actionlib.SimpleActionClient(name, kind) for name, kind in ACTIONS.items()}
        cls.topics = {name: rospy.Publisher(name, kind, queue_size=10) for name, kind in TOPICS.items()}
        for name in SERVICES:
            rospy.wait_for_service(name, TIMEOUT_S)
        for client in cls.actions.values():
            assert client.wait_for_server(rospy.Duration(TIMEOUT_S)), "move_group is not there"
        for name, publisher in cls.topics.items():
            wait_until(lambda publisher=publisher: publisher.get_num_connections(), "move_group on %s" % name)
        cls.failures = []
        cls.subscriber = rospy.Subscriber("/move_group/failures", Failure, cls.failures.append, queue_size=1000)
        cls.marks = itertools.count()
        request = GetPositionFKRequest(fk_link_names=[cls.robot.tip], robot_state=state_of(cls.robot, cls.robot.aside))
        pose = cls.services["compute_fk"](request).pose_stamped[0].pose
        place = (pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.y,
                 pose.orientation.z, pose.orientation.w)
        cls.robot = Robot(**{**vars(cls.robot), "place": place})
        cls.pid = cls.process()

    @staticmethod
    def process():
        return rosgraph.Master("/test").lookupNode("/move_group")

    def ask(self, endpoint, message):
        """Return what is answered; None of a topic, once the message and all before it have been read."""
        if endpoint in SERVICES:
            return self.services[endpoint](message)
        if endpoint in TOPICS:
            self.topics[endpoint].publish(message)
            return self.wait_for_mark(endpoint)
        client = self.actions[endpoint]
        client.send_goal(message)
        self.assertTrue(client.wait_for_result(rospy.Duration(TIMEOUT_S)), "%s does not end" % endpoint)
        return client.get_state(), client.get_result(), client.get_goal_status_text()

    def wait_for_mark(self, topic):
        name = "mark_%d" % next(self.marks)
        thing = box(self.robot, name, 0.01, (0.0, 0.0, 30.0))
        held = AttachedCollisionObject(link_name=self.robot.tip, object=thing)
        self.topics[topic].publish({"planning_scene": diff([thing]), "collision_object": thing,
                                    "attached_collision_object": held}[topic])
        request = GetPlanningSceneRequest()
        request.components.components = (PlanningSceneComponents.WORLD_OBJECT_NAMES
                                         | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS)

        def there():
            scene = self.services["get_planning_scene"](request).scene
            return name in [one.id for one in scene.world.collision_objects] + [
                one.object.id for one in scene.robot_state.attached_collision_objects]

        wait_until(there, "the object after a message on %s" % topic, TIMEOUT_S)

    def tidy(self):
        for scene in nothing_left():
            self.services["apply_planning_scene"](scene)

    def flaws(self, case):
        """Flaws of the answer to a Case, and how long it took [s]."""
        self.failures.clear()
        begin = time.monotonic()
        answer = self.ask(case.endpoint, case.message)
        code, text = outcome(answer)
        took = time.monotonic() - begin

        def told():
            return [one for one in list(self.failures) if one.request == case.endpoint]

        # Its failure is waited for also where nothing is expected of its text: it would count as the next one's.
        refused = code not in (None, MoveItErrorCodes.SUCCESS) or not getattr(answer, "success", True)
        if refused or case.says:
            try:
                wait_until(told, "a failure", 20.0 if refused else 2.0)
            except AssertionError:
                if refused:
                    return "%s: %s (%s), and no failure is told" % (case.name, code, text), took
        if case.endpoint in (*TOPICS, "apply_planning_scene"):
            self.tidy()
        flaws = flaws_of(case, code, [one.text for one in told()])
        return "".join("%s: %s (%s): %s" % (case.name[:100], code, text[:200], flaw) for flaw in flaws), took

    def test_each_is_refused_and_nothing_dies(self):
        slowest, wrong = ("", 0.0), []
        some = cases(self.robot, rospy.get_param("~seed", 1), rospy.get_param("~requests", 500))
        begin = time.monotonic()
        for case in some:
            flaw, took = self.flaws(case)
            if flaw:
                wrong.append(flaw)
            slowest = max(slowest, (case.name, took), key=lambda one: one[1])
        print("%d requests in %.1f s; the slowest: %s, %.2f s" % (len(some), time.monotonic() - begin, *slowest))
        self.assertEqual(wrong, [])
        self.check_it_works()

    def test_many_objects_come_and_go(self):
        request = many_objects(self.robot, rospy.get_param("~objects", 10000))
        self.assertTrue(self.services["apply_planning_scene"](request).success)
        self.check_it_works()
        self.tidy()
        self.check_it_works()

    def check_it_works(self):
        request = good_requests(self.robot)["plan_kinematic_path"]
        request.motion_plan_request.allowed_planning_time = TIMEOUT_S
        code, _ = outcome(self.ask("plan_kinematic_path", request))
        self.assertEqual(code, MoveItErrorCodes.SUCCESS, self.failures[-1:])
        self.assertEqual(self.process(), self.pid, "move_group was restarted")


if __name__ == "__main__":
    import rostest

    rospy.init_node("bad_requests_test")
    rostest.rosrun("moveit_ros_move_group", "bad_requests", BadRequestsTest)
