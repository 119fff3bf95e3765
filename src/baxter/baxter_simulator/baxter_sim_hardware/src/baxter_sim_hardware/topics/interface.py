# SPDX-License-Identifier: BSD-3-Clause
"""The robot's ROS interface as one table: what the plugin opens, what the documentation lists, what tests expect."""
from baxter_sim_hardware.arms.collision import COLLISION_TOPICS
from baxter_sim_hardware.arms.procedures import MAINTENANCE_TOPICS
from baxter_sim_hardware.screen import SCREEN_TOPICS
from baxter_sim_hardware.sensing.sensors import SENSOR_TOPICS
from baxter_sim_hardware.status import STATUS_TOPICS

from .row import JOINT_STATE_RATE, LATCHED, PARTS, STATE_RATE_HZ, Topic

JOINT_STATE_RATE_HZ = 50.0  # what the vendor's simulator publishes and the lab sheets print


TOPICS = (
    Topic("joint_states", "joint_states", "sensor_msgs/JointState", JOINT_STATE_RATE,
          "all movable joints, names in alphabetical order [rad, m; rad/s, m/s; Nm, N]; "
          "15 without grippers, 19 with two electric ones"),
    Topic("state", "state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ,
          "enabled, stopped, ready, emergency stop"),
    Topic("endpoint_state", "limb/{limb}/endpoint_state", "baxter_core_msgs/EndpointState", STATE_RATE_HZ,
          "`<limb>_gripper` in `base`: pose, twist (Jacobian times joint velocity), "
          "wrench that the surroundings exert on the tip"),
    Topic("gravity_compensation_torques", "limb/{limb}/gravity_compensation_torques",
          "baxter_core_msgs/SEAJointState", STATE_RATE_HZ,
          "per joint, torso to wrist: set-points, measured state, torque that balances gravity"),
    Topic("digital_io", "digital_io/{digital}/state", "baxter_core_msgs/DigitalIOState", STATE_RATE_HZ,
          "one button, light, ... : 0 or 1, and whether it is an input; `<limb>_suck` and `<limb>_blow` are the valves "
          "of a suction gripper"),
    Topic("digital_io_states", "digital_io_states", "baxter_core_msgs/DigitalIOStates", STATE_RATE_HZ,
          "all of them"),
    Topic("analog_io", "analog_io/{analog}/state", "baxter_core_msgs/AnalogIOState", STATE_RATE_HZ,
          "one wheel (0 to 255, wraps), hand range [mm], vacuum sensor (0 to 255), or the integer that `torso_fan`, "
          "`torso_lighting` were told"),
    Topic("analog_io_uint32", "analog_io/{analog}/value_uint32", "std_msgs/UInt32", STATE_RATE_HZ,
          "the same value"),
    Topic("analog_io_states", "analog_io_states", "baxter_core_msgs/AnalogIOStates", STATE_RATE_HZ,
          "all of them"),
    Topic("navigator", "navigators/{navigator}_navigator/state", "baxter_core_msgs/NavigatorState", STATE_RATE_HZ,
          "buttons ok, back, show; wheel; lights inner, outer: the same as in digital_io and analog_io"),
    Topic("navigators_states", "navigators_states", "baxter_core_msgs/NavigatorStates", STATE_RATE_HZ,
          "all four"),
    Topic("head_state", "head/head_state", "baxter_core_msgs/HeadState", STATE_RATE_HZ,
          "pan [rad], turning, nodding, panning enabled"),
    Topic("gripper_state", "end_effector/{limb}_gripper/state", "baxter_core_msgs/EndEffectorState", STATE_RATE_HZ,
          "position and force [%], moving, gripping, missed; sender and sequence of the last command; `state` of a "
          "suction gripper is a JSON object: `vacuum sensor` (0 to 255), `vacuum`, `blowing`, `sucking`"),
    Topic("gripper_properties", "end_effector/{limb}_gripper/properties", "baxter_core_msgs/EndEffectorProperties",
          STATE_RATE_HZ, "`ui_type` 1 suction, 2 electric, 3 where the arm carries no gripper; else what "
          "`set_properties` said"),
    Topic("started", "sim/started", "std_msgs/Empty", LATCHED,
          "the robot stands, publishes and listens"),
    Topic("resets", "sim/resets", "std_msgs/UInt32", LATCHED,
          "a number that changes whenever the joints are put elsewhere: by a reset of the world or the simulation, by "
          "set_model_configuration, by another robot in this one's place"),
    Topic("joint_command", "limb/{limb}/joint_command", "baxter_core_msgs/JointCommand", None,
          "any subset of the limb's joints in any order; mode 1 position, 2 velocity, 3 torque, 4 raw position"),
    Topic("joint_command_timeout", "limb/{limb}/joint_command_timeout", "std_msgs/Float64", None,
          "[s] > 0, 0.2 at start: age at which a velocity, torque or raw position command expires"),
    Topic("set_speed_ratio", "limb/{limb}/set_speed_ratio", "std_msgs/Float64", None,
          "0 to 1: position mode's share of the joints' velocity limits"),
    Topic("joint_state_publish_rate", "joint_state_publish_rate", "std_msgs/UInt16", None,
          "[Hz] 1 to 1000: rate of joint_states"),
    Topic("gripper_command", "end_effector/{limb}_gripper/command", "baxter_core_msgs/EndEffectorCommand", None,
          "configure, calibrate, clear_calibration, reset, reboot, go, stop, release, grip, prepare_to_grip, "
          "set, no_op; arguments as a JSON object"),
    Topic("gripper_set_properties", "end_effector/{limb}_gripper/rsdk/set_properties",
          "baxter_core_msgs/EndEffectorProperties", None,
          "what a tool is that only the client knows, on an arm without a gripper"),
    Topic("gripper_set_state", "end_effector/{limb}_gripper/rsdk/set_state", "baxter_core_msgs/EndEffectorState", None,
          "the state of such a tool, which the robot then publishes"),
    Topic("command_head_pan", "head/command_head_pan", "baxter_core_msgs/HeadPanCommand", None,
          "target [rad]; speed ratio of 8.4 rad/s, where 0 means full speed; enable request"),
    Topic("command_head_nod", "head/command_head_nod", "std_msgs/Bool", None, "true begins a nod of 1 s"),
    Topic("digital_io_command", "digital_io/command", "baxter_core_msgs/DigitalOutputCommand", None,
          "switches one digital output, by name"),
    Topic("analog_io_command", "analog_io/command", "baxter_core_msgs/AnalogOutputCommand", None,
          "sets one analog output, by name, 0 to 65535"),
    Topic("set_super_enable", "set_super_enable", "std_msgs/Bool", None, "true enables, false disables"),
    Topic("set_super_stop", "set_super_stop", "std_msgs/Empty", None, "software stop"),
    Topic("set_super_reset", "set_super_reset", "std_msgs/Empty", None, "clears a stop; leaves the robot disabled"),
    *COLLISION_TOPICS,
    *SENSOR_TOPICS,
    *STATUS_TOPICS,
    *SCREEN_TOPICS,
    *MAINTENANCE_TOPICS,
)


def markdown_table(namespace="/robot"):
    """The table as docs/interface.md prints it."""
    lines = ["| Topic | Type | Direction | Rate | Meaning |", "|---|---|---|---|---|"]
    for topic in TOPICS:
        if topic.rate == JOINT_STATE_RATE:
            rate = "%g Hz (`joint_state_rate`)" % JOINT_STATE_RATE_HZ
        elif topic.is_published and topic.rate != LATCHED:
            rate = "%g Hz" % topic.rate
        else:
            rate = topic.rate or "–"
        name = topic.name.format(**{kind: "<%s>" % kind for kind in PARTS})
        lines.append("| `%s` | %s | %s | %s | %s |" % (
            name if name.startswith("/") else "%s/%s" % (namespace, name), topic.type,
            "robot publishes" if topic.is_published else "robot listens", rate, topic.meaning))
    return "\n".join(lines) + "\n"
