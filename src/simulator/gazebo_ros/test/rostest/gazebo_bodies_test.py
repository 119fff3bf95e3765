#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Services on links, joints, wrenches and lights, and models in SDF, in a world file and spawned."""
import math
import subprocess
import unittest

import rospy
import rostest
from bullet_sim_msgs.srv import AdvanceTicks
from gazebo_msgs import srv
from gazebo_msgs.msg import LinkState, LinkStates, ODEJointProperties
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from rosgraph_msgs.msg import Log
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Empty

from lab_testing.waiting import wait_for_publishers, wait_until

BOX = """<sdf version="1.6"><model name="box"><pose>0 0 0.1 0 0 0</pose><link name="body">
  <pose>0 0 0.1 0 0 0</pose>
  <inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>
  <collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision></link>%s</model></sdf>"""
SERVICES = {
    "spawn_sdf_model": srv.SpawnModel, "delete_model": srv.DeleteModel, "get_model_state": srv.GetModelState,
    "get_model_properties": srv.GetModelProperties, "get_world_properties": srv.GetWorldProperties,
    "get_link_state": srv.GetLinkState, "set_link_state": srv.SetLinkState,
    "get_link_properties": srv.GetLinkProperties, "set_link_properties": srv.SetLinkProperties,
    "get_joint_properties": srv.GetJointProperties, "set_joint_properties": srv.SetJointProperties,
    "get_light_properties": srv.GetLightProperties, "set_light_properties": srv.SetLightProperties,
    "delete_light": srv.DeleteLight, "apply_body_wrench": srv.ApplyBodyWrench,
    "apply_joint_effort": srv.ApplyJointEffort, "clear_body_wrenches": srv.BodyRequest,
    "clear_joint_forces": srv.JointRequest, "set_model_configuration": srv.SetModelConfiguration,
    "get_physics_properties": srv.GetPhysicsProperties, "set_physics_properties": srv.SetPhysicsProperties,
    "pause_physics": Empty, "unpause_physics": Empty, "reset_simulation": Empty, "reset_world": Empty,
    "advance": AdvanceTicks}
WORLD = ["ground_plane", "cafe_table", "can", "pendulum", "door"]
DEADLINE_S = 90.0
NOW, ALWAYS = rospy.Time(0), rospy.Duration(-1)


