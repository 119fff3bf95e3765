# SPDX-License-Identifier: BSD-3-Clause
"""Simulated joints under each interface, in a physics world, without ROS."""
import re

import numpy as np
import pytest

from bullet_sim import Pose, World
from controller_manager import EFFORT, POS_VEL, POS_VEL_ACC, POSITION, VELOCITY, HardwareError
from gazebo_ros_control.hardware import SimulatedHardware
from lab_testing.closing import factory
from loop_ros.testing import FakeLog
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

FREE_BASE = """<link name="l0"><inertial><mass value="%(mass)s"/>
  <inertia ixx="%(inertia)s" iyy="%(inertia)s" izz="%(inertia)s" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.4 0.4 0.1"/></geometry></collision></link>"""


def arm_urdf(interface, mass=1.0, inertia=0.02, reduction=1, count=2, limit=LIMIT, kind="revolute"):
    """A chain of horizontal pendulums."""
    parts = [LINK % {"name": "l0", "mass": mass, "inertia": inertia}]
    for k in range(1, count + 1):
        parts.append(LINK % {"name": "l%d" % k, "mass": mass, "inertia": inertia})
        parts.append(JOINT % {"name": "joint_%d" % k, "kind": kind, "parent": "l%d" % (k - 1), "child": "l%d" % k,
                              "x": 0.4 if k > 1 else 0.0, "limit": limit})
        parts.append(TRANSMISSION % {"name": "joint_%d" % k, "interface": interface, "reduction": reduction})
    return '<robot name="arm">%s</robot>' % "".join(parts)


def with_free_base(xml):
    """The same with a first link that stands on the floor: a box, ten times as heavy as the others."""
    begin, end = xml.index('<link name="l0">'), xml.index("</link>") + len("</link>")
    mass, inertia = (float(re.search(r'%s"([^"]+)"' % start, xml)[1]) for start in ("mass value=", "ixx="))
    return xml[:begin] + FREE_BASE % {"mass": 10.0 * mass, "inertia": 10.0 * inertia} + xml[end:]


class Arm:
    def __init__(self, interface, limit_parameters=None, gain_parameters=None, start=0.3, free=False, **options):
        xml = arm_urdf(interface, **options)
        self.world = World(time_step_s=DT)
        if free:
            xml = with_free_base(xml)
            self.world.add_ground_plane()
        robot = parse_urdf(xml)
        self.model = self.world.spawn(robot, "arm", Pose((0, 0, 0.05 if free else 1)), static=not free)
        self.all = np.arange(len(self.model.joint_names))
        self.model.set_joint_positions(self.all, np.full(len(self.all), start))
        self.log = FakeLog()
        self.hardware = SimulatedHardware(self.model, robot, xml, self.log, limit_parameters, gain_parameters, "/arm")

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
    with factory(Arm, "world") as made:
        yield made


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


@pytest.mark.parametrize("name, interface", [("PosVel", POS_VEL), ("PosVelAcc", POS_VEL_ACC)])
def test_positions_with_velocities_are_positions(make, name, interface):
    arm = make(name)
    assert arm.hardware.interface_joints[interface] == ("joint_1", "joint_2") and not arm.log.lines
    assert arm.run(0.5, 0.5, interface) == pytest.approx([0.5, 0.5], abs=1e-3)
    arm.hardware.stop(True)
    assert arm.run(0.5, 1.0, interface) == pytest.approx([0.5, 0.5], abs=1e-3)


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


@pytest.mark.parametrize("interface", ["Position", "Velocity", "Effort"])
def test_joints_without_limits_are_driven_without_limits(make, interface):
    """As the tutorials' robot, whose continuous joints have no <limit>."""
    arm = make(interface, limit="", kind="continuous", count=1, start=0.0)
    kind = {"Position": POSITION, "Velocity": VELOCITY, "Effort": EFFORT}[interface]
    arm.run(0.5, {"Position": 2.0, "Velocity": 4.0, "Effort": 20.0}[interface], kind)
    assert abs(arm.hardware.position[0]) > 1.5
    assert arm.log.lines == []


def test_soft_limits_without_a_velocity_limit_are_a_warning(make):
    arm = make("Position", limit='<limit lower="-1.5" upper="1.5" effort="50"/><safety_controller k_velocity="1" '
                                 'k_position="5" soft_lower_limit="-1" soft_upper_limit="1"/>', count=1)
    assert "joint_1" in " ".join(arm.log.of("warn")) and "safety_controller" in " ".join(arm.log.of("warn"))
    assert arm.run(0.5, 1.2, POSITION) == pytest.approx([1.2], abs=1e-3)


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


ASLEEP_AFTER_S = 6.0


