# SPDX-License-Identifier: BSD-3-Clause
"""Simulated joints under each interface, in a physics world, without ROS."""
import numpy as np
import pytest

from bullet_sim import Pose, World
from controller_manager import EFFORT, POSITION, VELOCITY, HardwareError
from controller_manager.testing import FakeLog
from gazebo_ros_control.hardware import SimulatedHardware
from urdf_model import parse_urdf

DT = 0.002
LINK = """<link name="%(name)s"><inertial><origin xyz="0.2 0 0"/><mass value="%(mass)s"/>
  <inertia ixx="%(inertia)s" iyy="%(inertia)s" izz="%(inertia)s" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="%(name)s" type="%(kind)s"><parent link="%(parent)s"/><child link="%(child)s"/>
  <origin xyz="%(x)s 0 0"/><axis xyz="0 1 0"/>%(limit)s</joint>"""
LIMIT = '<limit lower="-1.5" upper="1.5" velocity="2" effort="50"/>'
TRANSMISSION = """<transmission name="tran1"><type>transmission_interface/SimpleTransmission</type>
  <joint name="%(name)s"><hardwareInterface>hardware_interface/%(interface)sJointInterface</hardwareInterface></joint>
  <actuator name="m"><mechanicalReduction>%(reduction)s</mechanicalReduction></actuator></transmission>"""


def arm_urdf(interface, mass=1.0, inertia=0.02, reduction=1, count=2, limit=LIMIT, kind="revolute"):
    """A chain of horizontal pendulums."""
    parts = [LINK % {"name": "l0", "mass": mass, "inertia": inertia}]
    for k in range(1, count + 1):
        parts.append(LINK % {"name": "l%d" % k, "mass": mass, "inertia": inertia})
        parts.append(JOINT % {"name": "joint_%d" % k, "kind": kind, "parent": "l%d" % (k - 1), "child": "l%d" % k,
                              "x": 0.4 if k > 1 else 0.0, "limit": limit})
        parts.append(TRANSMISSION % {"name": "joint_%d" % k, "interface": interface, "reduction": reduction})
    return '<robot name="arm">%s</robot>' % "".join(parts)


class Arm:
    def __init__(self, interface, limit_parameters=None, gain_parameters=None, start=0.3, **options):
        xml = arm_urdf(interface, **options)
        robot = parse_urdf(xml)
        self.world = World(time_step_s=DT)
        self.model = self.world.spawn(robot, "arm", Pose((0, 0, 1)), static=True)
        self.all = np.arange(len(self.model.joint_names))
        self.model.set_joint_positions(self.all, np.full(len(self.all), start))
        self.log = FakeLog()
        self.hardware = SimulatedHardware(self.model, robot, xml, limit_parameters, gain_parameters, "/arm", self.log)

    def run(self, seconds, command=None, interface=None, watch=None):
        for _ in range(round(seconds / DT)):
            self.hardware.read()
            if command is not None:
                self.hardware.command[interface][:] = command
            self.hardware.write(DT)
            self.world.step()
            if watch is not None:
                self.hardware.read()
                watch()
        self.hardware.read()
        return self.hardware.position


@pytest.fixture
def make():
    arms = []

    def make_arm(*arguments, **options):
        arms.append(Arm(*arguments, **options))
        return arms[-1]

    yield make_arm
    for arm in arms:
        arm.world.close()


MASSES = [(1e-5, 10.0), (1e-5, 1e-7), (1.0, 0.02), (30.0, 1.0)]


@pytest.mark.parametrize(("mass", "inertia"), MASSES)
def test_the_position_interface_holds_any_mass_against_gravity(make, mass, inertia):
    arm = make("Position", mass=mass, inertia=inertia, count=6)
    # The solver's iterations leave a quarter of a milliradian in a stretched chain of six.
    assert arm.run(2.0) == pytest.approx([0.3] * 6, abs=5e-4)
    assert np.abs(arm.hardware.velocity).max() < 1e-3


@pytest.mark.parametrize(("mass", "inertia"), MASSES)
def test_the_position_interface_follows_a_sine_within_the_tick(make, mass, inertia):
    arm = make("Position", mass=mass, inertia=inertia, count=6)
    errors, time_s = [], 0.0

    def watch():
        errors.append(np.abs(arm.hardware.position - arm.hardware.command[POSITION]).max())

    for _ in range(1000):
        time_s += DT
        arm.run(DT, 0.3 + 0.5 * (1.0 - np.cos(2.0 * time_s)), POSITION, watch)
    assert max(errors) < 0.002


def test_a_position_step_moves_at_the_velocity_limit(make):
    arm = make("Position")
    arm.run(0.25, 1.0, POSITION)
    assert arm.hardware.velocity == pytest.approx([2.0, 2.0], abs=1e-3)
    assert arm.hardware.position == pytest.approx([0.8, 0.8], abs=1e-3)
    assert arm.run(0.5, 9.0, POSITION) == pytest.approx([1.5, 1.5], abs=1e-3)


