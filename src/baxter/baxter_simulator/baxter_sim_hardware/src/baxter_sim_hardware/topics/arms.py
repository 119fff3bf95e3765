# SPDX-License-Identifier: BSD-3-Clause
"""The arms in ROS messages: their commands and settings, end points, set-points and external loads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from baxter_core_msgs.msg import JointCommand

from baxter_model import BASE_FRAME, JOINTS, tip_of
from baxter_sim_hardware.arms import endpoint
from baxter_sim_hardware.arms.joint_command import Mode
from baxter_sim_hardware.errors import CommandRefused

from . import convert
from .row import JOINT_STATE_RATE, STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from baxter_core_msgs.msg import EndpointState, SEAJointState
    from control_msgs.msg import JointControllerState
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Bool, Float64
    from trajectory_msgs.msg import JointTrajectoryPoint

    from arm_kinematics import Chain
    from baxter_sim_hardware.robot import BaxterHardware
    from baxter_sim_hardware.snapshot import JointSnapshot
    from baxter_sim_hardware.warnings import Warnings

SPRING_JOINT = JOINTS.index("s1")  # the one with the spring; the message has one state of hysteresis for all joints

# The vendor's simulator had a controller for each joint and mode, which programs written for it command one by one.
# {name of a group of controllers: (mode, quantity)}
CONTROLLERS = {
    "joint_position_controller": (Mode.POSITION, "position [rad]"),
    "joint_velocity_controller": (Mode.VELOCITY, "velocity [rad/s]"),
    "joint_effort_controller": (Mode.TORQUE, "torque beside gravity's [Nm]"),
}


def _single(mode: Mode) -> Callable[[ArmTopics, tuple[str, str], Float64, float], None]:
    def handle(part, limb_joint, msg, time_s):
        side, joint = limb_joint
        part.joint_command(side, JointCommand(mode=mode, names=["%s_%s" % (side, joint)], command=[msg.data]), time_s)

    return handle


class ArmTopics(RobotPart):
    """baxter: `robot.BaxterHardware`; chains: {side: Chain}; limb_index: {side: (7,) indices of its joints in the
    model's}; warnings: `warnings.Warnings`.

    Attribute `command_observers`: functions that are called in the loop with (side, message, JointCommand or None if it
    was refused) for each joint command.
    """

    def __init__(self, baxter: BaxterHardware, chains: Mapping[str, Chain], limb_index: Mapping[str, np.ndarray],
                 warnings: Warnings) -> None:
        self._baxter, self._chains, self._limb_index = baxter, chains, limb_index
        self._warnings = warnings
        self._arm_index = np.concatenate([limb_index[side] for side in baxter.arms.sides])
        names = np.array(baxter.arms.limits.names)
        self._order = np.argsort(names)
        self._reference_message = convert.JointStates(names[self._order].tolist())
        self.command_observers = []

    # -- out

    def _endpoint_state(self, time_s: float, side: str, snapshot: JointSnapshot) -> EndpointState:
        index = self._limb_index[side]
        position, velocity, _ = snapshot.sensed
        pose, jacobian = self._chains[side].fk_and_jacobian(position[index])
        return convert.endpoint_state(
            time_s, BASE_FRAME, pose, endpoint.twist(jacobian, velocity[index]),
            endpoint.contact_wrench(jacobian, snapshot.effort[index], snapshot.own_effort[index]))

    def _commanded_endpoint(self, time_s: float, side: str, snapshot: JointSnapshot) -> EndpointState:
        arms = self._baxter.arms
        joints = arms.joints_of(side)
        pose, jacobian = self._chains[side].fk_and_jacobian(arms.commanded_position[joints])
        return convert.endpoint_state(time_s, BASE_FRAME, pose,
                                      endpoint.twist(jacobian, arms.commanded_velocity[joints]), np.zeros(6))

    def _gravity_compensation(self, time_s: float, side: str, snapshot: JointSnapshot) -> SEAJointState:
        index, arms, actuators = self._limb_index[side], self._baxter.arms, self._baxter.actuators
        joints, gravity = arms.joints_of(side), snapshot.gravity[index]
        nothing = np.zeros(len(joints))
        acceleration, effort = nothing, arms.commanded_torque[joints]
        model = gravity, gravity, nothing, nothing, 0.0
        if actuators is not None:
            acceleration, effort = arms.commanded_acceleration[joints], effort + actuators.added[joints]
            # What the springs beside the actuators carry is told with the hysteresis. s1's has the largest share.
            known = actuators.known_counterbalance(snapshot.position[self._arm_index])
            hysteresis = (known + actuators.hysteresis)[joints]
            model = (gravity + hysteresis, gravity, hysteresis, nothing,
                     actuators.hysteresis_share[joints[SPRING_JOINT]])
        return convert.sea_joint_state(
            time_s, BASE_FRAME, self._chains[side].joint_names,
            (arms.commanded_position[joints], arms.commanded_velocity[joints], acceleration, effort),
            tuple(values[index] for values in snapshot.sensed), model)

    def _reference_joint_states(self, time_s: float, component: None, snapshot: JointSnapshot) -> JointState:
        arms, order = self._baxter.arms, self._order
        return self._reference_message.message(
            time_s, arms.commanded_position[order], arms.commanded_velocity[order], arms.commanded_torque[order])

    def _position_state(self, time_s: float, limb_joint: tuple[str, str],
                        snapshot: JointSnapshot) -> JointControllerState:
        return self._controller_state(time_s, limb_joint, self._baxter.arms.commanded_position, snapshot, 0)

    def _velocity_state(self, time_s: float, limb_joint: tuple[str, str],
                        snapshot: JointSnapshot) -> JointControllerState:
        return self._controller_state(time_s, limb_joint, self._baxter.arms.commanded_velocity, snapshot, 1)

    def _controller_state(self, time_s: float, limb_joint: tuple[str, str], set_points: np.ndarray,
                          snapshot: JointSnapshot, quantity: int) -> JointControllerState:
        side = limb_joint[0]
        place, arms = self._chains[side].joint_names.index("%s_%s" % limb_joint), self._baxter.arms
        index = self._limb_index[side][place]
        return convert.joint_controller_state(
            time_s, set_points[arms.joints_of(side)[place]], snapshot.sensed[quantity][index],
            snapshot.sensed[2][index], arms.dt)

    # -- in

    def _speed_ratio(self, side: str, msg: Float64, time_s: float) -> None:
        self._baxter.arms.set_speed_ratio(side, msg.data)

    def _timeout(self, side: str, msg: Float64, time_s: float) -> None:
        self._baxter.arms.set_timeout(side, msg.data)

    def _feed_forward(self, side: str, msg: JointTrajectoryPoint, time_s: float) -> None:
        if not msg.velocities and len(msg.positions) == len(self._baxter.arms.joints_of(side)):
            return  # a set-point alone: nothing to feed forward
        self._baxter.arms.feed_forward(side, np.array(msg.velocities))

    def _twist(self, side: str, msg: TwistStamped, time_s: float) -> None:
        chain, joints = self._chains[side], self._baxter.arms.joints_of(side)
        pose, jacobian = chain.fk_and_jacobian(self._baxter.measured.position[joints])
        linear, angular = msg.twist.linear, msg.twist.angular
        twist = np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        # Old names of tf begin with a slash; a slash alone is not a name.
        frame = msg.header.frame_id.removeprefix("/")
        if frame == tip_of(side):
            twist = np.concatenate([pose[:3, :3] @ twist[:3], pose[:3, :3] @ twist[3:]])
        elif msg.header.frame_id and frame != BASE_FRAME:
            raise CommandRefused("twist in frame '%s'; it must be in %s or %s"
                                 % (msg.header.frame_id, BASE_FRAME, tip_of(side)))
        if not np.isfinite(twist).all():
            raise CommandRefused("twist is %s; it must be finite numbers" % twist.tolist())
        self._baxter.command(side, Mode.VELOCITY, chain.joint_names,
                             endpoint.joint_velocities(jacobian, twist).tolist())

    def _stop(self, side: str, msg: Bool, time_s: float) -> None:
        self._baxter.state.require_enabled()
        if msg.data:
            self._baxter.arms.stop_limb(side)

    def joint_command(self, side: str, msg: JointCommand, time_s: float) -> None:
        """Take one JointCommand message."""
        try:
            command = self._baxter.command(side, msg.mode, msg.names, msg.command)
        except CommandRefused as refusal:
            kind = (side, self._baxter.state.enabled)
            self._warnings.warn(time_s, kind, "%s limb: joint command ignored: %s" % (side, refusal))
            command = None
        for observe in self.command_observers:
            observe(side, msg, command)
        if command is not None and command.clamped:
            self._warnings.warn(time_s, (side, "clamped"), "%s limb: joint command clamped to the limits: %s" % (
                side, ", ".join(command.clamped)))

    TOPICS = (
        TopicRow("endpoint_state", "limb/{limb}/endpoint_state", "baxter_core_msgs/EndpointState", STATE_RATE_HZ,
                 _endpoint_state, "`<limb>_gripper` in `base`: pose, twist (Jacobian times joint velocity), "
                 "wrench that the surroundings exert on the tip"),
        TopicRow("gravity_compensation_torques", "limb/{limb}/gravity_compensation_torques",
                 "baxter_core_msgs/SEAJointState", STATE_RATE_HZ, _gravity_compensation,
                 "per joint, torso to wrist: set-points, measured state, torque that balances gravity; with the effect "
                 "`lag` also what the controller adds, and the spring and the hysteresis in the effort"),
        TopicRow("ref_joint_states", "ref_joint_states", "sensor_msgs/JointState", JOINT_STATE_RATE,
                 _reference_joint_states,
                 "set-points of the arms' joints, in alphabetical order; effort is what torque mode adds to gravity"),
        TopicRow("commanded_endpoint_state", "limb/{limb}/commanded_endpoint_state", "baxter_core_msgs/EndpointState",
                 STATE_RATE_HZ, _commanded_endpoint, "the end point where the set-points are; no wrench is commanded"),
        TopicRow("joint_command", "limb/{limb}/joint_command", "baxter_core_msgs/JointCommand", None, joint_command,
                 "any subset of the limb's joints in any order; mode 1 position, 2 velocity, 3 torque, 4 raw position"),
        TopicRow("set_speed_ratio", "limb/{limb}/set_speed_ratio", "std_msgs/Float64", None, _speed_ratio,
                 "0 to 1: position mode's share of the joints' velocity limits"),
        TopicRow("joint_command_timeout", "limb/{limb}/joint_command_timeout", "std_msgs/Float64", None, _timeout,
                 "[s] > 0, 0.2 at start: age at which a velocity, torque or raw position command expires"),
        TopicRow("inverse_dynamics_command", "limb/{limb}/inverse_dynamics_command",
                 "trajectory_msgs/JointTrajectoryPoint", None, _feed_forward,
                 "velocities (s0 to w2) of the raw set-points that come in with it: they are followed without lag"),
        TopicRow("command_twist_stamped", "limb/{limb}/command_twist_stamped", "geometry_msgs/TwistStamped", None,
                 _twist,
                 "velocity of the tip in `base` (or no frame) or in `<limb>_gripper`; expires like a joint velocity "
                 "command"),
        TopicRow("command_velocity_tozero", "limb/{limb}/command_velocity_tozero", "std_msgs/Bool", None, _stop,
                 "true stops the limb, which then holds"),
        *(TopicRow(key, "{limb}_%s/joints/{limb}_{joint}_controller/command" % key, "std_msgs/Float64", None,
                   _single(mode),
                   "%s, as a joint command with this joint alone: for programs made for the vendor's simulator"
                   % meaning)
          for key, (mode, meaning) in CONTROLLERS.items()),
        *(TopicRow(key + "_state", "{limb}_%s/joints/{limb}_{joint}_controller/state" % key,
                   "control_msgs/JointControllerState", STATE_RATE_HZ, function,
                   "set-point, measured value, error [%s] and effort [Nm] in any mode; gains are 0: for programs made "
                   "for the vendor's simulator" % unit)
          for key, unit, function in (("joint_position_controller", "rad", _position_state),
                                      ("joint_velocity_controller", "rad/s", _velocity_state))),
    )
