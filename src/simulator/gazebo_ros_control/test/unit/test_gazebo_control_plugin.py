# SPDX-License-Identifier: BSD-3-Clause
"""The elements of the plugin, in a physics world without a master."""
from xml.etree import ElementTree

import numpy as np
import pytest
from std_msgs.msg import Bool

from bullet_sim import Pose, World
from controller_manager import POSITION, Controller
from controller_manager.testing import fake_context
from gazebo_ros.model_plugin import PluginContext, PluginSource
from gazebo_ros.simulation import HostedPlugin, Simulation
from gazebo_ros_control.plugin import GazeboRosControl, _flat
from lab_testing.closing import factory
from loop_ros.faults import Faults
from loop_ros.request_queue import RequestQueue
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

DT = 0.002
URDF = """<robot name="arm"><link name="world"/><link name="l"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="world"/><child link="l"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="%s" effort="9"/></joint>
<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j">
  <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint><actuator name="m"/>
</transmission></robot>"""


def tree_of(parameters):
    """{absolute name: value} as the tree of the parameter server."""
    tree = {}
    for name, value in parameters.items():
        *folders, last = name.strip("/").split("/")
        branch = tree
        for folder in folders:
            branch = branch.setdefault(folder, {})
        branch[last] = value
    return tree


class Recorder(Controller):
    def __init__(self, name, hardware, context):
        super().__init__(name, hardware, context)
        self.index = self.claim(POSITION, ["j"])
        self.updates, self.starts, self.target = [], [], None

    def starting(self, time_s):
        self.starts.append(time_s)

    def update(self, time_s, dt):
        self.updates.append((round(time_s, 9), round(dt, 9)))
        if self.target is not None:
            self.hardware.command[POSITION][self.index] = self.target


class Simulator:
    """One robot with the plugin. ``parameters``: {absolute name: value}."""

    def __init__(self, elements="", parameters=None, urdf=URDF % 2):
        self.world = World(time_step_s=DT)
        robot = parse_urdf(urdf)
        self.model = self.world.spawn(robot, "arm", Pose((0, 0, 0)))
        self.log, self.ros = FakeLog(), FakeRos()
        element = ElementTree.fromstring("<plugin>%s</plugin>" % elements)
        self.context = PluginContext(self.world, self.model, PluginSource(robot, element, "/lab/arm", urdf), self.log,
                                     self.ros, tree_of(parameters or {}))
        self.plugin = GazeboRosControl(self.context)
        self.controller = None

    def start(self):
        manager = self.plugin._manager
        manager.load("one", "test/Recorder", Recorder, fake_context("one")[0])
        manager.switch(["one"], [])
        self.run(1)
        self.controller = manager.loaded[0].controller
        return self.controller

    def run(self, ticks):
        for _ in range(ticks):
            self.plugin.update(self.world.time_s, DT)
            self.world.step()

    @property
    def velocity(self):
        return self.model.read_joints()[1][0]


@pytest.fixture
def simulate():
    with factory(Simulator, "plugin", "world") as made:
        yield made


def test_controllers_run_at_every_step(simulate):
    simulator = simulate()
    controller = simulator.start()
    simulator.run(3)
    assert controller.updates == [(0.002, DT), (0.004, DT), (0.006, DT)]
    assert sorted(simulator.ros.served()) == ["/lab/arm/controller_manager/" + name for name in (
        "list_controller_types", "list_controllers", "load_controller", "reload_controller_libraries",
        "switch_controller", "unload_controller")]
    assert simulator.log.lines == []


def test_a_control_period_of_several_steps(simulate):
    simulator = simulate("<controlPeriod>0.01</controlPeriod>")
    controller = simulator.start()
    simulator.run(20)
    assert controller.updates == [(0.01, 0.01), (0.02, 0.01), (0.03, 0.01), (0.04, 0.01)]
    assert "controlPeriod 0.01 s is longer" in simulator.log.of("warn")[0]


