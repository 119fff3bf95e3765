#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every service refuses numbers out of bounds and names the bound; resets undo what was set."""
import math
import unittest

import rospy
import rostest
from bullet_sim_msgs.srv import AdvanceTicks
from gazebo_msgs import srv
from gazebo_msgs.msg import LinkState, LinkStates, ModelState, ModelStates, ODEJointProperties, ODEPhysics
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from std_srvs.srv import Empty

from lab_testing.waiting import wait_for_publishers, wait_until

BOX = """<robot name="box"><link name="body"><inertial><mass value="%s"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>
  <collision><geometry><box size="%s"/></geometry></collision></link></robot>"""
SERVICES = {
    "spawn_urdf_model": srv.SpawnModel, "spawn_sdf_model": srv.SpawnModel, "delete_model": srv.DeleteModel,
    "get_model_state": srv.GetModelState, "set_model_state": srv.SetModelState, "set_link_state": srv.SetLinkState,
    "get_link_properties": srv.GetLinkProperties, "set_link_properties": srv.SetLinkProperties,
    "get_joint_properties": srv.GetJointProperties, "set_joint_properties": srv.SetJointProperties,
    "apply_body_wrench": srv.ApplyBodyWrench, "apply_joint_effort": srv.ApplyJointEffort,
    "set_model_configuration": srv.SetModelConfiguration, "clear_body_wrenches": srv.BodyRequest,
    "get_physics_properties": srv.GetPhysicsProperties, "set_physics_properties": srv.SetPhysicsProperties,
    "pause_physics": Empty, "reset_simulation": Empty, "reset_world": Empty, "advance": AdvanceTicks}
DEADLINE_S = 90.0
NOW, ALWAYS = rospy.Time(0), rospy.Duration(-1)
UPRIGHT = Quaternion(0, 0, 0, 1)
ABSURD = (1e308, -1e308, 1e30, math.nan, math.inf)


