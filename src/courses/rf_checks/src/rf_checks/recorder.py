# SPDX-License-Identifier: BSD-3-Clause
"""A model plugin that reports the simulated robot's state to the judge, and steps time only with the judge's consent.

It runs in the simulator's loop and reads joints and contacts directly. It also records the robot's commands, their
nodes, whether they were accepted, and whether anything else moved the joints. None of its data comes from a topic. The
judge listens on a Unix socket in the folder that the environment variable LAB_JUDGE_SOCKETS names. Every RECORD_TICKS
ticks one line of JSON goes out (`Recording` in recording.py reads them), and the loop waits for one line in return:
empty, or an order to reset the robot. This happens at the beginning of a tick, before any other plugin reads its
messages: the program's reaction to the last tick's time and joint states has arrived by then.

The first order withdraws all services and topics that change the world: from then on the simulator only serves those
that read, and nothing but the robot's own interface moves the robot.
"""
from __future__ import annotations

import json
import os
import socket
from typing import TYPE_CHECKING, Any

import rospy
from gazebo_msgs.srv import SetModelConfigurationRequest
from std_srvs.srv import EmptyRequest

from baxter_model import SIDES
from baxter_sim_hardware.plugin import BaxterPlugin
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from rf_checks.recorder_names import RECORDS, REQUESTS, SOCKETS_VARIABLE, changes_the_world

if TYPE_CHECKING:
    from baxter_core_msgs.msg import JointCommand as JointCommandMessage

    from baxter_sim_hardware.arms.joint_command import CheckedCommand
    from gazebo_ros.model_plugin import PluginContext

RECORD_TICKS = 5  # 10 ms of simulation
#: Commands listed in one record; further ones are only counted.
COMMANDS_TOLD = 3
_DATAGRAM_BYTES = 1 << 18
_RESET, _CONFIGURE = "/gazebo/reset_world", "/gazebo/set_model_configuration"


class Recorder(ModelPlugin):
    """See the module."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        folder = os.environ.get(SOCKETS_VARIABLE)
        if not folder:
            raise PluginError("%s is not set; this plugin works for `./baxter.sh check`" % SOCKETS_VARIABLE)
        self._requests = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._requests.bind(os.path.join(folder, REQUESTS))
        self._requests.setblocking(False)
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(os.path.join(folder, RECORDS))
        self._answers = self._socket.makefile("r", encoding="utf-8")
        self._model = context.model
        self._robot: BaxterPlugin | None = None
        self._commands: dict[str, list[list[Any]]] = {side: [] for side in SIDES}
        self._counts: dict[str, int] = dict.fromkeys(SIDES, 0)
        self._accepted: dict[str, int] = dict.fromkeys(SIDES, 0)
        self._placed = 0
        self._is_ordered = False
        self._done = []
        self._handlers = {}
        self._has_judge = True
        self._tell({"joints": list(self._model.joint_names)})

    def update(self, time_s: float, step_s: float) -> None:
        if round(time_s / step_s) % RECORD_TICKS or not self._has_judge:
            return
        self._watch_robot()
        record = {"t": round(time_s, 4), "q": [round(value, 6) for value in self._model.read_joints()[0]],
                  "enabled": self._robot is not None and self._robot.is_enabled, "contacts": self._contacts(),
                  "held": self._robot.held if self._robot is not None else {},
                  "commands": self._take_commands(), "counts": dict(self._counts), "accepted": dict(self._accepted),
                  "placed": self._placed, "ik": self._take_requests(), **self._more()}
        if self._done:
            record["done"] = self._done.pop()
        self._tell(record)
        answer = self._hear()
        if answer:
            self._done.append(self._obey(answer, time_s))

    def _more(self) -> dict[str, Any]:
        """Further entries of a record: a dict."""
        return {}

    def joints_set(self) -> None:
        self._note_placed()

    def reset(self) -> None:
        self._note_placed()

    def close(self) -> None:
        self._requests.close()
        self._socket.close()
        self._has_judge = False

    def _note_placed(self) -> None:
        if not self._is_ordered:
            self._placed += 1

    def _watch_robot(self) -> None:
        """Subscribe to the commands of the robot's plugin, which may be a new object."""
        robot = next((plugin for plugin in self.context.plugins() if isinstance(plugin, BaxterPlugin)), None)
        if robot is not self._robot and robot is not None:
            robot.command_observers.append(self._on_command)
        self._robot = robot

    def _on_command(self, side: str, message: JointCommandMessage, command: CheckedCommand | None) -> None:
        """command: the checked command, None where the robot refused it."""
        caller = (getattr(message, "_connection_header", None) or {}).get("callerid", "")
        self._counts[side] += 1
        self._accepted[side] += command is not None
        told = self._commands[side]
        told.append([side, message.mode, list(message.names), list(message.command), caller, command is not None])
        # The robot follows the last ones.
        del told[:-COMMANDS_TOLD]

    def _take_commands(self):
        told = [command for side in SIDES for command in self._commands[side]]
        for side in SIDES:
            self._commands[side] = []
        return told

    def _contacts(self):
        name = self._model.name
        return sorted({tuple(sorted((_link(name, contact.model_a, contact.link_a),
                                     _link(name, contact.model_b, contact.link_b))))
                       for contact in self.context.world.contacts(self._model) if contact.distance < 0.0})

    def _take_requests(self):
        told = []
        while True:
            try:
                datagram = self._requests.recv(_DATAGRAM_BYTES)
            except OSError:  # none is left
                return told
            told += json.loads(datagram)["poses"]

    def _tell(self, record: dict[str, Any]) -> None:
        try:
            self._socket.sendall(json.dumps(record).encode() + b"\n")
        except OSError:
            self._judge_has_gone()

    def _judge_has_gone(self) -> None:
        """The judge is gone, so nobody else ends this lab."""
        self.close()
        rospy.signal_shutdown("the judge has gone")

    def _hear(self):
        try:
            line = self._answers.readline()
        except OSError:
            line = ""
        if not line:
            self._judge_has_gone()
        return json.loads(line) if line.strip() else None

    def _obey(self, order: dict[str, Any], time_s: float):
        """Reset the robot, disabled: `names`, `positions` [rad] of the arms. Returns "", or why it failed."""
        self._close_world()
        if self._robot is None:
            return "the robot's plugin is gone"
        self._is_ordered = True
        try:
            self._robot.start_over()
            self._handlers[_RESET](EmptyRequest())
            answer = self._handlers[_CONFIGURE](SetModelConfigurationRequest(
                self._model.name, "robot_description", order["names"], order["positions"]))
        finally:
            self._is_ordered = False
        return "" if answer.success else answer.status_message

    def _close_world(self) -> None:
        """Withdraw the services and topics that a checked program must not use; keep the services' handlers."""
        for name in self.context.served():
            if changes_the_world("service", name):
                self._handlers[name] = self.context.withdraw(name)
        for topic in self.context.subscribed():
            if changes_the_world("subscriber", topic):
                self.context.withdraw(topic)


def _link(own: str, model: str, link: str) -> str:
    return link if model == own else "%s/%s" % (model, link)
