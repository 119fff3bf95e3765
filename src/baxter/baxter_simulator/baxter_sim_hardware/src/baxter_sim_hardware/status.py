# SPDX-License-Identifier: BSD-3-Clause
"""What the robot says of itself as a whole: assemblies, set-points, diagnostics, description; and odd limb commands."""
from xml.etree import ElementTree

from .errors import CommandRefused
from .robot_state import State
from .topics.row import JOINT_STATE_RATE, LATCHED, STATE_RATE_HZ, Topic

DIAGNOSTICS_RATE_HZ = 1.0
OK, WARN, ERROR = 0, 1, 2  # levels of a DiagnosticStatus

STATUS_TOPICS = (
    Topic("assembly_state", "assembly/{assembly}/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ,
          "the same as `state`: assemblies are enabled and stopped together"),
    Topic("limb_state", "limb/{limb}/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ, "the same for the limb"),
    Topic("head_assembly_state", "head/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ,
          "the same for the head"),
    Topic("ref_joint_states", "ref_joint_states", "sensor_msgs/JointState", JOINT_STATE_RATE,
          "set-points of the arms' joints, in alphabetical order; effort is what torque mode adds to gravity"),
    Topic("commanded_endpoint_state", "limb/{limb}/commanded_endpoint_state", "baxter_core_msgs/EndpointState",
          STATE_RATE_HZ, "the end point where the set-points are; no wrench is commanded"),
    Topic("inverse_dynamics_command", "limb/{limb}/inverse_dynamics_command", "trajectory_msgs/JointTrajectoryPoint",
          None, "velocities (s0 to w2) of the raw set-points that come in with it: they are followed without lag"),
    Topic("command_twist_stamped", "limb/{limb}/command_twist_stamped", "geometry_msgs/TwistStamped", None,
          "velocity of the tip in `base` (or no frame) or in `<limb>_gripper`; expires like a joint velocity command"),
    Topic("command_velocity_tozero", "limb/{limb}/command_velocity_tozero", "std_msgs/Bool", None,
          "true stops the limb, which then holds"),
    Topic("urdf", "urdf", "baxter_core_msgs/URDFConfiguration", LATCHED,
          "the robot's description; after a fragment was accepted, that fragment"),
    Topic("urdf_fragment", "urdf", "baxter_core_msgs/URDFConfiguration", None,
          "a fragment to hang on a link of the robot: checked and passed on; it weighs nothing here"),
    Topic("diagnostics", "/diagnostics", "diagnostic_msgs/DiagnosticArray", DIAGNOSTICS_RATE_HZ,
          "robot state and, for each arm, mode, speed ratio, time-out, largest torque"),
    Topic("diagnostics_agg", "/diagnostics_agg", "diagnostic_msgs/DiagnosticArray", DIAGNOSTICS_RATE_HZ,
          "the same below `/Baxter`, which has the worst level of all"),
    Topic("diagnostics_toplevel_state", "/diagnostics_toplevel_state", "diagnostic_msgs/DiagnosticStatus",
          DIAGNOSTICS_RATE_HZ, "the worst level of all"),
)


def level_of(state):
    """(level, text) of a robot_state.State: a stopped robot needs somebody."""
    return (OK if state in (State.ENABLED, State.DISABLED) else ERROR), state.value


def check_fragment(link, joint, xml, links):
    """Raises CommandRefused unless `xml` is a robot description and `link` one of the robot's links."""
    if link not in links:
        raise CommandRefused("urdf fragment for link '%s'; it must name one of the robot's links" % link)
    if not joint:
        raise CommandRefused("urdf fragment names no joint; it must name the one that will hold it")
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise CommandRefused("urdf fragment is no XML: %s" % error) from None
    if root.tag != "robot" or root.find("link") is None:
        raise CommandRefused("urdf fragment is <%s>; it must be a <robot> with a link" % root.tag)