class GazeboBounds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, srv_class in SERVICES.items():
            proxy = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(proxy))

    def setUp(self):
        self.pause_physics()
        self.reset_simulation()
        self.delete_model("box")
        response = self.spawn_urdf_model("box", BOX % ("1", "0.2 0.2 0.2"), "", Pose(Point(5, 0, 0.1), UPRIGHT), "")
        self.assertTrue(response.success, response.status_message)

    def refused(self, response, *words):
        self.assertFalse(response.success, response.status_message)
        for word in words:
            self.assertIn(word, response.status_message)

    def all_is_well(self):
        self.assertTrue(self.advance(ticks=20).success)
        position = self.get_model_state("box", "").pose.position
        for found, expected in zip((position.x, position.y, position.z), (5, 0, 0.1), strict=True):
            self.assertAlmostEqual(found, expected, delta=1e-2)

    # -- refused ----------------------------------------------------------------------------------------------------

    def test_wrenches_and_efforts(self):
        for value in (*ABSURD, 1e8):
            wrench = Wrench(Vector3(0, value, 0), Vector3())
            self.refused(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS), "-1e+07 to 1e+07 N")
            wrench = Wrench(Vector3(), Vector3(0, 0, value))
            self.refused(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS), "-1e+07 to 1e+07 N m")
            self.refused(self.apply_joint_effort("door::hinge", value, NOW, ALWAYS), "-1e+07 to 1e+07 N or N m")
        wrench = Wrench(Vector3(1e7, 0, 0), Vector3())
        self.refused(self.apply_body_wrench("box::body", "", Point(0, 100, 0), wrench, NOW, ALWAYS),
                     "the torque at the centre of mass")
        self.all_is_well()

    def test_pushes_without_end_do_not_pile_up(self):
        wrench = Wrench(Vector3(0, 0, 1e-9), Vector3())
        answers = [self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS) for _ in range(1001)]
        self.assertTrue(all(answer.success for answer in answers[:1000]))
        self.refused(answers[-1], "1000 are under way already", "clear_body_wrenches")
        self.clear_body_wrenches("box::body")
        self.all_is_well()

    def test_poses_and_velocities(self):
        for value in ABSURD:
            pose, twist = Pose(Point(0, value, 0), UPRIGHT), Twist(Vector3(value, 0, 0), Vector3())
            good = Pose(Point(5, 0, 0.1), UPRIGHT)
            turn = Twist(Vector3(), Vector3(0, 0, value))
            skew = Pose(Point(5, 0, 0.1), Quaternion(value, 0, 0, 1))
            for where, move in ((pose, Twist()), (good, twist), (good, turn), (skew, Twist())):
                self.refused(self.set_model_state(ModelState("box", where, move, "")))
                self.refused(self.set_link_state(LinkState("box::body", where, move, "")))
            self.refused(self.spawn_urdf_model("far", BOX % ("1", "1 1 1"), "", pose, ""))
        self.refused(self.set_model_state(ModelState("box", Pose(Point(0, 0, 1e9), UPRIGHT), Twist(), "")),
                     "the position is (0, 0, 1e+09) m; expected -1e+07 to 1e+07 m")
        self.all_is_well()

    def test_topics_refuse_what_the_services_do(self):
        states = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
        links = rospy.Publisher("/gazebo/set_link_state", LinkState, queue_size=1)
        wait_until(lambda: states.get_num_connections() and links.get_num_connections(), "connections to /gazebo")
        for value in ABSURD:
            twist = Twist(Vector3(), Vector3(0, 0, value))
            states.publish(ModelState("box", Pose(Point(0, value, 0), UPRIGHT), Twist(), ""))
            self.assertTrue(self.advance(1, ["/gazebo/set_model_state"], DEADLINE_S).success)
            links.publish(LinkState("box::body", Pose(Point(5, 0, 0.1), UPRIGHT), twist, ""))
            self.assertTrue(self.advance(1, ["/gazebo/set_link_state"], DEADLINE_S).success)
        self.all_is_well()

    def test_physics(self):
        now = self.get_physics_properties()
        ode = now.ode_config
        for value in (*ABSURD, 1e12, 1001.0):
            self.refused(self.set_physics_properties(0.002, 500.0, Vector3(0, 0, value), ode), "-1000 to 1000 m/s^2")
        for value in ABSURD:
            self.refused(self.set_physics_properties(value, 500.0, Vector3(0, 0, -9.81), ode), "time_step")
            self.refused(self.set_physics_properties(0.002, value, Vector3(0, 0, -9.81), ode), "max_update_rate")
        self.refused(self.set_physics_properties(0.002, 500.0, Vector3(0, 0, 1), ODEPhysics(sor_pgs_iters=2**32 - 1)),
                     "1 to 1000")
        self.assertEqual(self.get_physics_properties(), now)
        self.all_is_well()

    def test_joints_and_masses(self):
        for value in ABSURD:
            self.refused(self.set_model_configuration("door", "", ["hinge"], [value]), "-1e+06 to 1e+06")
            self.refused(self.set_joint_properties("hinge", ODEJointProperties(damping=[value])))
            self.refused(self.set_joint_properties("hinge", ODEJointProperties(hiStop=[value], loStop=[0.0])))
            self.refused(self.set_link_properties("box::body", Pose(Point(), UPRIGHT), True, value, 1, 0, 0, 1, 0, 1))
            self.refused(self.set_link_properties("box::body", Pose(Point(), UPRIGHT), True, 1, value, 0, 0, 1, 0, 1))
        self.all_is_well()

    def test_descriptions(self):
        sdf = """<sdf version="1.6"><model name="m"><link name="l"><collision name="c"><geometry><box>
          <size>%s</size></box></geometry></collision></link></model></sdf>"""
        absurd = BOX % ("1", "1e30 1 1")
        self.refused(self.spawn_urdf_model("m", absurd, "", Pose(), ""), "1e+30", "1e-09 to 10000 m", "link '")
        # sdformat accepts any size; here it is bounded, with a warning.
        above = self.spawn_urdf_model("m", sdf % "1 1e30 1", "", Pose(Point(0, 0, 100), UPRIGHT), "")
        self.assertTrue(above.success, above.status_message)
        self.assertTrue(self.delete_model("m").success)
        self.refused(self.spawn_urdf_model("m", BOX % ("1e308", "1 1 1"), "", Pose(), ""), "0 to 1e+07 kg")
        self.all_is_well()

    # -- nobody sees it ---------------------------------------------------------------------------------------------

    def test_what_breaks_the_physics_is_never_published(self):
        seen = []
        topics = [rospy.Subscriber("/gazebo/model_states", ModelStates, seen.append),
                  rospy.Subscriber("/gazebo/link_states", LinkStates, seen.append)]
        try:
            for topic in topics:
                wait_for_publishers(topic, "/gazebo")
            # Each is within its bound; their sum is far beyond what a body can take.
            for _ in range(500):
                wrench = Wrench(Vector3(1e7, -1e7, 1e7), Vector3(1e7, 1e7, -1e7))
                self.assertTrue(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS).success)
            self.advance(ticks=500)
            wait_until(lambda: len(seen) > 20, "states")
        finally:
            for topic in topics:
                topic.unregister()
        for message in seen:
            for pose in message.pose:
                self.assertTrue(math.isfinite(pose.position.x + pose.orientation.w), message)

    # -- resets -----------------------------------------------------------------------------------------------------

    def test_resets_take_back_what_services_set(self):
        for reset in (self.reset_world, self.reset_simulation):
            physics = self.get_physics_properties()
            link, joint = self.get_link_properties("box::body"), self.get_joint_properties("hinge")
            ode = ODEPhysics(sor_pgs_iters=77)
            self.assertTrue(self.set_physics_properties(0.002, 250.0, Vector3(1, 2, 3), ode).success)
            self.assertTrue(self.set_physics_properties(0.002, 100.0, Vector3(3, 2, 1), ode).success)
            self.assertTrue(self.set_link_properties("box::body", Pose(Point(), UPRIGHT), False, 3.0,
                                                     0.05, 0, 0, 0.05, 0, 0.05).success)
            self.assertTrue(self.set_joint_properties("hinge", ODEJointProperties(damping=[0.05])).success)
            self.assertNotEqual(self.get_physics_properties(), physics)
            self.assertEqual(self.get_link_properties("box::body").mass, 3.0)
            self.assertNotEqual(self.get_joint_properties("hinge").damping, joint.damping)
            reset()
            self.assertEqual(self.get_physics_properties(), physics)
            self.assertEqual(self.get_link_properties("box::body"), link)
            self.assertEqual(self.get_joint_properties("hinge").damping, joint.damping)
            self.all_is_well()


if __name__ == "__main__":
    rospy.init_node("gazebo_bounds_test")
    rostest.rosrun("gazebo_ros", "gazebo_bounds", GazeboBounds)
