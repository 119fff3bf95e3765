# SPDX-License-Identifier: BSD-3-Clause
"""Tells which messages may move an arm, by the rules of docs/interface.md. No ROS needed."""
import math
import re

from baxter_model import SIDES, joint_names

MODES = (1, 2, 3, 4)
_LIMB = re.compile(r"/robot/limb/(left|right)/(\w+)$")
# Topics for single joints as in the vendor's simulator, and for procedures that move an arm; the field with the
# command.
_JOINT = re.compile(r"/robot/\w+_joint_\w+_controller/joints/\w+/command$")
_PROCEDURE = re.compile(r"/robustcontroller/\w+/\w+/enable$")
# These never command the arms. Changing, restarting or pausing the world is a separate case.
_WORLD = re.compile(r"^/gazebo/|/goal$|^/robot/sim/|^/robot/set_super_|/set_(parameters|physics)")


def is_refused(side, value):
    """Whether a baxter_core_msgs/JointCommand must be refused as a whole, or is empty."""
    names, command = value["names"], value["command"]
    known = set(joint_names(side))
    return (value["mode"] not in MODES or len(names) != len(command) or len(set(names)) != len(names)
            or not set(names) <= known or not all(map(math.isfinite, command)) or not names)


def may_move(name, value, style):
    """Whether a message or request may move an arm, judged from its content.

    name: of the topic or service; value: the message, None if it cannot be decoded; style: "damaged" if its bytes
    differ from value.
    """
    if _WORLD.search(name):
        return True
    if _JOINT.match(name):
        return style == "damaged" or value is None or math.isfinite(value["data"])
    if _PROCEDURE.match(name):
        return style == "damaged" or value is None or bool(value["isEnabled"])
    limb = _LIMB.match(name)
    if limb is None:
        return False
    side, what = limb.groups()
    if what not in ("joint_command", "command_twist_stamped"):
        return False
    if style == "damaged" or value is None:
        return True
    if what == "joint_command":
        return not is_refused(side, value)
    twist = value["twist"]
    if value["header"]["frame_id"] not in ("", "base", "/base", "%s_gripper" % side, "/%s_gripper" % side):
        return False
    return all(math.isfinite(twist[part][axis]) for part in ("linear", "angular") for axis in "xyz")


# Values that make sense, by the name of their field.
WORDS = {
    "names": tuple(name for side in SIDES for name in joint_names(side)),
    "mode": MODES,
    "frame_id": ("base", "", "left_gripper", "world"),
    "model_name": ("torture_box", "ground_plane", "nobody"),
    "link_name": ("torture_box::link", "baxter::left_hand", "nobody"),
    "body_name": ("torture_box::link", "nobody"),
    "joint_name": ("left_s0", "nobody"),
    "reference_frame": ("world", "", "nobody"),
    "command": ("go", "grip", "release", "calibrate", "configure", "set", "stop", "reset", "reboot", "no_op"),
    "sender": ("/torture",),
    "args": ("{}", '{"position": 50.0}', '{"velocity": 50.0, "moving_force": 40}', '{"grip_attempt_seconds": 1}'),
    "name": ("torso_left_outer_light", "torso_fan", "left_hand_camera", "head_camera"),
    "encoding": ("rgb8", "bgr8", "mono8", "16UC1"),
    "model_xml": ("<robot name='torture_box'><link name='link'><inertial><mass value='1'/><inertia ixx='1' ixy='0'"
                  " ixz='0' iyy='1' iyz='0' izz='1'/></inertial><collision><geometry><box size='.1 .1 .1'/></geometry>"
                  "</collision></link></robot>",),
    "urdf": ("<robot name='piece'><link name='piece'/></robot>",),
    "*": ("", "left", "torture"),
}
