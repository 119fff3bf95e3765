# SPDX-License-Identifier: BSD-3-Clause
"""Joint states, forwarding and PID controllers on joints that follow commands."""
from pathlib import Path

import pytest
import yaml
from std_msgs.msg import Float64, Float64MultiArray

from controller_manager import EFFORT, JOINT_STATE, POSITION, VELOCITY, ControllerError, ControllerTable
from controller_manager.testing import FakeHardware, fake_context
from urdf_model import parse_urdf

DT = 0.002
TABLE = ControllerTable(yaml.safe_load((Path(__file__).parents[2] / "config" / "controllers.yaml").read_text()))
PID = {"p": 20.0, "i": 0.5, "d": 2.0, "i_clamp": 3.0}
JOINT = """<joint name="%s" type="%s"><parent link="base"/><child link="l_%s"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="9" effort="9"/></joint><link name="l_%s"/>"""
ROBOT = parse_urdf('<robot name="r"><link name="base"/>%s</robot>' % "".join(
    JOINT % (name, kind, name, name) for name, kind in (("b", "revolute"), ("a", "continuous"), ("c", "prismatic"))))


class Running:
    """A controller of one type in its own namespace, started."""

    def __init__(self, kind, interface, parameters, start=True, robot=ROBOT):
        self.hardware = FakeHardware(dict.fromkeys(("b", "a", "c"), (interface,)))
        self.hardware.position[:] = 0.1, 0.2, 0.3
        self.context, self.ros = fake_context("arm", parameters, robot=robot)
        self.controller = TABLE.find(kind)("arm", self.hardware, self.context)
        self.time_s = 0.0
        if start:
            self.controller.starting(self.time_s)

    def send(self, message):
        self.ros.subscriptions["/robot/arm/command"].put(message)

    def run(self, ticks=1, step=True):
        for _ in range(ticks):
            self.controller.update(self.time_s, DT)
            if step:
                self.hardware.step(DT)
            self.time_s += DT

    def command(self, interface):
        return self.hardware.command[interface].tolist()


# -- joint states ---------------------------------------------------------------------------------------------------


def joint_states(**parameters):
    return Running("joint_state_controller/JointStateController", POSITION, parameters)


def test_joint_states_are_alphabetical_and_complete():
    running = joint_states(publish_rate=50)
    running.hardware.velocity[:], running.hardware.effort[:] = (1, 2, 3), (4, 5, 6)
    running.run(step=False)
    message = running.ros.publishers["/robot/joint_states"].messages[0]
    assert message.name == ["a", "b", "c"] and message.position == (0.2, 0.1, 0.3)
    assert message.velocity == (2.0, 1.0, 3.0) and message.effort == (5.0, 4.0, 6.0)
    assert message.header.stamp.to_sec() == 0.0
    assert running.controller.claims == {JOINT_STATE: []}


def test_joint_states_come_at_their_rate():
    running = joint_states(publish_rate=50)
    running.run(500, step=False)
    stamps = [message.header.stamp.to_nsec() for message in running.ros.publishers["/robot/joint_states"].messages]
    assert stamps == list(range(0, 10**9, 20_000_000))


def test_a_rate_that_is_no_whole_number_of_ticks_is_kept_on_average():
    running = joint_states(publish_rate=30)
    running.run(5000, step=False)
    assert len(running.ros.publishers["/robot/joint_states"].messages) == 300


def test_joint_states_go_on_after_time_went_back():
    running = joint_states(publish_rate=50)
    running.run(100, step=False)
    running.time_s = 0.0
    before = len(running.ros.publishers["/robot/joint_states"].messages)
    running.run(1, step=False)
    assert len(running.ros.publishers["/robot/joint_states"].messages) == before + 1


def test_joint_states_of_chosen_and_extra_joints():
    running = joint_states(publish_rate=50, joints=["c"], extra_joints=[{"name": "x", "position": 1.5}, {"name": "y"}])
    running.run(step=False)
    message = running.ros.publishers["/robot/joint_states"].messages[0]
    assert message.name == ["c", "x", "y"] and message.position == (0.3, 1.5, 0.0) and message.effort == (0.0,) * 3


@pytest.mark.parametrize(("parameters", "text"), [
    ({}, "/robot/arm/publish_rate is missing; give the rate"),
    ({"publish_rate": 50, "joints": ["d"]}, "joint 'd'.*a"),
])
def test_wrong_joint_state_parameters_are_named(parameters, text):
    with pytest.raises(ControllerError, match=text):
        joint_states(**parameters)


def test_joint_states_are_not_published_at_a_rate_of_zero():
    running = joint_states(publish_rate=0)
    running.run(500, step=False)
    assert running.ros.publishers["/robot/joint_states"].messages == []
    assert "publish_rate is 0" in running.context.log.of("warn")[0]


