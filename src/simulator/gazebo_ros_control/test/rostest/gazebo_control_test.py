#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Controllers on a robot of two joints in the running simulator: services, tools, mistakes."""
import random
import tempfile
import threading
import time

import dynamic_reconfigure.client
import rospy
import rostest
from control_case import BEST_EFFORT, DEADLINE_S, POSITION, STRICT, ControlCase, Manager
from control_msgs.msg import PidState
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray
from std_msgs.msg import Empty as EmptyMessage

from controller_manager_msgs import utils
from lab_testing.waiting import wait_until


class GazeboControl(ControlCase):
    # -- services ---------------------------------------------------------------------------------------------------

    def test_joints_move_where_the_controller_says(self):
        joints = self.joints()
        self.start("joint_state_controller", "both")
        joints.at(shoulder=0.0, elbow=0.0)
        self.send("/one/both/command", Float64MultiArray(data=[0.5, -0.7]))
        joints.at(shoulder=0.5, elbow=-0.7)
        self.assertEqual(joints.newest.name, ["elbow", "shoulder"])

    def test_joint_states_come_at_50_hz_of_simulated_time(self):
        self.start("joint_state_controller")
        stamps = []
        subscriber = rospy.Subscriber("/one/joint_states", JointState,
                                      lambda message: stamps.append(message.header.stamp.to_nsec()))
        wait_until(lambda: len(stamps) > 50, "50 joint states")
        subscriber.unregister()
        self.assertEqual({b - a for a, b in zip(stamps[:50], stamps[1:51], strict=True)}, {20_000_000})

    def test_listing_says_type_state_and_resources(self):
        self.start("joint_state_controller")
        self.assertTrue(self.one.load("both"))
        reader, both = self.one.listing()
        self.assertEqual((reader.name, reader.type, reader.state), (
            "joint_state_controller", "joint_state_controller/JointStateController", "running"))
        self.assertEqual([(c.hardware_interface, c.resources) for c in reader.claimed_resources],
                         [("hardware_interface::JointStateInterface", [])])
        self.assertEqual(both.state, "initialized")
        self.assertEqual([(c.hardware_interface, c.resources) for c in both.claimed_resources],
                         [(POSITION, ["elbow", "shoulder"])])
        types = self.one.types()
        self.assertIn("position_controllers/JointPositionController", types.types)
        self.assertEqual(set(types.base_classes), {"controller_interface::ControllerBase"})
        self.assertEqual(len(types.types), len(types.base_classes))

    def test_a_joint_has_one_master(self):
        self.start("both")
        self.assertTrue(self.one.load("elbow"))
        for strictness in (BEST_EFFORT, STRICT):
            self.assertFalse(self.one.switch(["elbow"], strictness=strictness))
        self.said("/one/controller_manager", "resource conflict", "'elbow'", "both")
        self.assertTrue(self.one.switch(["elbow"], ["both"]))
        self.assertEqual(self.one.states(), {"both": "stopped", "elbow": "running"})
        self.assertFalse(self.one.unload("elbow"))
        self.assertTrue(self.one.unload("both"))
        self.assertEqual(self.one.states(), {"elbow": "running"})

    def test_strictness(self):
        self.start("both")
        self.assertFalse(self.one.switch(["nobody"]))
        self.assertFalse(self.one.switch(["both"]))
        self.assertTrue(self.one.switch(["nobody"], ["somebody"], BEST_EFFORT))
        self.assertFalse(self.one.switch(["both"], ["both"], BEST_EFFORT))
        self.assertEqual(self.one.states(), {"both": "running"})

    def test_while_physics_is_paused_switching_waits(self):
        self.assertTrue(self.one.load("both"))
        self.pause_physics()
        answers = []
        thread = threading.Thread(target=lambda: answers.append(self.one.switch(["both"])))
        thread.start()
        thread.join(0.7)
        self.assertTrue(thread.is_alive())
        self.assertEqual(self.one.states(), {"both": "initialized"})
        self.unpause_physics()
        thread.join(DEADLINE_S)
        self.assertEqual(answers, [True])
        self.assertEqual(self.one.states(), {"both": "running"})

    def test_while_physics_is_paused_controllers_are_loaded_and_unloaded(self):
        self.start("both")
        self.pause_physics()
        self.assertTrue(self.one.load("shoulder"))
        self.assertEqual(self.one.states(), {"both": "running", "shoulder": "initialized"})
        self.assertTrue(self.one.unload("shoulder"))
        self.assertEqual(self.one.states(), {"both": "running"})

    def test_a_switch_with_a_timeout_gives_up(self):
        self.assertTrue(self.one.load("both"))
        self.pause_physics()
        start = time.monotonic()
        self.assertFalse(self.one.switch(["both"], timeout=0.2))
        self.assertGreater(time.monotonic() - start, 1.1)
        self.said("given up after 1.2 s", "paused")
        self.unpause_physics()
        self.assertEqual(self.one.states(), {"both": "initialized"})

    def test_deleting_the_robot_ends_requests_that_wait(self):
        self.assertTrue(self.one.load("both"))
        self.pause_physics()
        errors = []

        def ask():
            try:
                self.one.switch(["both"])
            except rospy.ServiceException as error:
                errors.append(str(error))

        thread = threading.Thread(target=ask)
        thread.start()
        thread.join(0.3)
        self.delete_model("one")
        thread.join(DEADLINE_S)
        self.assertFalse(thread.is_alive())
        self.assertEqual(len(errors), 1)

    def test_twenty_clients_leave_a_consistent_state(self):
        failures = []

        def client(number):
            choose = random.Random(number)
            manager = Manager("/one")
            try:
                for _ in range(12):
                    name = choose.choice(["both", "shoulder", "elbow", "joint_state_controller"])
                    choose.choice([
                        lambda name=name: manager.load(name), lambda name=name: manager.unload(name),
                        lambda name=name: manager.switch([name], (), choose.choice([BEST_EFFORT, STRICT])),
                        lambda name=name: manager.switch((), [name], choose.choice([BEST_EFFORT, STRICT]))])()
                    masters = [joint for controller in manager.listing() if controller.state == "running"
                               for claim in controller.claimed_resources for joint in claim.resources]
                    if len(masters) != len(set(masters)):
                        failures.append("two masters: %s" % manager.listing())
            except Exception as error:  # noqa: BLE001
                failures.append(repr(error))

        threads = [threading.Thread(target=client, args=(number,)) for number in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(90.0)
        self.assertFalse(any(thread.is_alive() for thread in threads))
        self.assertEqual(failures, [])
        self.one.switch((), list(self.one.states()), BEST_EFFORT)
        for name, state in self.one.states().items():
            self.assertIn(state, ("initialized", "stopped"))
            self.assertTrue(self.one.unload(name))
        self.start("both")

    def test_reload_libraries(self):
        self.start("both")
        self.assertFalse(self.one.reload(False))
        self.assertTrue(self.one.reload(True))
        self.assertEqual(self.one.states(), {})
        self.start("both")

    # -- the simulator around them ------------------------------------------------------------------------------------

    def test_two_robots_have_controllers_of_their_own(self):
        self.spawn("two")
        two = Manager("/two")
        self.start("joint_state_controller", "both")
        self.start("joint_state_controller", "elbow", manager=two)
        self.send("/one/both/command", Float64MultiArray(data=[0.4, 0.4]))
        self.send("/two/elbow/command", Float64(-0.6))
        self.joints("/one").at(shoulder=0.4, elbow=0.4)
        self.joints("/two").at(shoulder=0.0, elbow=-0.6)
        self.assertEqual(list(two.states()), ["joint_state_controller", "elbow"])

    def test_a_robot_in_the_root_namespace_has_its_parameters_after_the_first_line_of_log_too(self):
        self.assertFalse(self.one.load("absent"))
        self.said("cannot load controller 'absent'")
        self.spawn("root", self.urdf.replace("/one<", "/<"))
        root = Manager("")
        self.start("joint_state_controller", "elbow", manager=root)
        self.send("/elbow/command", Float64(1.0))
        self.joints("").at(elbow=0.2, shoulder=0.0)
        self.assertIn("elbow", utils.get_rosparam_controller_names("/"))
        self.assertEqual(utils.get_rosparam_controller_names("/nowhere"), [])

    def test_emergency_stop_and_release(self):
        joints = self.joints()
        self.start("joint_state_controller", "both")
        self.send("/one/stop", Bool(True))
        self.send("/one/both/command", Float64MultiArray(data=[0.5, 0.5]))
        count = joints.count
        wait_until(lambda: joints.count > count + 25, "half a second of joint states")
        joints.at(shoulder=0.0, elbow=0.0)
        self.send("/one/stop", Bool(False))
        count = joints.count
        wait_until(lambda: joints.count > count + 25, "half a second of joint states")
        joints.at(shoulder=0.0, elbow=0.0)  # the restart has dropped the command

        def released():
            self.send("/one/both/command", Float64MultiArray(data=[0.5, 0.4]))
            return joints.newest.position[1] > 0.1

        wait_until(released, "the joints to move again")
        joints.at(shoulder=0.5, elbow=0.4)

    def test_reset_returns_to_the_start_and_controllers_hold_there(self):
        joints = self.joints()
        self.start("joint_state_controller", "both")
        for reset in (self.reset_world, self.reset_simulation):
            self.send("/one/both/command", Float64MultiArray(data=[0.5, 0.5]))
            joints.at(shoulder=0.5, elbow=0.5)
            reset()
            joints.at(shoulder=0.0, elbow=0.0)
            count = joints.count
            wait_until(lambda count=count: joints.count > count + 10, "joint states after the reset")
            joints.at(shoulder=0.0, elbow=0.0)

    def test_joints_that_were_set_stay_until_a_command(self):
        joints = self.joints()
        self.start("joint_state_controller")
        self.set_model_configuration("one", "", ["shoulder", "elbow"], [0.3, -0.3])
        joints.at(shoulder=0.3, elbow=-0.3)
        count = joints.count
        wait_until(lambda: joints.count > count + 10, "joint states")
        joints.at(shoulder=0.3, elbow=-0.3)

    def test_gains_are_tuned_while_controllers_run(self):
        # The elbow has an effort interface here, the shoulder is kept by the simulator's own PID.
        # The parameter would apply to the other robots.
        urdf = self.urdf.replace("<eStopTopic>", "<robotParam>/none</robotParam><eStopTopic>")
        head, tail = urdf.rsplit("PositionJointInterface", 1)
        self.spawn("three", head + "EffortJointInterface" + tail)
        three = Manager("/three")
        joints = self.joints("/three")
        self.start("joint_state_controller", "tuned", manager=three)
        states = []
        subscriber = rospy.Subscriber("/three/tuned/pid/state", PidState, states.append)
        self._cleanups_of_test.callback(subscriber.unregister)
        self.send("/three/tuned/command", Float64(0.0))
        wait_until(lambda: states and abs(states[-1].error) > 0.1, "the elbow to hang, with so small a gain")
        elbow = dynamic_reconfigure.client.Client("/three/tuned/pid", timeout=DEADLINE_S)
        self._cleanups_of_test.callback(elbow.close)
        self.assertEqual(elbow.get_configuration(timeout=DEADLINE_S)["p"], 1.0)
        self.assertEqual(elbow.update_configuration({"p": 400.0, "d": 10.0})["p"], 400.0)
        joints.at(elbow=0.0, tolerance=0.01)
        self.assertTrue(all(state.timestep.to_nsec() == 2_000_000 for state in states))
        shoulder = dynamic_reconfigure.client.Client("/three/gazebo_ros_control/pid_gains/shoulder", timeout=DEADLINE_S)
        self._cleanups_of_test.callback(shoulder.close)
        self.assertEqual(shoulder.get_configuration(timeout=DEADLINE_S)["p"], 900.0)

    def test_controller_managers_are_found(self):
        self.spawn("two")
        Manager("/two")
        lister = utils.ControllerManagerLister()
        self.assertEqual(lister(), ["/one/controller_manager", "/two/controller_manager"])
        self.assertEqual(utils.get_controller_managers("/two"), ["/two/controller_manager"])
        self.assertFalse(utils.is_controller_manager("/three/controller_manager"))
        self.start("elbow")
        self.assertEqual([c.name for c in utils.ControllerLister("/one/controller_manager")()], ["elbow"])
        self.assertIn("mistyped", utils.get_rosparam_controller_names("/one"))
        self.assertNotIn("untyped", utils.get_rosparam_controller_names("/one"))
        self.delete_model("two")
        wait_until(lambda: lister() == ["/one/controller_manager"], "the other controller manager to be gone")

    # -- tools --------------------------------------------------------------------------------------------------------

    def test_the_spawner_brings_up_and_takes_down(self):
        with self.process("spawner", "joint_state_controller", "both") as spawner:
            wait_until(lambda: self.one.states() == {"joint_state_controller": "running", "both": "running"},
                     "the spawner's controllers")
            self.assertIsNone(spawner.poll())
        self.assertEqual(self.one.states(), {})

    def test_the_spawner_takes_down_what_others_have_stopped(self):
        with self.process("spawner", "joint_state_controller", "shoulder", "elbow"):
            wait_until(lambda: list(self.one.states().values()) == ["running"] * 3, "the spawner's controllers")
            self.assertTrue(self.one.switch((), ["shoulder", "elbow"]))
            self.assertTrue(self.one.unload("elbow"))
        self.assertEqual(self.one.states(), {})

    def test_the_spawner_ends_while_physics_is_paused(self):
        with self.process("spawner", "both"):
            wait_until(lambda: self.one.states() == {"both": "running"}, "the spawner's controller")
            self.pause_physics()

    def test_the_spawner_loads_a_file_and_what_stands_in_it(self):
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write("from_file: {type: position_controllers/JointPositionController, joint: elbow}\n"
                       "also: {type: position_controllers/JointPositionController, joint: shoulder}\n")
            file.flush()
            with self.process("spawner", file.name):
                wait_until(lambda: self.one.states() == {"from_file": "running", "also": "running"},
                         "the controllers of the file")
        self.assertEqual(rospy.get_param("/one/also/joint"), "shoulder")
        self.assertEqual(self.one.states(), {})

    def test_the_spawner_says_what_is_wrong_with_a_file(self):
        for content, words in (("just: [a, list", "cannot be read as YAML"), ("text", "expected a mapping")):
            with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
                file.write(content)
                file.flush()
                code, output = self.tool("spawner", file.name)
            self.assertEqual(code, 1)
            line, = [line for line in output.splitlines() if file.name in line]
            self.assertIn(words, line)
        code, output = self.tool("spawner", "/nowhere/arm.yaml")
        self.assertEqual(code, 1)
        self.assertIn("there is no file /nowhere/arm.yaml", output)

    def test_the_spawner_takes_a_namespace_and_stopped(self):
        with self.process("spawner", "--namespace", "/one", "--stopped", "both", namespace="/"):
            wait_until(lambda: self.one.states() == {"both": "initialized"}, "the spawner's controller")

    def test_the_spawner_waits_for_a_topic(self):
        with self.process("spawner", "--wait-for", "/go", "both"):
            self.send("/go", Bool(False))
            self.assertEqual(self.one.states(), {})

            def go():
                self.send("/go", Bool(True))
                return self.one.states() == {"both": "running"}

            wait_until(go, "the spawner's controller")

    def test_the_spawner_says_when_there_is_no_controller_manager(self):
        code, output = self.tool("spawner", "--timeout", "1", "both", namespace="/nobody")
        self.assertEqual(code, 1)
        self.assertIn("no controller manager: service /nobody/controller_manager/load_controller", output)

    def test_the_spawner_goes_on_without_what_cannot_be_loaded(self):
        with self.process("spawner", "untyped", "both"):
            wait_until(lambda: self.one.states() == {"both": "running"}, "the spawner's controller")
            self.said("'untyped' could not be loaded")

    def test_the_unspawner_keeps_controllers_stopped(self):
        self.start("both")
        with self.process("unspawner", "both"):
            wait_until(lambda: self.one.states() == {"both": "stopped"}, "the controller to be stopped")
        wait_until(lambda: self.one.states() == {"both": "running"}, "the controller to run again")

    def test_the_controller_manager_tool(self):
        self.assertIn("No controllers", self.tool("controller_manager", "list")[1])
        self.assertEqual(self.tool("controller_manager", "load", "elbow", "shoulder")[0], 0)
        self.assertEqual(self.tool("controller_manager", "start", "elbow")[0], 0)
        self.assertIn("'elbow' - '%s' ( running )" % POSITION, self.tool("controller_manager", "list")[1])
        self.assertIn("effort_controllers/", self.tool("controller_manager", "list-types")[1])
        self.assertEqual(self.tool("controller_manager", "spawn", "joint_state_controller")[0], 0)
        self.assertEqual(self.tool("controller_manager", "kill", "elbow")[0], 0)
        self.assertEqual(self.one.states(), {"shoulder": "initialized", "joint_state_controller": "running"})
        self.assertEqual(self.tool("controller_manager", "unload", "joint_state_controller")[0], 1)
        self.assertEqual(self.tool("controller_manager", "reload-libraries", "--restore")[0], 0)
        self.assertEqual(self.one.states()["joint_state_controller"], "running")

    def test_controller_groups(self):
        self.assertEqual(self.tool("controller_group", "spawn", "together")[0], 0)
        self.assertEqual(self.one.states(), {"both": "running", "shoulder": "initialized", "elbow": "initialized"})
        self.assertEqual(self.tool("controller_group", "switch", "apart")[0], 0)
        self.assertEqual(self.one.states(), {"both": "stopped", "shoulder": "running", "elbow": "running"})
        self.assertIn("elbow (running)", self.tool("controller_group", "list")[1])
        code, output = self.tool("controller_group", "switch", "nobody")
        self.assertEqual(code, 1)
        self.assertIn("there is no group 'nobody'; groups: apart, together", output)

    # -- mistakes: one line that names what is wrong and what would be right; the simulator lives on -----------------

    def test_controllers_that_cannot_be_loaded(self):
        for name, *words in (
                ("untyped", "/one/untyped/type is missing", "give the controller's type"),
                ("mistyped", "'position_controllers/JointPositonController' is not known", "known types"),
                ("jointless", "joint 'wrist'", "no transmission", "shoulder, elbow"),
                ("effort", "/one/effort needs hardware_interface::EffortJointInterface", "<hardwareInterface>"),
                ("rateless", "/one/rateless/publish_rate is missing", "50"),
                ("absent", "/one/absent/type is missing", "loaded")):
            self.assertFalse(self.one.load(name), name)
            line = self.said("cannot load controller '%s'" % name, *words)
            self.assertNotIn("\n", line)
        self.assertEqual(self.one.states(), {})
        self.start("both")

    def test_a_controller_of_ones_own_that_breaks_is_taken_out_alone(self):
        self.assertIn("my_lab/Breaking", self.one.types().types)
        joints = self.joints()
        self.start("joint_state_controller", "breaking", "shoulder")
        joints.at(elbow=-0.3)
        self.send("/one/breaking/break", EmptyMessage())
        self.said("controller 'breaking' failed in update() with ValueError: told to break")
        self.assertEqual(self.one.states()["breaking"], "aborted")
        self.send("/one/shoulder/command", Float64(0.4))
        joints.at(shoulder=0.4, elbow=-0.3)
        self.assertTrue(self.one.switch(["breaking"]))

    def test_a_description_that_gives_no_hardware(self):
        # The parameter would apply to the good robot.
        urdf = self.urdf.replace("<eStopTopic>", "<robotParam>/none</robotParam><eStopTopic>")
        limit = 'upper="2" velocity="3" effort="100"/>'
        self.assertIn(limit, urdf)
        self.spawn("bad", urdf.replace(limit, limit + "<safety_controller/>"))
        line = self.said("model 'bad' has no controllers", "<safety_controller> has k_velocity=None",
                         "expected a number")
        self.assertNotIn("\n", line)
        self.start("both")


if __name__ == "__main__":
    rospy.init_node("gazebo_control_test")
    rostest.rosrun("gazebo_ros_control", "gazebo_control", GazeboControl)
