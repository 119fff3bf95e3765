# SPDX-License-Identifier: BSD-3-Clause
"""The robot's diagnostics and its description, as ROS messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from baxter_core_msgs.msg import URDFConfiguration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from baxter_sim_hardware import status
from baxter_sim_hardware.arms.joint_command import Mode
from sim_time.stamps import stamp

from .row import LATCHED, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from baxter_sim_hardware.robot import BaxterHardware
    from baxter_sim_hardware.snapshot import JointSnapshot
    from loop_ros.protocol import Log, Publisher

DIAGNOSTICS_RATE_HZ = 1.0
AGGREGATE = "/Baxter"


class StatusTopics(RobotPart):
    """baxter: `robot.BaxterHardware`; limb_index: {side: (7,) indices of its joints in the model's}; links: names of
    the robot's; urdf_xml: its description; log: of the plugin's context."""

    _urdf: Publisher  # from `_begin_urdf` on, before any message

    def __init__(self, baxter: BaxterHardware, limb_index: Mapping[str, np.ndarray], links: Collection[str],
                 urdf_xml: str, log: Log) -> None:
        self._baxter, self._limb_index = baxter, limb_index
        self._links, self._urdf_xml, self._log = links, urdf_xml, log
        self._fragment_time = None

    def _statuses(self, snapshot: JointSnapshot) -> list[DiagnosticStatus]:
        arms = self._baxter.arms
        level, text = status.level_of(self._baxter.state.state)
        statuses = [DiagnosticStatus(level, "state", text, "baxter", [])]
        for side in arms.sides:
            modes = sorted({Mode(mode).name for mode in arms.modes(side)})
            efforts = np.abs(snapshot.effort[self._limb_index[side]])
            values = {"modes": " ".join(modes), "speed ratio": "%g" % arms.speed_ratio(side),
                      "command time-out [s]": "%g" % arms.timeout(side),
                      "largest torque [Nm]": "%.1f" % efforts.max()}
            statuses.append(DiagnosticStatus(status.OK, side + " arm", "running", "baxter",
                                             [KeyValue(key, value) for key, value in values.items()]))
        return statuses

    def _diagnostics(self, time_s: float, component: None, snapshot: JointSnapshot) -> DiagnosticArray:
        return _array(time_s, self._statuses(snapshot))

    def _aggregate(self, time_s: float, component: None, snapshot: JointSnapshot) -> DiagnosticArray:
        statuses = self._statuses(snapshot)
        top = _worst(AGGREGATE, statuses)
        for each in statuses:
            each.name = "%s/%s" % (AGGREGATE, each.name)
        return _array(time_s, [top, *statuses])

    def _toplevel(self, time_s: float, component: None, snapshot: JointSnapshot) -> DiagnosticStatus:
        return _worst("toplevel_state", self._statuses(snapshot))

    def _begin_urdf(self, publisher: Publisher) -> None:
        self._urdf = publisher
        publisher.publish(URDFConfiguration(urdf=self._urdf_xml))

    def _take_fragment(self, component: None, msg: URDFConfiguration, time_s: float) -> None:
        if not (msg.link or msg.joint):
            return  # the description that the robot itself publishes on this topic
        status.check_fragment(msg.link, msg.joint, msg.urdf, self._links)
        # A new time means a new fragment; the robot receives its own message again, with the same time.
        if self._fragment_time == msg.time:
            return
        self._fragment_time = msg.time
        self._urdf.publish(msg)
        self._log.info("urdf fragment on link '%s' is passed on; it weighs nothing here" % msg.link)

    TOPICS = (
        TopicRow("urdf", "urdf", "baxter_core_msgs/URDFConfiguration", LATCHED, _begin_urdf,
                 "the robot's description; after a fragment was accepted, that fragment"),
        TopicRow("urdf_fragment", "urdf", "baxter_core_msgs/URDFConfiguration", None, _take_fragment,
                 "a fragment to hang on a link of the robot: checked and passed on; it weighs nothing here"),
        TopicRow("diagnostics", "/diagnostics", "diagnostic_msgs/DiagnosticArray", DIAGNOSTICS_RATE_HZ, _diagnostics,
                 "robot state and, for each arm, mode, speed ratio, time-out, largest torque"),
        TopicRow("diagnostics_agg", "/diagnostics_agg", "diagnostic_msgs/DiagnosticArray", DIAGNOSTICS_RATE_HZ,
                 _aggregate, "the same below `/Baxter`, which has the worst level of all"),
        TopicRow("diagnostics_toplevel_state", "/diagnostics_toplevel_state", "diagnostic_msgs/DiagnosticStatus",
                 DIAGNOSTICS_RATE_HZ, _toplevel, "the worst level of all"),
    )


def _worst(name: str, statuses: list[DiagnosticStatus]) -> DiagnosticStatus:
    worst = max(statuses, key=lambda each: each.level)
    return DiagnosticStatus(worst.level, name, worst.message, "baxter", [])


def _array(time_s: float, statuses: list[DiagnosticStatus]) -> DiagnosticArray:
    return DiagnosticArray(Header(stamp=stamp(time_s)), statuses)
