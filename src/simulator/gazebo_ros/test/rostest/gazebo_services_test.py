#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The services under /gazebo against the running node."""
import itertools
import math
import subprocess
import threading
import time
import unittest

import dynamic_reconfigure.client
import rospy
import rostest
from bullet_sim_msgs.srv import AdvanceTicks
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from gazebo_msgs.msg import ModelState, ModelStates, PerformanceMetrics
from gazebo_msgs.srv import (
    DeleteModel,
    GetModelState,
    GetPhysicsProperties,
    GetWorldProperties,
    SetModelConfiguration,
    SetModelState,
    SetPhysicsProperties,
    SpawnModel,
)
from geometry_msgs.msg import Point, Pose, Quaternion
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import Empty, Trigger

from lab_testing.waiting import wait_until

BOX = """<robot name="box"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link></robot>"""
ARM = """<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="100"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
    <origin xyz="0.4 0 0"/><limit lower="-2" upper="2" velocity="3" effort="100"/></joint>
  <gazebo><plugin name="probe" filename="libprobe.so">%s</plugin></gazebo></robot>"""
DEADLINE_S = 90.0


class Listener:
    """Collects messages of a topic."""

    def __init__(self, topic, msg_class):
        self.messages = []
        self._subscriber = rospy.Subscriber(topic, msg_class, self.messages.append)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._subscriber.unregister()

    def wait(self, count=1):
        """The messages, as soon as there are ``count`` of them."""
        wait_until(lambda: len(self.messages) >= count, "%d messages on %s" % (count, self._subscriber.name))
        return self.messages