class GazeboBodies(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, srv_class in SERVICES.items():
            proxy = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(proxy))

    def setUp(self):
        self.pause_physics()
        self.reset_simulation()

    def tearDown(self):
        for name in self.get_world_properties().model_names:
            if name not in WORLD:
                self.delete_model(name)

    def spawn_box(self, extra="", frame="", pose=None):
        response = self.spawn_sdf_model("box", BOX % extra, "", pose or Pose(Point(5, 0, 1), Quaternion(0, 0, 0, 1)),
                                        frame)
        self.assertTrue(response.success, response.status_message)

    def refused(self, response, *words):
        self.assertFalse(response.success)
        for word in words:
            self.assertIn(word, response.status_message)

    def accepted(self, response, *words):
        self.assertTrue(response.success, response.status_message)
        for word in words:
            self.assertIn(word, response.status_message)

    def position(self, link, frame=""):
        response = self.get_link_state(link, frame)
        self.accepted(response)
        point = response.link_state.pose.position
        return point.x, point.y, point.z

    def close(self, got, expected, delta=1e-5):
        for one, other in zip(got, expected, strict=True):
            self.assertAlmostEqual(one, other, delta=delta)

    # -- SDF --------------------------------------------------------------------------------------------------------

    def test_the_world_file_brought_its_models_in_order(self):
        self.assertEqual(self.get_world_properties().model_names, WORLD)
        self.assertTrue(self.get_model_properties("cafe_table").is_static)
        self.advance(ticks=1000)
        state = self.get_model_state("can", "")
        self.close((state.pose.position.x, state.pose.position.z), (0.69, 0.775), 1e-3)

    def test_a_block_spawned_where_the_demos_have_it_lies_on_the_table(self):
        block = """<robot name="block"><link name="block"><inertial><origin xyz="0.025 0.025 0.025"/><mass value="0.5"/>
          <inertia ixx="2e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial>
          <collision><origin xyz="0.025 0.025 0.025"/><geometry><box size="0.05 0.05 0.05"/></geometry></collision>
          </link></robot>"""
        pose = Pose(Point(0.6725, 0.1265, 0.7825), Quaternion(0, 0, 0, 1))
        self.accepted(self.spawn_sdf_model("block", block, "/", pose, "world"))
        self.advance(ticks=1000)
        position = self.get_model_state("block", "world").pose.position
        self.close((position.x, position.y, position.z), (0.6725, 0.1265, 0.775), 1e-3)

    def test_an_sdf_model_stands_where_its_poses_say(self):
        self.spawn_box()
        self.close(self.position("box::body"), (5, 0, 1.2))
        position = self.get_model_state("box", "").pose.position
        self.close((position.x, position.z), (5, 1.1))
        self.delete_model("box")
        self.spawn_box(frame="door::door", pose=Pose(Point(0, 0, 1), Quaternion(0, 0, 0, 1)))
        self.close(self.position("box::body"), (-1.5, 0, 2.2))

    def test_a_joint_may_sit_at_the_edge_of_its_link(self):
        self.close(self.position("door::door"), (-1.5, 0, 1))
        self.accepted(self.set_model_configuration("door", "", ["hinge"], [math.pi / 4]))
        half = 0.5 * math.sqrt(0.5)
        self.close(self.position("door::door"), (-2 + half, half, 1))

    def test_spawn_model_finds_models_by_name(self):
        command = ["rosrun", "gazebo_ros", "spawn_model", "-sdf", "-database"]
        spawned = subprocess.run([*command, "wood_cube", "-model", "cube", "-x", "3", "-z", "0.0375"],
                                 timeout=DEADLINE_S, check=False)
        self.assertEqual(spawned.returncode, 0)
        self.assertAlmostEqual(self.get_model_state("cube", "").pose.position.z, 0.0375, places=6)
        missing = subprocess.run([*command, "castle", "-model", "c"], timeout=DEADLINE_S, check=False,
                                 capture_output=True)
        self.assertEqual(missing.returncode, 1)

    def test_joint_positions_may_come_with_an_sdf(self):
        hinged = BOX.replace("</link>%s", """</link><link name="lid"/><joint name="lid_hinge" type="revolute">
          <parent>body</parent><child>lid</child><axis><xyz>0 0 1</xyz></axis></joint>%s""") % ""
        spawned = subprocess.run(["rosrun", "gazebo_ros", "spawn_model", "-sdf", "-stdin", "-model", "hinged", "-J",
                                  "lid_hinge", "0.5"], input=hinged, text=True, timeout=DEADLINE_S, check=False)
        self.assertEqual(spawned.returncode, 0)
        self.assertAlmostEqual(self.get_joint_properties("lid_hinge").position[0], 0.5, places=6)

    def test_wrong_sdf_is_refused_in_a_line_and_the_node_lives(self):
        for xml, words in (("<sdf", ("XML", "line 1")), ("<sdf version='1.6'><model name='m'/></sdf>", ("no <link>",)),
                           (BOX % "<joint name='j' type='fixed'><parent>a</parent><child>body</child></joint>",
                            ("'a'", "line", "does not exist")),
                           ("<sdf version='1.6'><include><uri>model://castle</uri></include></sdf>",
                            ("model://castle not found", "GAZEBO_MODEL_PATH"))):
            response = self.spawn_sdf_model("x", xml, "", Pose(), "")
            self.refused(response, *words)
            self.assertNotIn("\n", response.status_message)
        self.assertEqual(self.get_world_properties().model_names, WORLD)

    def test_missing_meshes_and_unknown_elements_are_one_warning_each(self):
        lines = []
        subscriber = rospy.Subscriber("/rosout", Log, lambda message: lines.append(message.msg))
        wait_for_publishers(subscriber, "/gazebo")
        mesh = """<link name="ghost">
          <visual name="v"><geometry><mesh><uri>model://gone/a.stl</uri></mesh></geometry></visual></link><frobnicator/>
          <joint name="g" type="fixed"><parent>body</parent><child>ghost</child></joint>"""
        self.spawn_box(mesh)
        wait_until(lambda: any("a.stl cannot be found" in line for line in lines), "the warning of the mesh")
        wait_until(lambda: any("frobnicator" in line for line in lines), "the warning of the element")
        found = [line for line in lines if "a.stl" in line or "frobnicator" in line]
        self.assertEqual(len(found), 2, found)
        subscriber.unregister()

    # -- links ------------------------------------------------------------------------------------------------------

    def test_link_states_and_poses_relative_to_other_links(self):
        self.close(self.position("door::door", "door::frame"), (0.5, 0, 0))
        self.close(self.position("can::link", "cafe_table"), (-0.31, 0, 0.775))
        self.refused(self.get_link_state("hand", ""), "model::link")
        self.refused(self.get_link_state("door::door", "nowhere"), "nowhere")
        self.refused(self.get_link_state("link", ""), "several models", "can")
        states = []
        subscriber = rospy.Subscriber("/gazebo/link_states", LinkStates, states.append)
        self.unpause_physics()
        names = wait_until(lambda: states and states[-1].name, "link states")
        subscriber.unregister()
        self.assertEqual([name for name in names if name.startswith("door")], ["door::frame", "door::door"])

    def test_a_link_can_be_put_where_the_model_goes_along(self):
        self.spawn_box()
        state = LinkState(link_name="box::body", pose=Pose(Point(7, 1, 2), Quaternion(0, 0, 0, 1)))
        state.twist.linear.x = 0.5
        self.accepted(self.set_link_state(state))
        self.close(self.position("box::body"), (7, 1, 2))
        self.assertAlmostEqual(self.get_link_state("box::body", "").link_state.twist.linear.x, 0.5, places=6)
        # A link on a joint goes as far as that allows.
        x, y = 0.5 * math.cos(0.7), 0.5 * math.sin(0.7)
        state.link_name, state.pose.position = "door::door", Point(x - 2, y, 1)
        state.pose.orientation = Quaternion(0, 0, math.sin(0.35), math.cos(0.35))
        state.twist = Twist(Vector3(-0.3 * y, 0.3 * x, 0), Vector3(0, 0, 0.3))
        self.accepted(self.set_link_state(state))
        hinge = self.get_joint_properties("hinge")
        self.close((hinge.position[0], hinge.rate[0]), (0.7, 0.3))
        state.pose, state.twist = Pose(Point(7, 1, 2), Quaternion(0, 0, 0, 1)), Twist()
        publisher = rospy.Publisher("/gazebo/set_link_state", LinkState, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "a connection to /gazebo/set_link_state")
        state.link_name, state.pose.position.x = "box::body", -7
        publisher.publish(state)
        wait_until(lambda: abs(self.position("box::body")[0] + 7) < 1e-3, "the box at x = -7")

    def test_what_is_fixed_to_a_link_turns_about_it(self):
        self.spawn_box("""<link name="arm"><pose>0.4 0 0.1 0 0 0</pose><inertial><mass>1.0</mass></inertial></link>
          <joint name="weld" type="fixed"><parent>body</parent><child>arm</child></joint>""")
        state = LinkState(link_name="box::arm", pose=Pose(Point(7, 1, 2), Quaternion(0, 0, 0, 1)))
        state.twist = Twist(Vector3(0.5, 0, 0), Vector3(0, 0, 2.0))
        self.accepted(self.set_link_state(state))
        self.close(self.position("box::body"), (6.6, 1, 2))
        for link, speed in (("box::body", (0.5, -0.8, 0)), ("box::arm", (0.5, 0, 0))):
            twist = self.get_link_state(link, "").link_state.twist
            self.close((twist.linear.x, twist.linear.y, twist.linear.z), speed)
            self.close((twist.angular.x, twist.angular.y, twist.angular.z), (0, 0, 2.0))

    def test_link_properties_can_be_read_and_set(self):
        self.spawn_box()
        got = self.get_link_properties("box::body")
        self.accepted(got)
        self.assertEqual((got.mass, got.ixx, got.ixy, got.gravity_mode), (2.0, 0.1, 0.0, True))
        request = srv.SetLinkPropertiesRequest("box::body", got.com, False, 4.0, 0.2, 0, 0, 0.2, 0, 0.2)
        self.accepted(self.set_link_properties(request))
        self.assertEqual(self.get_link_properties("box::body").mass, 4.0)
        self.advance(ticks=250)
        self.close(self.position("box::body"), (5, 0, 1.2))
        request.com.position.x = 0.1
        self.accepted(self.set_link_properties(request))
        self.assertAlmostEqual(self.get_link_properties("box::body").com.position.x, 0.1)
        self.close(self.position("box::body"), (5, 0, 1.2))
        request.com.position.x, request.mass = 0.0, -1.0
        self.refused(self.set_link_properties(request), "positive")
        self.refused(self.get_link_properties("box::wheel"), "wheel", "body")

    # -- wrenches and efforts ---------------------------------------------------------------------------------------

    def test_a_wrench_lasts_as_long_as_it_was_asked_to(self):
        self.spawn_box()
        request = self.get_link_properties("box::body")
        self.set_link_properties("box::body", request.com, False, 2.0, 0.1, 0, 0, 0.1, 0, 0.1)
        wrench = Wrench(Vector3(3, 0, 0), Vector3(0, 0, 0.1))
        self.accepted(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, rospy.Duration(0.5)))
        self.advance(ticks=400)
        twist = self.get_link_state("box::body", "").link_state.twist
        # F t / m and M t / I, exact to the tick
        self.assertAlmostEqual(twist.linear.x, 0.75, places=4)
        self.assertAlmostEqual(twist.angular.z, 0.5, places=4)

    def test_a_wrench_starts_later_goes_on_for_ever_and_can_be_cleared(self):
        self.spawn_box()
        com = self.get_link_properties("box::body").com
        self.set_link_properties("box::body", com, False, 2.0, 0.1, 0, 0, 0.1, 0, 0.1)
        start = rospy.Time.from_sec(self.get_world_properties().sim_time + 0.1)
        wrench = Wrench(Vector3(2, 0, 0), Vector3())
        self.accepted(self.apply_body_wrench("box::body", "", Point(), wrench, start, ALWAYS))

        def speed():
            return self.get_link_state("box::body", "").link_state.twist.linear.x

        self.advance(ticks=50)
        self.assertEqual(speed(), 0.0)
        self.advance(ticks=500)
        self.assertAlmostEqual(speed(), 1.0, places=4)
        self.clear_body_wrenches("box::body")
        self.advance(ticks=100)
        self.assertAlmostEqual(speed(), 1.0, places=4)

    def test_a_reset_ends_wrenches_and_efforts_also_those_that_have_not_begun(self):
        self.spawn_box()
        com = self.get_link_properties("box::body").com
        for reset in self.reset_world, self.reset_simulation:
            self.set_link_properties("box::body", com, False, 2.0, 0.1, 0, 0, 0.1, 0, 0.1)
            later = rospy.Time.from_sec(self.get_world_properties().sim_time + 0.1)
            wrench = Wrench(Vector3(2, 0, 0), Vector3())
            for start in NOW, later:
                self.accepted(self.apply_body_wrench("box::body", "", Point(), wrench, start, ALWAYS))
                self.accepted(self.apply_joint_effort("hinge", 1.0, start, ALWAYS))
            self.advance(ticks=10)
            self.assertGreater(self.get_link_state("box::body", "").link_state.twist.linear.x, 0.01)
            reset()
            # Its weight has come back with the reset.
            self.set_link_properties("box::body", com, False, 2.0, 0.1, 0, 0, 0.1, 0, 0.1)
            before = self.get_joint_properties("hinge").position[0]
            self.advance(ticks=200)
            self.assertEqual(self.get_link_state("box::body", "").link_state.twist.linear.x, 0.0)
            self.assertAlmostEqual(self.get_joint_properties("hinge").position[0], before, delta=1e-4)

    def test_a_wrench_may_be_given_in_the_frame_of_a_turned_link(self):
        quarter = Quaternion(0, 0, math.sqrt(0.5), math.sqrt(0.5))
        self.spawn_box(pose=Pose(Point(5, 0, 1), quarter))
        com = self.get_link_properties("box::body").com
        self.set_link_properties("box::body", com, False, 2.0, 0.1, 0, 0, 0.1, 0, 0.1)
        wrench = Wrench(Vector3(2, 0, 0), Vector3())
        # Along the link's x, which is the world's y, 0.1 m to the left of its origin: it turns to the right.
        self.accepted(self.apply_body_wrench("box::body", "box::body", Point(0, 0.1, 0), wrench, NOW,
                                             rospy.Duration(0.01)))
        self.advance(ticks=10)
        twist = self.get_link_state("box::body", "").link_state.twist
        self.close((twist.linear.x, twist.linear.y, twist.angular.z), (0.0, 0.01, -0.02), 1e-5)

    def test_wrenches_go_with_their_model_and_wrong_ones_are_refused(self):
        self.spawn_box()
        wrench = Wrench(Vector3(0, 0, 500), Vector3())
        self.accepted(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS))
        self.delete_model("box")
        self.spawn_box()
        self.advance(ticks=50)
        self.assertLess(self.position("box::body")[2], 1.2)
        self.refused(self.apply_body_wrench("box::arm", "", Point(), wrench, NOW, ALWAYS), "arm", "body")
        self.refused(self.apply_body_wrench("box::body", "moon", Point(), wrench, NOW, ALWAYS), "moon")
        self.refused(self.apply_body_wrench("cafe_table::link", "", Point(), wrench, NOW, ALWAYS), "fixed")
        wrench.force.x = math.nan
        self.refused(self.apply_body_wrench("box::body", "", Point(), wrench, NOW, ALWAYS), "expected -1e+07 to 1e+07")

    def test_an_effort_moves_a_joint_until_it_is_cleared(self):
        self.accepted(self.apply_joint_effort("hinge", 1.0, NOW, rospy.Duration(0.1)))
        self.advance(ticks=50)
        # about 1 Nm on 0.25 + 3 * 0.25 kg m^2 for 0.1 s
        self.assertAlmostEqual(self.get_joint_properties("hinge").rate[0], 0.1, delta=0.003)
        self.accepted(self.apply_joint_effort("hinge", 0.1, NOW, ALWAYS))
        self.advance(ticks=3000)
        # against the damping of 0.1 Nm s/rad: it is at its stop or nearly as fast as 1 rad/s
        self.assertGreater(self.get_joint_properties("hinge").position[0], 0.5)
        self.clear_joint_forces("hinge")
        self.refused(self.apply_joint_effort("knee", 1.0, NOW, ALWAYS), "knee", "hinge")
        self.refused(self.apply_joint_effort("hinge", math.inf, NOW, ALWAYS), "expected -1e+07 to 1e+07")

    def test_joint_properties_can_be_read_and_partly_set(self):
        got = self.get_joint_properties("hinge")
        self.accepted(got)
        self.assertEqual((got.type, list(got.damping), list(got.rate)), (got.REVOLUTE, [0.1], [0.0]))
        wanted = ODEJointProperties(damping=[0.5], hiStop=[0.2], fmax=[1.0])
        self.accepted(self.set_joint_properties("hinge", wanted), "no counterpart here: fmax")
        self.assertEqual(list(self.get_joint_properties("hinge").damping), [0.5])
        self.apply_joint_effort("hinge", 1.0, NOW, ALWAYS)
        self.advance(ticks=2000)
        self.assertAlmostEqual(self.get_joint_properties("hinge").position[0], 0.2, delta=0.01)
        self.clear_joint_forces("hinge")
        self.accepted(self.set_joint_properties("hinge", ODEJointProperties(damping=[0.1], hiStop=[1.5])))
        self.refused(self.set_joint_properties("hinge", ODEJointProperties(erp=[1.0])), "erp", "nothing to set")
        self.refused(self.set_joint_properties("hinge", ODEJointProperties(hiStop=[-9.0])), "not below")
        self.refused(self.get_joint_properties("knee"), "knee", "hinge")

    # -- lights and physics -----------------------------------------------------------------------------------------

    def test_lights_are_answered_honestly(self):
        sun = self.get_light_properties("sun")
        self.accepted(sun)
        self.assertAlmostEqual(sun.attenuation_constant, 0.9)
        self.refused(self.get_light_properties("lamp"), "lamp", "sun")
        self.accepted(self.set_light_properties(light_name="sun", diffuse=ColorRGBA(1, 0, 0, 1),
                                                attenuation_constant=0.5))
        changed = self.get_light_properties("sun")
        self.assertEqual((changed.diffuse.r, changed.diffuse.g, changed.attenuation_constant), (1.0, 0.0, 0.5))
        self.refused(self.set_light_properties(light_name="lamp"), "lamp", "sun")
        self.refused(self.delete_light("lamp"), "lamp", "sun")

    def test_solver_iterations_are_the_part_of_ode_config_that_counts(self):
        before = self.get_physics_properties()
        config = before.ode_config
        old = config.sor_pgs_iters
        config.sor_pgs_iters = 35
        self.accepted(self.set_physics_properties(before.time_step, before.max_update_rate, before.gravity, config))
        self.assertEqual(self.get_physics_properties().ode_config.sor_pgs_iters, 35)
        config.sor_pgs_iters = 100000
        self.refused(self.set_physics_properties(before.time_step, before.max_update_rate, before.gravity, config),
                     "1 to 1000")
        config.sor_pgs_iters = old
        self.accepted(self.set_physics_properties(before.time_step, before.max_update_rate, before.gravity, config))


if __name__ == "__main__":
    rospy.init_node("gazebo_bodies_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_bodies", GazeboBodies)
