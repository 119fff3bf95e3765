# SPDX-License-Identifier: BSD-3-Clause
"""ROS interface of the maintenance procedures and the updater."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from baxter_core_msgs.msg import RobustControllerStatus
from baxter_maintenance_msgs.msg import UpdateSources, UpdateStatus
from std_msgs.msg import Bool, Int32

from baxter_model import SIDES, joint_names
from baxter_sim_hardware.arms.joint_command import Mode
from baxter_sim_hardware.arms.procedures import (
    PROCEDURES,
    STATUS_RATE_HZ,
    Order,
    Procedure,
    ProcedureArm,
    RefusingUpdater,
    postures,
)
from baxter_sim_hardware.errors import CommandRefused
from sim_time.pace import Schedule

from .row import RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from std_msgs.msg import Empty, String

    from baxter_sim_hardware.robot import BaxterHardware
    from baxter_sim_hardware.snapshot import JointSnapshot
    from baxter_sim_hardware.warnings import Warnings

UPDATER_RATE_HZ = 1.0
TYPES = {"Tare": "TareEnable", "CalibrateArm": "CalibrateArmEnable"}  # messages that ask for PROCEDURES


def _status_of(name: str) -> Callable[[ProcedureTopics, float, str, JointSnapshot], RobustControllerStatus]:
    def status(part, time_s, side, snapshot):
        procedure = part.procedures[name, side]
        return RobustControllerStatus(procedure.is_enabled, procedure.complete, procedure.uid, procedure.timed_out,
                                      list(procedure.errors), [])

    return status


def _take(name: str) -> Callable[[ProcedureTopics, str, Any, float], None]:
    def handle(part, side, msg, time_s):
        part.procedures[name, side].take(msg.isEnabled, msg.uid, time_s)

    return handle


class ProcedureTopics(RobotPart):
    """baxter: `robot.BaxterHardware`; warnings: `warnings.Warnings`."""

    def __init__(self, baxter: BaxterHardware, warnings: Warnings) -> None:
        self._baxter, self._warnings = baxter, warnings
        self.procedures = {(name, side): Procedure(postures(name, side)) for name in PROCEDURES for side in SIDES}
        self._updater = RefusingUpdater()
        self._schedule = Schedule(STATUS_RATE_HZ)

    def reset(self) -> None:
        for procedure in self.procedures.values():
            procedure.reset()
        self._updater.reset()

    def update(self, time_s: float, feel: Callable[[str], np.ndarray]) -> None:
        """After a step: continue the procedures. feel: function(side) -> (7,) external torques [Nm]; it is
        expensive."""
        if not self._schedule.due(time_s):
            return
        for (name, side), procedure in self.procedures.items():
            if procedure.is_active:
                self._update(name, side, procedure, time_s, feel)

    def _update(self, name: str, side: str, procedure: Procedure, time_s: float,
                feel: Callable[[str], np.ndarray]) -> None:
        baxter = self._baxter
        own = baxter.arms.joints_of(side)
        arm = ProcedureArm(baxter.measured.position[own], baxter.measured.velocity[own], feel(side))
        order = procedure.update(time_s, baxter.state.enabled, arm)
        try:
            if order is Order.STOP:
                baxter.arms.stop_limb(side)
            elif order is not Order.NOTHING:
                baxter.command(side, Mode.POSITION, joint_names(side), order.tolist())
        except CommandRefused as refusal:
            self._warnings.warn(time_s, (name, side), "%s of the %s arm: %s" % (name, side, refusal))

    def _start_update(self, component: None, msg: String, time_s: float) -> None:
        self._updater.start(msg.data)
        raise CommandRefused(self._updater.description)

    def _stop_update(self, component: None, msg: Empty, time_s: float) -> None:
        self._updater.reset()

    def _plugins_loaded(self, time_s: float, side: str, snapshot: JointSnapshot) -> Bool:
        return Bool(True)

    def _update_sources(self, time_s: float, component: None, snapshot: JointSnapshot) -> UpdateSources:
        return UpdateSources("", [])

    def _usb_ready(self, time_s: float, component: None, snapshot: JointSnapshot) -> Bool:
        return Bool(False)

    def _updater_status(self, time_s: float, component: None, snapshot: JointSnapshot) -> UpdateStatus:
        return UpdateStatus(self._updater.status, 0.0, self._updater.description)

    def _update_status(self, time_s: float, component: None, snapshot: JointSnapshot) -> Int32:
        return Int32(self._updater.status)

    def _update_progress(self, time_s: float, component: None, snapshot: JointSnapshot) -> Int32:
        return Int32(0)

    TOPICS = (
        *(TopicRow("procedure_status_" + name, "/robustcontroller/{limb}/%s/status" % name,
                   "baxter_core_msgs/RobustControllerStatus", STATUS_RATE_HZ, _status_of(name),
                   "how the procedure that %s the arm is getting on" % verb) for name, (verb, _) in PROCEDURES.items()),
        TopicRow("plugins_loaded", "/robustcontroller/{limb}/rc_plugins_loaded", "std_msgs/Bool", UPDATER_RATE_HZ,
                 _plugins_loaded, "true"),
        TopicRow("update_sources", "/usb/update_sources", "baxter_maintenance_msgs/UpdateSources", UPDATER_RATE_HZ,
                 _update_sources,
                 "none: no stick is plugged into a simulated robot"),
        TopicRow("usb_ready", "/usb/ready", "std_msgs/Bool", UPDATER_RATE_HZ, _usb_ready, "false: no stick"),
        TopicRow("updater_status", "/updater/status", "baxter_maintenance_msgs/UpdateStatus", UPDATER_RATE_HZ,
                 _updater_status,
                 "idle, or invalid after an unknown update was to be started"),
        TopicRow("update_status", "/update/status", "std_msgs/Int32", UPDATER_RATE_HZ,
                 _update_status, "the same as a number"),
        TopicRow("update_progress", "/update/progress", "std_msgs/Int32", UPDATER_RATE_HZ, _update_progress, "0 %"),
        *(TopicRow("procedure_enable_" + name, "/robustcontroller/{limb}/%s/enable" % name,
                   "baxter_maintenance_msgs/" + TYPES[name], None, _take(name),
                   "starts and keeps alive (at least once in 1.5 s) or ends the procedure that %s the arm" % verb)
          for name, (verb, _) in PROCEDURES.items()),
        TopicRow("updater_start", "/updater/start", "std_msgs/String", None,
                 _start_update, "starts an update by its id; none is known"),
        TopicRow("updater_stop", "/updater/stop", "std_msgs/Empty", None, _stop_update, "back to idle"),
    )
