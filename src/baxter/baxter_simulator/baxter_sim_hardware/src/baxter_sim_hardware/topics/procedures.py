# SPDX-License-Identifier: BSD-3-Clause
"""Maintenance procedures and the updater as ROS sees them."""
from baxter_core_msgs.msg import RobustControllerStatus
from baxter_maintenance_msgs.msg import UpdateSources, UpdateStatus
from std_msgs.msg import Bool, Int32

from baxter_model import SIDES
from baxter_sim_hardware.arms.procedures import PROCEDURES, STATUS_RATE_HZ, Procedure, Updater
from baxter_sim_hardware.errors import CommandRefused
from sim_time.pace import Schedule


class ProcedureTopics:
    """makers and takers: as in PanelTopics. state: the robot's RobotState."""

    def __init__(self, state):
        self._state = state
        self._procedures = {(name, side): Procedure() for name in PROCEDURES for side in SIDES}
        self._updater = Updater()
        self._schedule = Schedule(STATUS_RATE_HZ)
        updater = self._updater
        self.makers = {
            **{"procedure_status_" + name: self._status(name) for name in PROCEDURES},
            "plugins_loaded": lambda time_s, side, _: Bool(True),
            "update_sources": lambda time_s, part, _: UpdateSources("", []),
            "usb_ready": lambda time_s, part, _: Bool(False),
            "updater_status": lambda time_s, part, _: UpdateStatus(updater.status, 0.0, updater.description),
            "update_status": lambda time_s, part, _: Int32(updater.status),
            "update_progress": lambda time_s, part, _: Int32(0),
        }
        self.takers = {
            **{"procedure_enable_" + name: self._take(name) for name in PROCEDURES},
            "updater_start": self._start_update,
            "updater_stop": lambda part, msg, time_s: updater.reset(),
        }

    def reset(self):
        for procedure in self._procedures.values():
            procedure.reset()
        self._updater.reset()

    def update(self, time_s, feel):
        """After a step: let procedures go on. feel: function(side) -> (7,) torques from outside [Nm], which costs."""
        if not self._schedule.due(time_s):
            return
        for (_, side), procedure in self._procedures.items():
            if procedure.is_enabled:
                procedure.update(time_s, self._state.enabled, feel(side))

    def _status(self, name):
        def make(time_s, side, snapshot):
            procedure = self._procedures[name, side]
            return RobustControllerStatus(procedure.is_enabled, procedure.complete, procedure.uid, procedure.timed_out,
                                          list(procedure.errors), [])
        return make

    def _take(self, name):
        return lambda side, msg, time_s: self._procedures[name, side].take(msg.isEnabled, msg.uid, time_s)

    def _start_update(self, part, msg, time_s):
        self._updater.start(msg.data)
        raise CommandRefused(self._updater.description)
