# SPDX-License-Identifier: BSD-3-Clause
"""A model plugin that tells the judge what the simulated robot does, and lets time pass only as the judge agrees.

It sits in the simulator's loop, so that it sees joints and contacts themselves and not what somebody publishes. The
judge listens on the Unix socket that the environment variable LAB_JUDGE_SOCKET names. Every RECORD_TICKS ticks one line
of JSON goes out (`Recording` in recording.py reads them), and the loop waits for one line back: empty, or an order.
That is at the beginning of a tick, before any other plugin looks at its messages: whatever the program answers to the
last tick's time and joint states is there when the tick begins.
"""
import json
import os
import socket
import threading

import rospy
from baxter_core_msgs.msg import AssemblyState, JointCommand
from baxter_kinematics_msgs.msg import IKReport
from gazebo_msgs.srv import SetModelConfiguration
from std_msgs.msg import Bool, Empty, Float64
from std_srvs.srv import Empty as EmptyService

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from rf_checks.recorder_names import SOCKET_VARIABLE

RECORD_TICKS = 5  # 10 ms of simulation
SIDES = ("left", "right")
# Commands that are kept between two records; who sends more floods, and the rest is only counted.
COMMANDS_KEPT = 200
#: Commands written out in one record.
COMMANDS_TOLD = 3
# For a service that was there from the start [s, wall].
RESET_TIMEOUT_S = 60.0


class Recorder(ModelPlugin):
    """See the module."""

    def __init__(self, context):
        super().__init__(context)
        path = os.environ.get(SOCKET_VARIABLE)
        if not path:
            raise PluginError("%s is not set; this plugin works for `./baxter.sh check`" % SOCKET_VARIABLE)
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._answers = self._socket.makefile("r", encoding="utf-8")
        self._model = context.model
        self._commands = [(side, context.queue("/robot/limb/%s/joint_command" % side, JointCommand, COMMANDS_KEPT))
                          for side in SIDES]
        self._reports = [(side, context.queue("/ExternalTools/%s/PositionKinematicsNode/IKReport" % side, IKReport, 50))
                         for side in SIDES]
        self._states = context.mailbox("/robot/state", AssemblyState)
        self._enabled = False
        self._counts = dict.fromkeys(SIDES, 0)
        self._done = []
        self._publishers = None
        self._tell({"joints": list(self._model.joint_names)})

    def update(self, time_s, step_s):
        if round(time_s / step_s) % RECORD_TICKS or self._socket is None:
            return
        state = self._states.take()
        if state is not None:
            self._enabled = bool(state.enabled)
        record = {"t": round(time_s, 4), "q": [round(value, 6) for value in self._model.read_joints()[0]],
                  "enabled": self._enabled, "contacts": self._contacts(), "commands": self._take_commands(),
                  "counts": self._counts, "ik": self._take_reports()}
        if self._done:
            record["done"] = self._done.pop()
        self._tell(record)
        answer = self._hear()
        if answer:
            threading.Thread(target=self._obey, args=(answer,), daemon=True).start()

    def close(self):
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _contacts(self):
        name = self._model.name
        return sorted({tuple(sorted((_link(name, contact.model_a, contact.link_a),
                                     _link(name, contact.model_b, contact.link_b))))
                       for contact in self.context.world.contacts(self._model) if contact.distance < 0.0})

    def _take_commands(self):
        told = []
        for side, queue in self._commands:
            messages = queue.drain()
            self._counts[side] = queue.delivered
            # The last ones are what the robot obeys.
            told += [[side, msg.mode, list(msg.names), list(msg.command)] for msg in messages[-COMMANDS_TOLD:]]
        return told

    def _take_reports(self):
        told = []
        for side, queue in self._reports:
            for report in queue.drain():
                for verdict in report.verdicts:
                    pose = verdict.target.pose
                    told.append([side, verdict.target.header.frame_id,
                                 [getattr(pose.position, axis) for axis in "xyz"],
                                 [getattr(pose.orientation, axis) for axis in "xyzw"], verdict.verdict])
        return told

    def _tell(self, record):
        try:
            self._socket.sendall(json.dumps(record).encode() + b"\n")
        except OSError:
            self._judge_has_gone()

    def _judge_has_gone(self):
        """Nobody is left to end this lab."""
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

    def _obey(self, order):
        """A thread of its own: put the robot back, as clients can: `names`, `positions` [rad] of the arms."""
        try:
            self._reset(order["names"], order["positions"])
            self._done.append("")
        except (rospy.ROSException, rospy.ServiceException) as error:
            self._done.append(str(error))

    def _reset(self, names, positions):
        if self._publishers is None:
            self._publishers = [rospy.Publisher(topic, kind, queue_size=1, latch=True) for topic, kind in (
                ("/robot/set_super_reset", Empty), ("/robot/set_super_enable", Bool))]
            self._speeds = [rospy.Publisher("/robot/limb/%s/set_speed_ratio" % side, Float64, queue_size=1, latch=True)
                            for side in SIDES]
        for publisher, message in zip(self._publishers, (Empty(), Bool(False)), strict=True):
            publisher.publish(message)
        for publisher in self._speeds:
            publisher.publish(Float64(1.0))
        rospy.wait_for_service("/gazebo/reset_world", RESET_TIMEOUT_S)
        rospy.ServiceProxy("/gazebo/reset_world", EmptyService)()
        answer = rospy.ServiceProxy("/gazebo/set_model_configuration", SetModelConfiguration)(
            self._model.name, "robot_description", names, positions)
        if not answer.success:
            raise rospy.ServiceException(answer.status_message)


def _link(own, model, link):
    return link if model == own else "%s/%s" % (model, link)