def test_the_reduction_has_no_effect(make):
    paths = []
    for reduction in (1, 100):
        arm = make("Position", reduction=reduction)
        path = []
        for k in range(200):
            path.append(arm.run(DT, 0.3 + 0.001 * k, POSITION).copy())
        paths.append(path)
    assert np.array_equal(*paths)


def test_position_with_gains_uses_no_more_than_the_effort_limit(make):
    gains = {"joint_1": {"p": 1000.0, "d": 80.0}, "joint_2": {"p": 1000.0, "d": 80.0}}
    arm = make("Position", gain_parameters=gains, inertia=0.5)
    efforts = []
    position = arm.run(4.0, 1.0, POSITION, lambda: efforts.append(np.abs(arm.hardware.effort).max()))
    assert position == pytest.approx([1.0, 1.0], abs=0.02), "gravity leaves an error"
    assert np.abs(position - 1.0).max() > 1e-4, "a PID, not the kinematic drive"
    assert max(efforts) <= 50.0


def test_gains_without_p_are_one_error_that_names_the_parameter(make):
    arm = make("Position", gain_parameters={"joint_1": {"i": 1.0}})
    errors = arm.log.of("error")
    assert len(errors) == 1 and "/arm/gazebo_ros_control/pid_gains/joint_1/p is missing" in errors[0]
    assert arm.run(1.0) == pytest.approx([0.3, 0.3], abs=1e-4)


def test_velocity_is_kept_and_limited(make):
    arm = make("Velocity", start=-1.0)
    arm.run(0.2, 0.5, VELOCITY)
    assert arm.hardware.velocity == pytest.approx([0.5, 0.5], abs=2e-3)
    arm.run(0.2, 99.0, VELOCITY)
    assert arm.hardware.velocity == pytest.approx([2.0, 2.0], abs=5e-3)


def test_velocity_with_gains(make):
    gains = {"joint_%d" % k: {"p": 20.0, "i": 200.0, "i_clamp": 40.0} for k in (1, 2)}
    arm = make("Velocity", gain_parameters=gains, start=-0.5, inertia=0.5)
    arm.run(1.0, 0.2, VELOCITY)
    assert arm.hardware.velocity == pytest.approx([0.2, 0.2], abs=0.02)


def test_effort_acts_and_is_limited(make):
    arm = make("Effort")
    gravity = arm.model.gravity_efforts()
    for _ in range(250):
        arm.run(DT, arm.model.gravity_efforts(), EFFORT)
    assert arm.hardware.position == pytest.approx([0.3, 0.3], abs=1e-3)
    assert arm.hardware.effort == pytest.approx(gravity, abs=0.01)
    arm.run(DT, 1e6, EFFORT)
    assert arm.hardware.effort == pytest.approx([50.0, 50.0])


def test_limit_parameters_override_the_urdf(make):
    arm = make("Position", {"joint_1": {"has_velocity_limits": True, "max_velocity": 0.5}})
    arm.run(0.2, 1.0, POSITION)
    assert arm.hardware.velocity == pytest.approx([0.5, 2.0], abs=1e-3)


def test_a_wrong_limit_parameter_is_named(make):
    with pytest.raises(HardwareError, match="/arm/joint_limits/joint_1/max_velocity is None"):
        make("Position", {"joint_1": {"has_velocity_limits": True}})


def test_effort_joints_need_limits(make):
    with pytest.raises(HardwareError, match="'joint_1' has no velocity limit"):
        make("Effort", limit="", kind="continuous")


def test_continuous_joints_turn_on_and_on(make):
    arm = make("Velocity", kind="continuous", count=1, mass=1e-5)
    arm.run(4.0, 2.0, VELOCITY)
    assert arm.hardware.position == pytest.approx([8.3], abs=0.01)


@pytest.mark.parametrize("interface", ["Position", "Velocity", "Effort"])
def test_the_emergency_stop_holds(make, interface):
    arm = make(interface, mass=1e-5, inertia=0.1, start=-1.0)
    kind = {"Position": POSITION, "Velocity": VELOCITY, "Effort": EFFORT}[interface]
    value = {"Position": 1.0, "Velocity": 1.0, "Effort": 0.1}[interface]
    arm.run(0.2, value, kind)
    arm.hardware.stop(True)
    where, speed = arm.hardware.position.copy(), arm.hardware.velocity.copy()
    arm.run(0.2, value, kind)
    if interface == "Effort":
        assert arm.hardware.effort == pytest.approx([0.0, 0.0])
        assert np.abs(arm.hardware.velocity - speed).max() < 0.05
    else:
        assert arm.hardware.position == pytest.approx(where, abs=0.01)
    arm.hardware.stop(False)
    arm.run(0.2, value, kind)
    assert np.abs(arm.hardware.position - where).max() > 0.01


def test_joints_that_were_put_elsewhere_stay_there(make):
    arm = make("Position")
    arm.model.set_joint_positions(arm.all, np.array([-1.0, 0.7]))
    arm.hardware.joints_set()
    assert arm.run(0.1) == pytest.approx([-1.0, 0.7], abs=1e-4)
