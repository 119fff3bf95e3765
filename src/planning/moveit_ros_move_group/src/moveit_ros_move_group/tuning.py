# SPDX-License-Identifier: BSD-3-Clause
"""Settings that dynamic_reconfigure's clients may change while the node runs, under MoveIt's names."""
from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import rospy

from loop_ros.reconfigure import Setting, SettingsServer

if TYPE_CHECKING:
    from moveit_ros_move_group.capabilities.motion import MoveAction
    from moveit_ros_move_group.execution import ExecutionSettings, Executor
    from moveit_ros_move_group.monitor import SceneMonitor


class _RosTopics:
    """Publishers and services of a plain node, as SettingsServer asks for them."""

    def publisher(self, topic: str, msg_class: type[rospy.Message], latch: bool = False) -> rospy.Publisher:
        return rospy.Publisher(topic, msg_class, latch=latch, queue_size=10)

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> rospy.Service:
        return rospy.Service(name, srv_class, handler)


def servers(executor: Executor | None, monitor: SceneMonitor, move_action: MoveAction | None) -> list[SettingsServer]:
    """Return the SettingsServers of ``~trajectory_execution``, ``~planning_scene_monitor`` and ``~plan_execution``.

    executor: execution.Executor; move_action: motion.MoveAction; no server of one that is None. monitor: SceneMonitor.
    """
    topics, made = _RosTopics(), [_of_monitor(_RosTopics(), monitor)]
    if executor is not None:
        made.append(_of_execution(topics, executor.settings))
    if move_action is not None:
        made.append(SettingsServer(topics, "~plan_execution", [Setting(
            "max_replan_attempts", int(move_action.replan_attempts), 0, 10000,
            "number of replanning attempts of a goal that allows it")],
            lambda values: setattr(move_action, "replan_attempts", values["max_replan_attempts"])))
    return made


def _of_execution(topics: _RosTopics, settings: ExecutionSettings) -> SettingsServer:
    def apply(values: Mapping[str, Any]) -> None:
        settings.monitored = values["execution_duration_monitoring"]
        settings.scaling = values["allowed_execution_duration_scaling"]
        settings.margin = values["allowed_goal_duration_margin"]
        settings.wait_for_rest = values["wait_for_trajectory_completion"]
        if values["allowed_start_tolerance"] != server.values["allowed_start_tolerance"]:
            settings.allow_at_start(values["allowed_start_tolerance"])

    server = SettingsServer(topics, "~trajectory_execution", [
        Setting("execution_duration_monitoring", settings.monitored, meaning="stop motions that take too long"),
        Setting("allowed_execution_duration_scaling", float(settings.scaling), 1.0, 10.0,
                "factor by which a trajectory may take longer than planned"),
        Setting("allowed_goal_duration_margin", float(settings.margin), 0.1, 60.0, "additional time [s]"),
        Setting("allowed_start_tolerance", float(settings.usual_start_tolerance), 0.0, 1e9,
                "allowed distance [rad or m] of joints from a trajectory's start; 0: any"),
        Setting("wait_for_trajectory_completion", settings.wait_for_rest, meaning="wait until the joints are at rest"),
    ], apply)
    return server


def _of_monitor(topics: _RosTopics, monitor: SceneMonitor) -> SettingsServer:
    def apply(values: Mapping[str, Any]) -> None:
        monitor.publishes, monitor.publishes_states, monitor.hz = (
            values["publish_planning_scene"], values["publish_state_updates"], values["publish_planning_scene_hz"])

    return SettingsServer(topics, "~planning_scene_monitor", [
        Setting("publish_planning_scene", monitor.publishes, meaning="publish changes of the scene"),
        Setting("publish_planning_scene_hz", float(monitor.hz), 0.1, 100.0, "greatest rate [Hz]"),
        Setting("publish_state_updates", monitor.publishes_states, meaning="publish the robot's motion, too"),
    ], apply)