@pytest.mark.parametrize(("period", "text"), [
    ("0.0001", "0.0001 s is shorter than the physics step of 0.002 s"), ("often", "'often', expected a number"),
    ("-1", "'-1', expected a number")])
def test_a_wrong_control_period_is_one_error_and_every_step_counts(simulate, period, text):
    simulator = simulate("<controlPeriod>%s</controlPeriod>" % period)
    controller = simulator.start()
    simulator.run(2)
    assert [time_s for time_s, _ in controller.updates] == [0.002, 0.004]
    assert len(simulator.log.lines) == 1 and text in simulator.log.of("error")[0]


def test_limits_hold_between_updates(simulate):
    simulator = simulate("<controlPeriod>0.01</controlPeriod>")
    simulator.start().target = 1.0
    simulator.run(30)
    assert simulator.velocity == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("where", ["/lab/arm/robot_description", "/lab/robot_description", "/robot_description"])
def test_the_description_is_looked_for_upwards(simulate, where):
    simulator = simulate(parameters={where: URDF % 0.5})
    simulator.start().target = 1.0
    simulator.run(30)
    assert simulator.velocity == pytest.approx(0.5, abs=1e-3)


def test_robot_param_names_another_parameter(simulate):
    simulator = simulate("<robotParam>my_robot</robotParam>",
                         {"/lab/arm/robot_description": URDF % 0.5, "/lab/arm/my_robot": URDF % 1.0})
    simulator.start().target = 1.0
    simulator.run(30)
    assert simulator.velocity == pytest.approx(1.0, abs=1e-3)


def test_joint_limits_are_read_in_the_namespace(simulate):
    simulator = simulate(parameters={
        "/lab/arm/joint_limits": {"j": {"has_velocity_limits": True, "max_velocity": 0.25}}})
    simulator.start().target = 1.0
    simulator.run(30)
    assert simulator.velocity == pytest.approx(0.25, abs=1e-3)


def test_reset_and_both_ends_of_an_emergency_stop_restart_controllers(simulate):
    simulator = simulate("<eStopTopic>stop</eStopTopic>")
    controller = simulator.start()
    simulator.run(2)
    simulator.plugin.reset()
    simulator.run(2)
    assert len(controller.starts) == 2
    simulator.ros.subscriptions["/lab/arm/stop"].put(Bool(False))
    simulator.run(2)
    assert len(controller.starts) == 2, "nothing was stopped"
    simulator.ros.subscriptions["/lab/arm/stop"].put(Bool(True))
    simulator.run(2)
    assert len(controller.starts) == 3
    simulator.ros.subscriptions["/lab/arm/stop"].put(Bool(False))
    simulator.run(2)
    assert len(controller.starts) == 4


def test_joints_that_were_set_stay_and_a_command_before_the_next_tick_counts(simulate):
    simulator = simulate()
    controller = simulator.start()
    controller.target = 0.5
    simulator.run(300)
    for put in (simulator.plugin.joints_set, simulator.plugin.reset):
        simulator.model.set_joint_positions(simulator.model.index(["j"]), np.array([-0.3]))
        controller.target = None
        put()
        simulator.run(100)
        assert simulator.model.read_joints()[0][0] == pytest.approx(-0.3, abs=1e-6)
        simulator.model.set_joint_positions(simulator.model.index(["j"]), np.array([-0.3]))
        put()
        controller.target = 0.2
        simulator.run(300)
        assert simulator.model.read_joints()[0][0] == pytest.approx(0.2, abs=1e-4)


def test_a_description_that_cannot_be_used_is_one_error(simulate):
    simulator = simulate(urdf=(URDF % 2).replace("</joint>", '<safety_controller k_velocity="much"/></joint>', 1))
    simulator.run(3)
    assert len(simulator.log.lines) == 1 and simulator.ros.served() == []
    error = simulator.log.of("error")[0]
    assert "model 'arm' has no controllers" in error and "k_velocity='much', expected a number" in error


