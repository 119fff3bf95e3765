# SPDX-License-Identifier: BSD-3-Clause
"""Cost of the controllers of 18 joints in a tick, compared with the physics step of the same world.

A tick is the work of libgazebo_ros_control.so: read the joints, update three controllers of six joints each and the
joint states, enforce the limits, drive the joints. All figures are of one run on one machine, so that ratios are valid.
"""
import statistics
import time
from pathlib import Path

import numpy as np
import rospkg
import rospy
import yaml
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from bullet_sim import Pose, World
from controller_manager import ControllerTable
from controller_manager.manager import ControllerManager
from controller_manager.testing import fake_context
from gazebo_ros_control.hardware import SimulatedHardware
from loop_ros.testing import FakeLog
from urdf_model import parse_urdf

DT = 0.002
GROUPS = 3
PER_GROUP = 6
LIMIT_MS = 0.10
KINDS = {
    "trajectory": ("Position", "position_controllers/JointTrajectoryController", {}),
    "position": ("Position", "position_controllers/JointGroupPositionController", {}),
    "velocity": ("Velocity", "velocity_controllers/JointGroupVelocityController", {}),
    "effort, PID": ("Effort", "effort_controllers/JointGroupPositionController", {"pid": {"p": 50.0, "d": 5.0}}),
}
LINK = """<link name="%s"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="%s" type="revolute"><parent link="%s"/><child link="l_%s"/><origin xyz="0.2 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="3" effort="100"/></joint>
<transmission name="tran1"><type>transmission_interface/SimpleTransmission</type><joint name="%s">
  <hardwareInterface>hardware_interface/%sJointInterface</hardwareInterface></joint>
  <actuator name="m"/></transmission>"""


def description(interface):
    """Three arms of six joints on one base; returns (URDF, joint names of each arm)."""
    parts, arms = [LINK % "base"], []
    for arm in range(GROUPS):
        names = ["arm_%d_joint_%d" % (arm, k) for k in range(PER_GROUP)]
        for k, name in enumerate(names):
            parent = "l_" + names[k - 1] if k else "base"
            parts += [LINK % ("l_" + name), JOINT % (name, parent, name, name, interface)]
        arms.append(names)
    return '<robot name="arms">%s</robot>' % "".join(parts), arms


def group_command(names, tick):
    """A new command in each tick."""
    return Float64MultiArray(data=[0.3 * np.sin(tick * DT)] * len(names))


def trajectory_command(names, tick):
    """Quintic splines through five points, longer than the measurement; sent once."""
    if tick > 1:
        return None
    points = [JointTrajectoryPoint([0.3 * (-1) ** k] * len(names), [0.1] * len(names), [0.0] * len(names), [],
                                   rospy.Duration(20.0 * (k + 1))) for k in range(5)]
    return JointTrajectory(joint_names=names, points=points) if tick == 1 else None


def median_us(times):
    return statistics.median(times) * 1e6


def measure_kind(table, interface, kind, gains, ticks):
    """Median times [us] of (read, update, limits and drives, physics step)."""
    xml, arms = description(interface)
    robot = parse_urdf(xml)
    world = World(time_step_s=DT)
    model = world.spawn(robot, "arms", Pose((0, 0, 1)), static=True)
    hardware = SimulatedHardware(model, robot, xml, log=FakeLog())
    manager = ControllerManager(hardware, FakeLog())
    subscriptions = []
    for number, names in enumerate(arms):
        name = "arm_%d" % number
        context, ros = fake_context(name, {"joints": names, **dict.fromkeys(names, gains)}, robot=robot)
        manager.load(name, kind, table.find(kind), context)
        subscriptions.append(ros.subscriptions["/robot/%s/command" % name])
    context, ros = fake_context("states", {"publish_rate": 50}, robot=robot)
    ros.publisher("/robot/joint_states", None).has_listeners = False
    manager.load("states", "states", table.find("joint_state_controller/JointStateController"), context)
    command = trajectory_command if "Trajectory" in kind else group_command
    manager.switch([loaded.name for loaded in manager.loaded], [])
    parts = ([], [], [], [])
    for tick in range(ticks):
        for names, subscribed in zip(arms, subscriptions, strict=True):
            message = command(names, tick)
            if message is not None:
                subscribed.put(message)
        marks = [time.perf_counter()]
        hardware.read()
        marks.append(time.perf_counter())
        manager.update(world.time_s, DT)
        marks.append(time.perf_counter())
        hardware.write(DT)
        marks.append(time.perf_counter())
        world.step()
        marks.append(time.perf_counter())
        for times, start, end in zip(parts, marks, marks[1:], strict=False):
            times.append(end - start)
    if np.abs(hardware.position).max() < 1e-3:
        raise SystemExit("%s: the joints did not move, so the figures are invalid" % kind)
    world.close()
    return [median_us(times) for times in parts]


def measure(report, quick, number):
    path = Path(rospkg.RosPack().get_path("ros_controllers"), "config", "controllers.yaml")
    table = ControllerTable(yaml.safe_load(path.read_text()))
    for label, (interface, kind, gains) in KINDS.items():
        read, update, write, step = measure_kind(table, interface, kind, gains, 2500 if quick else 5000)
        report.add("%s: read, update, write" % label, read + update + write, "us", ("physics step", step),
                   most=1e3 * LIMIT_MS)