@pytest.mark.parametrize(("entry", "text"), [
    ("x", "'x' is no {name"), ({"nickname": "x"}, "is no {name"), ({"name": "a"}, "there is already a joint 'a'"),
    ({"name": "x", "position": "far"}, "joint 'x' has ['far', 0.0, 0.0], expected numbers"),
    ({"name": "y"}, "there is already a joint 'y'"),
])
def test_wrong_extra_joints_are_left_out(entry, text):
    running = joint_states(publish_rate=50, extra_joints=[{"name": "y", "velocity": 2}, entry])
    running.run(step=False)
    message = running.ros.publishers["/robot/joint_states"].messages[0]
    assert message.name == ["a", "b", "c", "y"] and message.velocity == (0.0, 0.0, 0.0, 2.0)
    assert text in running.context.log.of("warn")[0]


def test_extra_joints_that_are_no_list_are_ignored():
    running = joint_states(publish_rate=50, extra_joints="x")
    running.run(step=False)
    assert running.ros.publishers["/robot/joint_states"].messages[0].name == ["a", "b", "c"]


# -- forwarding -----------------------------------------------------------------------------------------------------

SINGLE = [("position_controllers/JointPositionController", POSITION, 0.2),
          ("velocity_controllers/JointVelocityController", VELOCITY, 0.0),
          ("effort_controllers/JointEffortController", EFFORT, 0.0)]
GROUP = [("position_controllers/JointGroupPositionController", POSITION, [0.3, 0.1]),
         ("velocity_controllers/JointGroupVelocityController", VELOCITY, [0.0, 0.0]),
         ("effort_controllers/JointGroupEffortController", EFFORT, [0.0, 0.0])]


@pytest.mark.parametrize(("kind", "interface", "start"), SINGLE)
def test_a_single_command_is_forwarded(kind, interface, start):
    running = Running(kind, interface, {"joint": "a"})
    assert running.controller.claims == {interface: ["a"]}
    running.hardware.command[interface][:] = 9.0
    running.run(step=False)
    assert running.command(interface) == [9.0, start, 9.0]
    running.send(Float64(7.0))
    running.send(Float64(0.7))
    running.run(3, step=False)
    assert running.command(interface) == [9.0, 0.7, 9.0], "the newest command, and no other joint"


@pytest.mark.parametrize(("kind", "interface", "start"), GROUP)
def test_a_group_command_is_forwarded(kind, interface, start):
    running = Running(kind, interface, {"joints": ["c", "b"]})
    running.run(step=False)
    found = running.command(interface)
    assert [found[2], found[0]] == start
    running.send(Float64MultiArray(data=[1.0, 2.0]))
    running.run(step=False)
    assert running.command(interface) == [2.0, 0.0, 1.0]
    for wrong in ([1.0], [1.0, 2.0, 3.0], [], [float("nan"), 1.0]):
        running.send(Float64MultiArray(data=wrong))
        running.run(step=False)
        assert running.command(interface) == [2.0, 0.0, 1.0]
    assert len(running.context.log.of("error")) == 4 and "c, b" in running.context.log.of("error")[0]


def test_a_command_from_before_the_start_does_not_count():
    running = Running(SINGLE[0][0], POSITION, {"joint": "a"}, start=False)
    running.send(Float64(0.9))
    running.controller.starting(0.0)
    running.run()
    assert running.command(POSITION)[1] == 0.2


@pytest.mark.parametrize(("kind", "interface", "parameters", "text"), [
    (SINGLE[0][0], POSITION, {}, "/robot/arm/joint is missing; give the name of a joint"),
    (SINGLE[0][0], VELOCITY, {"joint": "a"}, "needs hardware_interface::PositionJointInterface.*it has .*Velocity"),
    (SINGLE[0][0], POSITION, {"joint": "d"}, "joint 'd'.*no transmission"),
    (GROUP[0][0], POSITION, {"joints": []}, r"/robot/arm/joints is \[\], expected a list"),
])
def test_wrong_forward_parameters_are_named(kind, interface, parameters, text):
    with pytest.raises(ControllerError, match=text):
        Running(kind, interface, parameters)


# -- PID ------------------------------------------------------------------------------------------------------------


def test_position_on_effort_settles():
    running = Running("effort_controllers/JointPositionController", EFFORT,
                      {"joint": "b", "pid": {"p": 100.0, "d": 20.0}})
    running.run(5)
    assert abs(running.hardware.position[0] - 0.1) < 1e-9, "it starts where the joint is"
    running.send(Float64(0.6))
    running.run(1000)
    assert running.hardware.position[0] == pytest.approx(0.6, abs=1e-3)


def test_position_on_velocity_settles_and_clamps_to_the_urdf():
    running = Running("velocity_controllers/JointPositionController", VELOCITY, {"joint": "b", "pid": {"p": 10.0}})
    running.send(Float64(5.0))
    running.run(1000)
    assert running.hardware.position[0] == pytest.approx(1.0, abs=1e-3)