@pytest.mark.parametrize(("found", "other", "text"), [
    ("PositionJoint", "MagicJoint", "'hardware_interface/MagicJointInterface': left out, since their hardware"),
    ('Transmission</type><joint name="j">', 'Transmission</type><joint name="k">', "for joint 'k'")])
def test_a_description_without_usable_transmissions_has_a_manager(simulate, found, other, text):
    simulator = simulate(urdf=(URDF % 2).replace(found, other))
    simulator.run(3)
    warnings = simulator.log.of("warn")
    assert text in warnings[0] and "no <transmission> that can be used" in warnings[1] and len(simulator.log.lines) == 2
    assert len(simulator.ros.served()) == 6


@pytest.mark.parametrize(("found", "other", "text"), [
    ('<actuator name="m"/>', '<actuator name="m"><mechanicalReduction>ten</mechanicalReduction></actuator>',
     "transmission 't' (line 5): mechanicalReduction is 'ten', expected a number"),
    ("</robot>", """<transmission name="u"><type>transmission_interface/SimpleTransmission</type><joint>
  <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint><actuator name="m"/>
</transmission></robot>""", "transmission 'u' (line 7): left out, since it lacks a <joint> with a name"),
    ("</robot>", """<transmission name="u"><type>its_driver/StateInterface</type><joint name="j">
  <hardwareInterface>its_driver/StateInterface</hardwareInterface></joint><actuator name="m"/>
</transmission></robot>""", "transmission 'u' (line 7) with 'its_driver/StateInterface'")])
def test_a_faulty_transmission_is_one_line_and_the_robot_lives(simulate, found, other, text):
    simulator = simulate(urdf=(URDF % 2).replace(found, other))
    assert len(simulator.log.lines) == 1 and text in simulator.log.of("warn")[0]
    simulator.start().target = 0.5
    simulator.run(300)
    assert simulator.model.read_joints()[0][0] == pytest.approx(0.5, abs=1e-4)


def test_slashes_in_types_survive_the_parameter_server():
    assert _flat({"a": {"B": "m:C", "d": {"E": "n:F"}}, "g": "h:I"}) == {"a/B": "m:C", "a/d/E": "n:F", "g": "h:I"}


class Loop:
    """The simulator's loop around a Simulator's plugin."""

    def __init__(self, simulator):
        self.simulator = simulator
        self.simulation = Simulation(simulator.world, RequestQueue(), simulator.log, Faults(simulator.log), paused=True)
        self.simulation.tick = simulator.world.tick
        self.hosted = HostedPlugin(simulator.plugin, simulator.context, "arm", "libgazebo_ros_control.so")
        self.simulation.host(self.hosted)

    def run(self, ticks):
        for _ in range(ticks):
            self.simulation.do_tick()

    @property
    def position(self):
        return self.simulator.model.read_joints()[0][0]


@pytest.mark.parametrize("time_too", [False, True])
def test_a_plugin_that_fails_keeps_its_controllers_and_holds_its_joints_until_a_reset(simulate, monkeypatch, time_too):
    simulator = simulate()
    controller = simulator.start()
    loop = Loop(simulator)
    controller.target = 0.5
    loop.run(300)
    hardware, left = simulator.plugin._hardware, [None]
    real = hardware.read

    def read():
        if left:
            left.pop()
            raise RecursionError("broken on purpose")
        real()

    monkeypatch.setattr(hardware, "read", read)
    starts = len(controller.starts)
    loop.run(50)
    assert loop.hosted.failures == 1 and not loop.hosted.has_failed
    assert len(controller.starts) == starts + 1 and loop.position == pytest.approx(0.5, abs=1e-3)
    left[:] = [None] * 2
    controller.target = -0.5
    loop.run(500)
    assert loop.hosted.has_failed and loop.position == pytest.approx(0.5, abs=2e-3)
    loop.simulation.reset(time_too)
    controller.target = 0.25
    loop.run(300)
    assert not loop.hosted.has_failed and loop.position == pytest.approx(0.25, abs=1e-3)
    assert [loaded.state for loaded in simulator.plugin._manager.loaded] == ["running"]
