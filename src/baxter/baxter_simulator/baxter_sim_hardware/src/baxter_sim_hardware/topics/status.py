# SPDX-License-Identifier: BSD-3-Clause
"""What the robot says of itself as a whole, and the limb commands beside joint_command, as ROS messages."""
import numpy as np
from baxter_core_msgs.msg import URDFConfiguration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from baxter_model import BASE_FRAME, tip_of
from baxter_model.readiness import NOT_ENABLED
from baxter_sim_hardware import status
from baxter_sim_hardware.arms import endpoint
from baxter_sim_hardware.arms.joint_command import Mode
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.topics import convert
from sim_time.stamps import stamp

AGGREGATE = "/Baxter"


class StatusTopics:
    """makers and takers: as in PanelTopics; latched: {key: function(publisher) that publishes what is known now}.

    baxter: `robot.Baxter`; chains: {side: Chain}; joints: function -> (position, velocity) of the arms, (n,) measured;
    links: names of the robot's; urdf_xml: its description; log: of the plugin's context.
    """

    def __init__(self, baxter, chains, joints, links, urdf_xml, log):
        self._baxter, self._chains, self._joints = baxter, chains, joints
        self._links, self._urdf_xml, self._log = links, urdf_xml, log
        self._urdf = self._fragment_time = None
        names = np.array(baxter.arms.limits.names)
        self._order = np.argsort(names)
        self._messages = convert.JointStates(names[self._order].tolist())
        self.makers = {
            **dict.fromkeys(("assembly_state", "limb_state", "head_assembly_state"), self._assembly),
            "ref_joint_states": self._ref_joint_states,
            "commanded_endpoint_state": self._commanded_endpoint,
            "diagnostics": lambda time_s, part, snapshot: self._array(time_s, self._statuses(snapshot)),
            "diagnostics_agg": self._aggregate,
            "diagnostics_toplevel_state": lambda time_s, part, snapshot: self._worst(
                "toplevel_state", self._statuses(snapshot)),
        }
        self.takers = {
            "inverse_dynamics_command": self._feed_forward,
            "command_twist_stamped": self._twist,
            "command_velocity_tozero": self._stop_limb,
            "urdf_fragment": self._take_fragment,
        }
        self.latched = {"urdf": self._publish_urdf}

    # -- out

    def _assembly(self, time_s, part, snapshot):
        return convert.assembly_state(self._baxter.state.assembly)

    def _ref_joint_states(self, time_s, part, snapshot):
        arms, order = self._baxter.arms, self._order
        return self._messages.message(
            time_s, arms.commanded_position[order], arms.commanded_velocity[order], arms.commanded_torque[order])

    def _commanded_endpoint(self, time_s, side, snapshot):
        arms = self._baxter.arms
        joints = arms.joints_of(side)
        pose, jacobian = self._chains[side].fk_and_jacobian(arms.commanded_position[joints])
        return convert.endpoint_state(time_s, BASE_FRAME, pose,
                                      endpoint.twist(jacobian, arms.commanded_velocity[joints]), np.zeros(6))

    def _statuses(self, snapshot):
        arms = self._baxter.arms
        level, text = status.level_of(self._baxter.state.state)
        statuses = [DiagnosticStatus(level, "state", text, "baxter", [])]
        for side in arms.sides:
            modes = sorted({Mode(mode).name for mode in arms.modes(side)})
            efforts = np.abs(snapshot.effort[snapshot.arm_index[arms.joints_of(side)]])
            values = {"modes": " ".join(modes), "speed ratio": "%g" % arms.speed_ratio(side),
                      "command time-out [s]": "%g" % arms.timeout(side),
                      "largest torque [Nm]": "%.1f" % efforts.max()}
            statuses.append(DiagnosticStatus(status.OK, side + " arm", "running", "baxter",
                                             [KeyValue(key, value) for key, value in values.items()]))
        return statuses

    def _aggregate(self, time_s, part, snapshot):
        statuses = self._statuses(snapshot)
        top = self._worst(AGGREGATE, statuses)
        for each in statuses:
            each.name = "%s/%s" % (AGGREGATE, each.name)
        return self._array(time_s, [top, *statuses])

    @staticmethod
    def _worst(name, statuses):
        worst = max(statuses, key=lambda each: each.level)
        return DiagnosticStatus(worst.level, name, worst.message, "baxter", [])

    @staticmethod
    def _array(time_s, statuses):
        return DiagnosticArray(Header(stamp=stamp(time_s)), statuses)

    def _publish_urdf(self, publisher):
        self._urdf = publisher
        publisher.publish(URDFConfiguration(urdf=self._urdf_xml))

    # -- in

    def _feed_forward(self, side, msg, time_s):
        if not msg.velocities and len(msg.positions) == len(self._baxter.arms.joints_of(side)):
            return  # a set-point alone: nothing to feed forward
        self._baxter.arms.feed_forward(side, np.array(msg.velocities), time_s)

    def _twist(self, side, msg, time_s):
        position, velocity = self._joints()
        chain, joints = self._chains[side], self._baxter.arms.joints_of(side)
        pose, jacobian = chain.fk_and_jacobian(position[joints])
        linear, angular = msg.twist.linear, msg.twist.angular
        twist = np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        # tf's old names begin with a slash; a slash alone names nothing.
        frame = msg.header.frame_id.removeprefix("/")
        if frame == tip_of(side):
            twist = np.concatenate([pose[:3, :3] @ twist[:3], pose[:3, :3] @ twist[3:]])
        elif msg.header.frame_id and frame != BASE_FRAME:
            raise CommandRefused("twist in frame '%s'; it must be in %s or %s"
                                 % (msg.header.frame_id, BASE_FRAME, tip_of(side)))
        if not np.isfinite(twist).all():
            raise CommandRefused("twist is %s; it must be finite numbers" % twist.tolist())
        self._baxter.command(side, Mode.VELOCITY, chain.joint_names,
                             endpoint.joint_velocities(jacobian, twist).tolist(), time_s, position, velocity)

    def _stop_limb(self, side, msg, time_s):
        if not self._baxter.state.enabled:
            raise CommandRefused(NOT_ENABLED)
        if msg.data:
            self._baxter.arms.stop_limb(side, *self._joints())

    def _take_fragment(self, part, msg, time_s):
        if not (msg.link or msg.joint):
            return  # the description that the robot itself publishes on this topic
        status.check_fragment(msg.link, msg.joint, msg.urdf, self._links)
        # A new time means a new fragment; what the robot passed on comes back to it with the same time.
        if self._fragment_time == msg.time:
            return
        self._fragment_time = msg.time
        self._urdf.publish(msg)
        self._log.info("urdf fragment on link '%s' is passed on; it weighs nothing here" % msg.link)