def test_velocity_on_effort_settles():
    running = Running("effort_controllers/JointVelocityController", EFFORT, {"joint": "b", "pid": {"p": 10.0}})
    running.send(Float64(0.5))
    running.run(1000)
    assert running.hardware.velocity[0] == pytest.approx(0.5, abs=1e-3)


def test_a_continuous_joint_takes_the_shorter_way():
    running = Running("effort_controllers/JointPositionController", EFFORT, {"joint": "a", "pid": {"p": 1.0}})
    running.hardware.position[1] = 3.0
    running.send(Float64(-3.0))
    running.run(step=False)
    assert running.command(EFFORT)[1] == pytest.approx(0.2831853)


def test_a_group_on_effort_has_gains_of_each_joint():
    running = Running("effort_controllers/JointGroupPositionController", EFFORT,
                      {"joints": ["c", "b"], "c": {"pid": {"p": 10.0}}, "b": {"pid": {"p": 100.0}}})
    running.send(Float64MultiArray(data=[0.4, 0.2]))
    running.run(step=False)
    assert running.command(EFFORT) == pytest.approx([10.0, 0.0, 1.0])


def test_the_state_goes_out_with_every_tenth_update():
    running = Running("effort_controllers/JointPositionController", EFFORT, {"joint": "b", "pid": PID})
    running.send(Float64(3.0))
    running.run(30, step=False)
    messages = running.ros.publishers["/robot/arm/state"].messages
    assert len(messages) == 3
    state = messages[-1]
    assert (state.set_point, state.process_value, state.error) == pytest.approx((1.0, 0.1, 0.9))
    assert (state.p, state.i, state.d, state.i_clamp, state.antiwindup) == (20.0, 0.5, 2.0, 3.0, False)
    assert (state.time_step, state.command, state.header.stamp.to_sec()) == (DT, running.command(EFFORT)[0], 0.058)


def test_the_state_of_a_velocity():
    running = Running("effort_controllers/JointVelocityController", EFFORT, {"joint": "b", "pid": PID})
    running.hardware.velocity[0] = 0.25
    running.send(Float64(3.0))
    running.run(10, step=False)
    state = running.ros.publishers["/robot/arm/state"].messages[0]
    assert (state.set_point, state.process_value, state.error) == (3.0, 0.25, 2.75)


@pytest.mark.parametrize(("kind", "parameters", "robot", "text"), [
    ("JointPositionController", {"joint": "b"}, ROBOT, "/robot/arm/pid/p is missing; give the proportional gain"),
    ("JointGroupPositionController", {"joints": ["b"]}, ROBOT, "/robot/arm/b/pid/p is missing"),
    ("JointPositionController", {"joint": "b", "pid": PID}, None, "/robot/robot_description is missing"),
    ("JointVelocityController", {"pid": PID}, ROBOT, "/robot/arm/joint is missing"),
])
def test_wrong_pid_parameters_are_named(kind, parameters, robot, text):
    with pytest.raises(ControllerError, match=text):
        Running("effort_controllers/" + kind, EFFORT, parameters, robot=robot)


# -- the table ------------------------------------------------------------------------------------------------------


def test_every_entry_of_the_table_loads():
    for kind in TABLE.types:
        assert TABLE.find(kind).__doc__, kind


def test_unknown_and_broken_entries_are_named():
    with pytest.raises(ControllerError, match="'a/B' is not known; known types: .*position_controllers"):
        TABLE.find("a/B")
    for target, text in (("nowhere:X", "No module named 'nowhere'"), ("math:nothing", "nothing"),
                         ("fractions:Fraction", "not a subclass")):
        with pytest.raises(ControllerError, match="controller type a/B: .*" + text):
            ControllerTable({"a/B": target}).find("a/B")
    with pytest.raises(ControllerError, match='expected "module:Class"'):
        ControllerTable({"a/B": "math"}).find("a/B")


@pytest.mark.parametrize("kind, interface, parameters", [
    ("position_controllers/JointPositionController", POSITION, {"joint": "a"}),
    ("effort_controllers/JointGroupEffortController", EFFORT, {"joints": ["a", "b"]}),
    ("effort_controllers/JointPositionController", EFFORT, {"joint": "b", "pid": PID}),
    ("position_controllers/JointTrajectoryController", POSITION, {"joints": ["a", "b"]})])
def test_a_command_that_a_controller_fails_on_is_dropped(kind, interface, parameters):
    running = Running(kind, interface, parameters)
    running.run(3)
    running.send(object())  # as if an unexpected exception came from inside
    before = running.command(interface)
    running.run()
    (place, error), = running.ros.faults.noted
    assert place == "/robot/arm/command" and isinstance(error, AttributeError)
    assert running.command(interface) == pytest.approx(before, abs=0.1)