@pytest.fixture
def standing(make):
    """Make a free-standing arm on the floor, and wait long enough that Bullet may put it to sleep."""

    def stand(interface, mass, inertia, **options):
        arm = make(interface, mass=mass, inertia=inertia, start=0.0, free=True, **options)
        arm.run(ASLEEP_AFTER_S)
        return arm

    return stand


@pytest.mark.parametrize(("interface", "command", "moved"), [
    ("Position", [0.3, -0.2], [0.3, -0.2]), ("Velocity", [-0.5, 0.3], [-0.5, 0.3]),
])
def test_a_robot_that_stands_free_obeys_however_long_it_has_stood(standing, interface, command, moved):
    arm = standing(interface, 1.0, 0.02)
    before = arm.hardware.position.copy()
    kind = {"Position": POSITION, "Velocity": VELOCITY}[interface]
    goal = before + command if kind == POSITION else command
    assert arm.run(1.0, goal, kind) - before == pytest.approx(moved, abs=0.02)


@pytest.mark.parametrize(("mass", "inertia"), [(1e-5, 10.0), (1.0, 0.02)])
def test_the_position_interface_leaves_a_free_base_where_it_stands(standing, mass, inertia):
    arm = standing("Position", mass, inertia)
    before, start, velocities = arm.model.base_pose(), arm.hardware.position.copy(), []
    for k in range(1, 501):
        arm.run(DT, start + 0.001 * k, POSITION)
        velocities.append(arm.hardware.velocity.copy())
    after = arm.model.base_pose()
    assert arm.hardware.position - start == pytest.approx([0.5, 0.5], abs=1e-3)
    # The command's own velocity, although the physics has none.
    assert np.array(velocities[10:]) == pytest.approx(0.5, abs=0.01)
    assert after.position == pytest.approx(before.position, abs=1e-3)
    assert after.quaternion == pytest.approx(before.quaternion, abs=2e-3)


def test_a_free_robots_joints_carry_load_and_push(standing):
    """Motion has no reaction, but loads have: the arm pushes itself off the floor."""
    arm = standing("Position", 1.0, 0.02)
    height = arm.model.base_pose().position[2]
    heights = []
    arm.run(0.5, None, None, watch=lambda: (arm.model.apply_wrench("l2", (0.0, 0.0, 400.0)),
                                            heights.append(arm.model.base_pose().position[2])))
    assert max(heights) > height + 0.2
    assert arm.hardware.position == pytest.approx([0.0, 0.0], abs=1e-2)


@pytest.mark.parametrize("interface", ["Effort", "Velocity", "Position"])
def test_joints_whose_controller_has_failed_are_held_until_another_one_starts(make, interface):
    arm = make(interface, mass=3.0)
    kind = {"Effort": EFFORT, "Velocity": VELOCITY, "Position": POSITION}[interface]
    claims = {kind: list(arm.hardware.joint_names)}
    arm.run(0.05, 1.0 if kind == POSITION else 0.5, kind)
    arm.hardware.hold(claims)
    start = arm.hardware.position.copy()
    arm.run(1.0)
    assert np.abs(arm.hardware.position - start).max() < 5e-3
    arm.hardware.let_go(claims)
    if kind == EFFORT:
        arm.run(0.5, 0.0, kind)
        assert np.abs(arm.hardware.position - start).max() > 0.05, "free again"


@pytest.mark.parametrize("interface", ["Effort", "Velocity"])
def test_an_unused_interface_leaves_a_joint_to_another_plugin(make, interface):
    """As on a vehicle with transmissions on wheels that a skid steer plugin drives."""
    arm = make(interface, mass=0.1, inertia=0.01, start=-1.0)
    for _ in range(100):
        arm.model.drive_velocity(arm.all[:1], np.array([2.0]), np.array([50.0]))
        arm.run(DT)
    assert arm.hardware.velocity[0] == pytest.approx(2.0, abs=0.01)


def test_an_unused_velocity_interface_holds_its_joints(make):
    arm = make("Velocity", mass=1.0, inertia=0.02)
    arm.run(0.2, 0.5, VELOCITY)
    arm.run(DT, 0.0, VELOCITY)
    here = arm.hardware.position.copy()
    assert arm.run(2.0) == pytest.approx(here, abs=0.01)


def test_an_effort_ends_with_its_command(make):
    arm = make("Effort")
    arm.run(5 * DT, [0.03, 0.02], EFFORT)
    assert arm.hardware.effort == pytest.approx([0.03, 0.02])
    arm.run(5 * DT, [0.0, 0.02], EFFORT)
    assert arm.hardware.effort == pytest.approx([0.0, 0.02])
