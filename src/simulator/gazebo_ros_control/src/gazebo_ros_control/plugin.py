# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_control.so as a model plugin of /gazebo: a controller manager on the model's joints."""
from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, cast

import rospkg
import rospy
import yaml
from std_msgs.msg import Bool

from controller_manager import ControlError, ControllerTable
from controller_manager.manager import ControllerManager
from controller_manager.pid_tuning import TunablePids
from controller_manager.services import ControllerManagerServices
from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros_control.hardware import SimulatedHardware
from gazebo_ros_control.sensors import simulated_sensors
from urdf_model import UrdfError, parse_urdf

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

DEFAULT_SIM_TYPE = "gazebo_ros_control/DefaultRobotHWSim"
#: Private parameter of /gazebo: a mapping of controller type to "module:Class" that adds to ros_controllers' table.
MORE_TYPES = "~controller_types"


#: Parameter with the gains of joints that the simulator drives by a PID, below the robot's namespace.
PID_GAINS = "gazebo_ros_control/pid_gains"


class GazeboRosControl(ModelPlugin):
    """Elements: robotNamespace, robotParam, controlPeriod [s], eStopTopic, robotSimType; legacyModeNS has no effect.

    A description that cannot be used gives one error in the log; the model stays, without controllers.
    """

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._hardware = None
        try:
            self._build(context)
        except (ControlError, UrdfError) as error:
            self._hardware = None
            context.log.error("model '%s' has no controllers: %s" % (context.model.name, error))

    def _build(self, context):
        robot, urdf_xml = self._description(context)
        self._period_s = self._control_period(context)
        sim_type = context.element_text("robotSimType", DEFAULT_SIM_TYPE)
        if sim_type != DEFAULT_SIM_TYPE:
            context.log.warn("model '%s': robotSimType '%s' is not known and taken as %s"
                             % (context.model.name, sim_type, DEFAULT_SIM_TYPE))
        hardware = SimulatedHardware(
            context.model, robot, urdf_xml, context.log, context.param("joint_limits"),
            context.param(PID_GAINS), context.namespace)
        if not hardware.joint_names:
            context.log.warn("model '%s': its description has no <transmission> that can be used, so no joint can be "
                             "controlled"
                             % context.model.name)
        hardware.sensors = simulated_sensors(context.world, context.model)
        for pid, joints in hardware.pids:
            TunablePids(context, pid, ["%s/%s" % (PID_GAINS, joint) for joint in joints])
        self._manager = ControllerManager(hardware, context.log)
        self._last_update_s = None
        self._restart = False
        topic = context.element_text("eStopTopic")
        self._stop_messages = context.subscription(topic, Bool) if topic else None
        self._stopped, self._stop_joints = False, hardware.stop
        self._types = _Types()
        self._services = ControllerManagerServices(self._manager, self._types.table, context, robot)
        self._hardware = hardware

    def update(self, time_s: float, dt: float) -> None:
        hardware = self._hardware
        if hardware is None:
            return
        hardware.read()
        if self._stop_messages is not None:
            self._stop_messages.handle(self._take_stop)
        last = self._last_update_s
        # Half a nanosecond, for the rounding of multiples of a tick and of the period.
        if last is None or time_s - last >= self._period_s - 5e-10:
            restart, self._restart = self._restart, False
            self._manager.update(time_s, self._period_s if last is None else time_s - last, restart)
            self._last_update_s = time_s
        hardware.write(dt)

    def step_changed(self, step_s: float) -> None:
        self._period_s = self._control_period(self.context)

    def joints_set(self) -> None:
        if self._hardware is None:
            return
        self._hardware.joints_set()
        # Controllers restart from the joints' new positions: their goals started from the old ones. At once, so that a
        # command before the next tick is not lost.
        self._manager.restart(self.context.world.time_s)

    def reset(self) -> None:
        self._last_update_s = None
        self.joints_set()

    def restarted(self) -> GazeboRosControl:
        # Loaded controllers stay: they restart from the joints' positions, as after a reset.
        self.reset()
        return self

    def hold(self) -> None:
        if self._hardware is not None:
            self._hardware.hold_all()
            self._hardware.write(self.context.world.time_step_s)

    def close(self) -> None:
        if self._hardware is not None:
            self._services.close()

    def _take_stop(self, message):
        if self._stopped != message.data:
            # A goal ends with the stop: its time goes on, and a stopped joint could appear to reach it.
            self._restart = True
        self._stopped = message.data
        self._stop_joints(message.data)

    @staticmethod
    def _description(context):
        """(robot, URDF text) that robotParam names, searched upwards from the namespace; else the spawned
        description."""
        name = context.element_text("robotParam", "robot_description")
        namespace = context.namespace
        while not name.startswith("/"):
            text = context.param("%s/%s" % (namespace, name))
            if isinstance(text, str) and text.strip():
                break
            if not namespace:
                return context.robot, context.urdf_xml
            namespace = namespace.rpartition("/")[0]
        else:
            text = context.param(name)
            if not isinstance(text, str):
                return context.robot, context.urdf_xml
        if text.strip() == context.urdf_xml.strip():
            return context.robot, context.urdf_xml
        return parse_urdf(text, source="%s/%s" % (namespace, name.lstrip("/"))), text

    @staticmethod
    def _control_period(context):
        step_s = context.world.time_step_s
        text = context.element_text("controlPeriod")
        if text is None:
            return step_s
        try:
            period_s = float(text)
        except ValueError:
            period_s = math.nan
        if not (math.isfinite(period_s) and period_s > 0.0):
            context.log.error("model '%s': controlPeriod is '%s', expected a number of seconds above 0; the physics "
                              "step of %g s is used" % (context.model.name, text, step_s))
            return step_s
        if period_s < step_s - 5e-10:
            context.log.error("model '%s': controlPeriod %g s is shorter than the physics step of %g s; controllers "
                              "run at every step" % (context.model.name, period_s, step_s))
        elif period_s > step_s + 5e-10:
            context.log.warn("model '%s': controlPeriod %g s is longer than the physics step of %g s"
                             % (context.model.name, period_s, step_s))
        return period_s


class _Types:
    """The table of controller types: ros_controllers' file, with the present entries of the node's parameter."""

    def __init__(self) -> None:
        path = os.path.join(rospkg.RosPack().get_path("ros_controllers"), "config", "controllers.yaml")
        with open(path, encoding="utf-8") as file:
            self._own = cast("dict[str, str]", yaml.safe_load(file))  # yaml does not say that a file has a mapping
        self._entries: dict[str, Any] = {}
        self._table: ControllerTable | None = None

    def table(self) -> ControllerTable:
        """Any thread, one at a time: the :class:`ControllerTable`."""
        more = rospy.get_param(MORE_TYPES, {})
        if not isinstance(more, dict):
            raise ControlError("parameter %s is %r, expected a mapping of controller type to module:Class"
                               % (rospy.resolve_name(MORE_TYPES), more))
        entries = {**self._own, **_flat(more)}
        if self._table is None or entries != self._entries:
            self._entries, self._table = entries, ControllerTable(entries)
        return self._table


def _flat(tree, path=""):
    """{"a/b": value} of {"a": {"b": value}}: for the parameter server, a slash in a key separates namespaces."""
    flat = {}
    for key, value in tree.items():
        flat.update(_flat(value, path + key + "/") if isinstance(value, dict) else {path + key: value})
    return flat
