# SPDX-License-Identifier: BSD-3-Clause
"""A model plugin for tests: holds the joints where they are, publishes them, and breaks on command."""
import numpy as np
import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger, TriggerResponse

from gazebo_ros.model_plugin import ModelPlugin, PluginError


class ProbePlugin(ModelPlugin):
    """Fixed to the floor; joint states every tick, first message latched."""

    @classmethod
    def spawn_options(cls, robot, element):
        return {"static": True}

    def __init__(self, context):
        super().__init__(context)
        if context.element_text("refuse"):
            raise PluginError("refused on purpose")
        self._model = context.model
        self._index = np.arange(len(self._model.joint_names))
        self._target = self._model.read_joints()[0]
        self._states = context.publisher("joint_states", JointState)
        self._first = context.publisher("first_state", JointState, latch=True)
        self._sent_first = False
        self._targets = context.subscription("target", Float64)
        self._break = context.subscription("break", String, depth=1)
        context.service("fail", Trigger, _fail)
        context.service("where", Trigger, lambda _: TriggerResponse(True, repr(self._model.read_joints()[0].tolist())))

    def update(self, time_s, dt):
        if self._break.drain():
            raise RuntimeError("broken on purpose")
        target = self._targets.take()
        if target is not None:
            self._target = np.full(len(self._index), target.data)
        self._model.drive_position(self._index, self._target, np.full(len(self._index), 100.0))

    def joints_set(self):
        self._target = self._model.read_joints()[0]

    def publish(self, time_s):
        if not self._sent_first or self._states.has_listeners:
            position, velocity, effort = self._model.read_joints()
            message = JointState(name=list(self._model.joint_names), position=position.tolist(),
                                 velocity=velocity.tolist(), effort=effort.tolist())
            message.header.stamp = rospy.Time.from_sec(time_s)
            self._states.publish(message)
            if not self._sent_first:
                self._first.publish(message)
                self._sent_first = True


def _fail(request):
    raise RecursionError("broken on purpose")