class GazeboServices(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, srv_class in (
                ("spawn_urdf_model", SpawnModel), ("spawn_sdf_model", SpawnModel), ("delete_model", DeleteModel),
                ("get_model_state", GetModelState), ("set_model_state", SetModelState),
                ("get_world_properties", GetWorldProperties), ("set_model_configuration", SetModelConfiguration),
                ("get_physics_properties", GetPhysicsProperties), ("set_physics_properties", SetPhysicsProperties),
                ("pause_physics", Empty), ("unpause_physics", Empty), ("reset_world", Empty),
                ("reset_simulation", Empty), ("advance", AdvanceTicks)):
            proxy = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(proxy))

    def tearDown(self):
        self.unpause_physics()
        for name in self.get_world_properties().model_names:
            if name != "ground_plane":
                self.delete_model(name)

    def spawn(self, name, xml, z=0.0, namespace="", frame=""):
        return self.spawn_urdf_model(name, xml, namespace, Pose(Point(0, 0, z), Quaternion(0, 0, 0, 1)), frame)

    def spawn_ok(self, *arguments, **options):
        response = self.spawn(*arguments, **options)
        self.assertTrue(response.success, response.status_message)
        self.assertEqual(response.status_message, "SpawnModel: Successfully spawned entity")

    def refused(self, response, *words):
        self.assertFalse(response.success)
        for word in words:
            self.assertIn(word, response.status_message)

    # -- time -----------------------------------------------------------------------------------------------------

    def test_clock_has_500_stamps_a_second_and_does_not_run_ahead(self):
        with Listener("/clock", Clock) as clock:
            clock.wait()
            # Messages may have waited for this process; what the simulator answers is of that moment.
            start, begin = time.monotonic(), self.get_world_properties().sim_time
            wait_until(lambda: self.get_world_properties().sim_time >= begin + 2.0, "two seconds of simulation")
            lasted = time.monotonic() - start

            def gaps():
                stamps = [message.clock.to_nsec() for message in list(clock.messages)]
                return [b - a for a, b in zip(stamps, stamps[1:], strict=False)]

            # While the world is late, each stamp ends a turn of 10 ms.
            self.assertTrue(set(gaps()) <= set(range(2_000_000, 10_000_001, 2_000_000)), set(gaps()))
            # A busy machine makes it late again and again.
            wait_until(lambda: max(len(list(alike)) for gap, alike in itertools.groupby([*gaps(), 0])
                                   if gap in (0, 2_000_000)) >= 100, "100 stamps 2 ms apart")
        # A busy machine makes it slower, and a pause of half a second is caught up; it never runs much faster.
        self.assertGreater(lasted, 1.4)
        self.assertTrue(rospy.get_param("/use_sim_time"))

    def test_pause_stops_the_clock_and_a_late_listener_still_learns_the_time(self):
        self.pause_physics()
        before = self.get_world_properties().sim_time
        self.assertTrue(self.get_physics_properties().pause)
        with Listener("/clock", Clock) as clock:
            clock.wait()
            self.assertAlmostEqual(clock.messages[0].clock.to_sec(), before)
            self.assertEqual(self.get_world_properties().sim_time, before)
        self.unpause_physics()
        wait_until(lambda: self.get_world_properties().sim_time > before, "time after unpause")

    def test_reset_world_keeps_the_clock_monotonic(self):
        self.spawn_ok("box", BOX, z=3.0)
        with Listener("/clock", Clock) as clock:
            clock.wait(100)
            self.pause_physics()
            self.assertLess(self.get_model_state("box", "").pose.position.z, 2.9)
            before = self.get_world_properties().sim_time
            self.reset_world()
            self.assertEqual(self.get_model_state("box", "").pose.position.z, 3.0)
            self.assertEqual(self.get_world_properties().sim_time, before)
            self.unpause_physics()
            clock.wait(len(clock.messages) + 100)
            # And while time goes on, which moves the box before a client can ask for it.
            self.reset_world()
            clock.wait(len(clock.messages) + 100)
            stamps = [message.clock.to_nsec() for message in clock.messages]
        self.assertEqual(stamps, sorted(stamps))

    def test_reset_simulation_sets_time_to_zero_and_listeners_survive(self):
        wait_until(lambda: self.get_world_properties().sim_time > 0.5, "half a second")
        with Listener("/clock", Clock) as clock:
            clock.wait(10)
            self.pause_physics()
            self.reset_simulation()
            self.assertEqual(self.get_world_properties().sim_time, 0.0)
            self.unpause_physics()
            clock.wait(len(clock.messages) + 100)
            # And while time goes on.
            self.reset_simulation()
            clock.wait(len(clock.messages) + 100)
            stamps = [message.clock.to_nsec() for message in clock.messages]
        self.assertEqual([after for before, after in zip(stamps, stamps[1:], strict=False) if after < before], [0, 0])
        self.assertGreater(stamps[-1], 0)

    # -- lock-step --------------------------------------------------------------------------------------------------

    def test_advance_moves_a_paused_world_by_exactly_so_many_ticks(self):
        self.pause_physics()
        start = self.advance(ticks=0)
        done = self.advance(ticks=123)
        self.assertTrue(done.success, done.status_message)
        self.assertEqual(done.tick - start.tick, 123)
        self.assertEqual((done.sim_time - start.sim_time).to_nsec(), 246_000_000)

    def test_advance_waits_for_a_command(self):
        self.spawn_ok("arm", ARM % "", namespace="/arm")
        self.pause_physics()
        self.refused(self.advance(1, ["/arm/target"], 0.2), "0.2 s", "/arm/target")
        self.refused(self.advance(1, ["/arm/wrong"], 0.2), "/arm/wrong", "/arm/target")
        publisher = rospy.Publisher("/arm/target", Float64, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "a connection to /arm/target")
        answers = []
        thread = threading.Thread(target=lambda: answers.append(self.advance(500, ["/arm/target"], DEADLINE_S)))
        thread.start()
        publisher.publish(0.25)
        thread.join(DEADLINE_S)
        self.assertTrue(answers[0].success, answers[0].status_message)
        where = eval(rospy.ServiceProxy("/arm/where", Trigger)().message)
        self.assertAlmostEqual(where[0], 0.25, delta=0.01)

    def test_advance_in_a_running_world_is_refused(self):
        self.refused(self.advance(ticks=1), "pause_physics")

    # -- models -----------------------------------------------------------------------------------------------------

    def test_a_model_comes_falls_and_goes(self):
        self.spawn_ok("box", BOX, z=0.5)
        self.assertEqual(self.get_world_properties().model_names, ["ground_plane", "box"])
        wait_until(lambda: abs(self.get_model_state("box", "").pose.position.z - 0.1) < 0.003, "the box to lie down")
        state = self.get_model_state("box", "ground_plane")
        self.assertTrue(state.success)
        self.assertEqual(state.header.frame_id, "ground_plane")
        deleted = self.delete_model("box")
        self.assertEqual((deleted.success, deleted.status_message), (True, "DeleteModel: successfully deleted model"))
        self.refused(self.delete_model("box"), "model does not exist", "ground_plane")
        self.refused(self.get_model_state("box", ""), "box", "ground_plane")

    def test_spawn_delete_spawn_of_the_same_name_gives_the_exact_pose(self):
        self.pause_physics()
        for k in range(20):
            self.spawn_ok("box", BOX, z=1.0 + k)
            self.assertAlmostEqual(self.get_model_state("box", "").pose.position.z, 1.0 + k, places=12)
            self.assertTrue(self.delete_model("box").success)

    def test_a_pose_may_be_relative_to_a_link(self):
        self.pause_physics()
        self.spawn_ok("arm", ARM % "", z=1.0)
        self.spawn_ok("box", BOX, z=0.5, frame="arm::lower")
        position = self.get_model_state("box", "").pose.position
        # PyBullet keeps link frames in single precision.
        self.assertAlmostEqual(position.x, 0.4, places=6)
        self.assertAlmostEqual(position.z, 1.5, places=6)
        self.refused(self.spawn("other", BOX, frame="arm::hand"), "arm", "hand", "lower")
        self.refused(self.spawn("other", BOX, frame="nobody"), "nobody", "arm, box")

    def test_what_cannot_be_spawned_is_said(self):
        self.spawn_ok("box", BOX)
        self.refused(self.spawn("box", BOX), "already exists", "box")
        self.refused(self.spawn("", BOX), "name")
        self.refused(self.spawn("x", "<robot"), "XML")
        self.refused(self.spawn("x", "<mujoco/>"), "<mujoco>", "<robot>")
        self.refused(self.spawn_sdf_model("x", "<sdf version='1.6'/>", "", Pose(), ""), "<model>")
        self.refused(self.spawn("x", BOX, z=math.nan), "finite")
        self.refused(self.spawn("x", ARM % "<refuse>yes</refuse>"), "refused on purpose")
        self.assertEqual(self.get_world_properties().model_names, ["ground_plane", "box"])

    def test_the_state_of_a_model_can_be_set(self):
        self.pause_physics()
        self.spawn_ok("box", BOX)
        state = ModelState(model_name="box", pose=Pose(Point(1, 2, 3), Quaternion(0, 0, 0, 2)))
        state.twist.linear.x = 0.5
        response = self.set_model_state(state)
        self.assertEqual((response.success, response.status_message), (True, "SetModelState: set model state done"))
        got = self.get_model_state("box", "")
        self.assertEqual((got.pose.position.x, got.pose.position.y, got.pose.position.z), (1.0, 2.0, 3.0))
        self.assertAlmostEqual(got.twist.linear.x, 0.5)
        state.pose.position.x = math.inf
        self.refused(self.set_model_state(state), "finite")
        publisher = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "a connection to /gazebo/set_model_state")
        state.pose.position.x = -4.0
        publisher.publish(state)
        wait_until(lambda: self.get_model_state("box", "").pose.position.x == -4.0, "the box at x = -4")

    def test_joints_can_be_set_and_stay(self):
        self.spawn_ok("arm", ARM % "", namespace="/arm")
        self.assertTrue(self.set_model_configuration("arm", "", ["elbow", "arm::shoulder"], [0.5, -0.25]).success)
        where = rospy.ServiceProxy("/arm/where", Trigger)
        with Listener("/arm/joint_states", JointState) as states:
            states.wait(100)
        shoulder, elbow = eval(where().message)
        self.assertAlmostEqual(shoulder, -0.25, delta=0.002)
        self.assertAlmostEqual(elbow, 0.5, delta=0.002)
        self.refused(self.set_model_configuration("arm", "", ["elbow"], [0.5, 1.0]), "1 joint name but 2 positions")
        self.refused(self.set_model_configuration("arm", "", ["knee"], [0.5]), "knee", "elbow")
        self.refused(self.set_model_configuration("leg", "", [], []), "leg", "arm")

    def test_spawn_model_puts_joints_at_their_start_before_anything_is_published(self):
        values = {"shoulder": 0.7853981633974483, "elbow": -1.1}
        # Gazebo's own launch files scope some joints by the model's name.
        arguments = ["-J", "shoulder", repr(values["shoulder"]), "-J", "arm::elbow", repr(values["elbow"])]
        command = ["rosrun", "gazebo_ros", "spawn_model", "-urdf", "-stdin"]
        spawned = subprocess.run([*command, "-model", "arm", "-z", "1.5", "-Y", "-1e-1", "-robot_namespace", "/arm",
                                  *arguments], input=ARM % "", text=True, timeout=DEADLINE_S, check=False)
        self.assertEqual(spawned.returncode, 0)
        with Listener("/arm/first_state", JointState) as first:
            message = first.wait()[0]
        self.assertEqual(message.name, ["shoulder", "elbow"])
        for name, position in zip(message.name, message.position, strict=True):
            self.assertAlmostEqual(position, values[name], delta=2e-4)
        self.assertAlmostEqual(self.get_model_state("arm", "").pose.position.z, 1.5)
        self.assertAlmostEqual(self.get_model_state("arm", "").pose.orientation.z, -math.sin(0.05))
        other = subprocess.run([*command, "-model", "other", "-J", "knee", "1"], input=ARM % "", text=True,
                               timeout=DEADLINE_S, check=False)
        self.assertEqual(other.returncode, 0, "an unknown joint is passed over")

    def test_a_plugin_that_breaks_restarts_and_a_reset_revives_it(self):
        self.spawn_ok("arm", ARM % "", namespace="/arm")
        publisher = rospy.Publisher("/arm/break", String, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "a connection to /arm/break")

        def told(diagnostics):
            """The plugin's (level, failures)."""
            return [(status.level, pair.value) for message in diagnostics.messages[-1:] for status in message.status
                    for pair in status.values if "of arm" in status.name and pair.key == "failures"]

        with Listener("/diagnostics", DiagnosticArray) as diagnostics, Listener("/arm/joint_states",
                                                                                JointState) as states:
            states.wait(3)
            level, count = DiagnosticStatus.OK, 0
            # Three within 10 s of simulated time; on a busy machine more may be needed.
            while level != DiagnosticStatus.ERROR and count < 20:
                count += 1
                publisher.publish("now")
                wait_until(lambda count=count: told(diagnostics) and told(diagnostics)[0][1] == str(count),
                           "failure %d on /diagnostics" % count)
                level = told(diagnostics)[0][0]
                if level == DiagnosticStatus.WARN:
                    heard = len(states.messages)
                    wait_until(lambda heard=heard: len(states.messages) > heard, "the plugin to go on")
            self.assertEqual(level, DiagnosticStatus.ERROR)
            self.assertGreaterEqual(count, 3)
            self.assertEqual(publisher.get_num_connections(), 1)
            before = self.get_world_properties().sim_time
            wait_until(lambda: self.get_world_properties().sim_time > before, "time to go on")
            states.messages.clear()
            self.reset_world()
            states.wait(3)
            self.assertTrue(rospy.ServiceProxy("/arm/where", Trigger)().success)
        self.assertTrue(self.delete_model("arm").success)

    def test_a_service_whose_handler_breaks_answers_with_an_error(self):
        self.spawn_ok("arm", ARM % "", namespace="/arm")
        with self.assertRaisesRegex(rospy.ServiceException, "/arm/fail failed: RecursionError"):
            rospy.ServiceProxy("/arm/fail", Trigger)()
        with Listener("/arm/joint_states", JointState) as states:
            states.wait(3)
        self.assertTrue(self.delete_model("arm").success)

    def test_topics_of_a_deleted_model_are_gone_and_come_back(self):
        for _ in range(3):
            self.spawn_ok("arm", ARM % "", namespace="/arm")
            with Listener("/arm/joint_states", JointState) as states:
                states.wait(3)
            self.assertTrue(self.delete_model("arm").success)

    # -- states and figures -----------------------------------------------------------------------------------------

    def test_model_states_lists_all_models(self):
        self.spawn_ok("box", BOX, z=0.1)
        with Listener("/gazebo/model_states", ModelStates) as states:
            wait_until(lambda: states.messages and states.messages[-1].name == ["ground_plane", "box"], "both models")

    def test_the_real_time_factor_is_published(self):
        with Listener("/gazebo/performance_metrics", PerformanceMetrics) as metrics:
            # A stall at the edge of a window shifts time from one window to the next.
            wait_until(lambda: any(abs(message.real_time_factor - 1.0) < 0.05 for message in metrics.messages),
                       lambda: "a second in real time among %s" % [message.real_time_factor
                                                                   for message in metrics.messages], 60.0)

    def test_gravity_can_be_set(self):
        before = self.get_physics_properties()
        self.assertEqual((before.time_step, before.max_update_rate), (0.002, 500.0))
        gravity = type(before.gravity)(0.0, 0.0, -1.62)
        try:
            self.assertTrue(self.set_physics_properties(0.002, 500.0, gravity, before.ode_config).success)
            self.assertEqual(self.get_physics_properties().gravity.z, -1.62)
        finally:
            self.set_physics_properties(0.002, 500.0, before.gravity, before.ode_config)

    def test_the_step_can_be_set_while_time_goes_on(self):
        before = self.get_physics_properties()
        now = self.get_world_properties().sim_time
        try:
            self.assertTrue(self.set_physics_properties(0.004, 250.0, before.gravity, before.ode_config).success)
            after = self.get_physics_properties()
            self.assertEqual((after.time_step, after.max_update_rate), (0.004, 250.0))
            self.assertGreaterEqual(self.get_world_properties().sim_time, now)
            self.refused(self.set_physics_properties(0.0, 250.0, before.gravity, before.ode_config), "time_step")
        finally:
            self.set_physics_properties(0.002, 500.0, before.gravity, before.ode_config)

    def test_dynamic_reconfigure_sets_the_same_physics(self):
        heard = []
        client = dynamic_reconfigure.client.Client("/gazebo", timeout=DEADLINE_S, config_callback=heard.append)
        names = [row["name"] for row in client.get_parameter_descriptions(timeout=DEADLINE_S)]
        self.assertEqual(names, ["time_step", "max_update_rate", "gravity_x", "gravity_y", "gravity_z",
                                 "sor_pgs_iters"])
        before = self.get_physics_properties()
        try:
            answer = client.update_configuration({"gravity_z": -1.62, "sor_pgs_iters": 33, "time_step": 0.004})
            self.assertEqual((answer["gravity_z"], answer["sor_pgs_iters"], answer["time_step"]), (-1.62, 33, 0.004))
            now = self.get_physics_properties()
            self.assertEqual((now.gravity.z, now.ode_config.sor_pgs_iters), (-1.62, 33))
            with self.assertRaises(dynamic_reconfigure.DynamicReconfigureCallbackException):
                client.update_configuration({"gravity_z": float("nan")})
        finally:
            self.set_physics_properties(0.002, 500.0, before.gravity, before.ode_config)
        wait_until(lambda: heard and heard[-1]["gravity_z"] == before.gravity.z, "the change by the service to be told")
        client.close()


if __name__ == "__main__":
    rospy.init_node("gazebo_services_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_services", GazeboServices)
