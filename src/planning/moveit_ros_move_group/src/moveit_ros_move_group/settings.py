# SPDX-License-Identifier: BSD-3-Clause
"""Settings that move_group reads from the parameter server."""
from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import rospy

from motion_planning.errors import PlanningError
from motion_planning.industrial import PLANNERS as INDUSTRIAL_PLANNERS
from moveit_ros_move_group.controllers import read_list
from moveit_ros_move_group.execution import ExecutionSettings, StartTolerances
from moveit_ros_move_group.ros_control import PLUGINS, RosControl

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning.scene import Scene
    from moveit_ros_move_group.controllers import ControllerEntry

DEFAULT_CAPABILITIES = (
    "move_group/MoveGroupCartesianPathService", "move_group/MoveGroupKinematicsService",
    "move_group/MoveGroupExecuteTrajectoryAction", "move_group/MoveGroupMoveAction",
    "move_group/MoveGroupPickPlaceAction", "move_group/MoveGroupPlanService",
    "move_group/MoveGroupQueryPlannersService", "move_group/MoveGroupStateValidationService",
    "move_group/MoveGroupGetPlanningSceneService", "move_group/ApplyPlanningSceneService",
    "move_group/ClearOctomapService")
# Those that are served when a parameter asks for them.
OTHER_CAPABILITIES = ("move_group/MoveGroupExecuteService", "move_group/TfPublisher",
                      "pilz_industrial_motion_planner/MoveGroupSequenceAction",
                      "pilz_industrial_motion_planner/MoveGroupSequenceService")
# Adapters that select the time parameterization; the first one in the list counts: it is the outermost, which gets the
# answers of the others. Without one, and with that of MoveIt's old configurations, jerk is limited.
_TIMINGS = {"AddTimeParameterization": "ruckig",
            "AddTimeOptimalParameterization": "time_optimal_trajectory_generation",
            "AddIterativeSplineParameterization": "iterative_spline_parameterization",
            "AddRuckigTrajectorySmoothing": "ruckig"}
# Planning plugins for motions of industrial robots, by their name in MoveIt and an earlier one, and those that have no
# counterpart here.
_INDUSTRIAL, _NOT_BUILT_IN = ("pilz_industrial_motion_planner", "pilz::"), "chomp|stomp"
# The same for the package of their capabilities.
_INDUSTRIAL_PACKAGES = {"pilz_trajectory_generation": "pilz_industrial_motion_planner"}
_FAKE = "moveit_fake_controller_manager/MoveItFakeControllerManager"


@dataclass
class Pipeline:
    """A planning pipeline: name; planners: {name: {key: text}}; groups: {group: {key: value}}; timing: algorithm;
    start_bounds_error [rad or m]; jiggle: share of a joint's range; industrial: plans PTP, LIN and CIRC; usual: planner
    if neither request nor group names one."""

    name: str
    planners: dict[str, dict[str, str]] = field(default_factory=dict)
    groups: dict[str, dict[str, Any]] = field(default_factory=dict)
    timing: str = "ruckig"
    start_bounds_error: float = 0.05
    jiggle: float = 0.02
    industrial: bool = False
    usual: str = ""

    def planner_ids(self) -> list[str]:
        """Names as query_planner_interface gives them: ``group[planner]`` and plain."""
        ids = ["%s[%s]" % (group, planner) for group, entry in self.groups.items()
               for planner in entry.get("planner_configs") or [] if planner in self.planners]
        return list(dict.fromkeys([*ids, *self.planners]))

    def settings(self, group: str, planner: str) -> dict[str, str]:
        """Return {key: text} of a planner's configuration, with what was set for the group alone in place."""
        return {**self.planners.get(planner, {}), **self.planners.get("%s[%s]" % (group, planner), {})}

    def default_planner(self, group: str) -> str:
        return str(self.groups.get(group, {}).get("default_planner_config") or self.usual)


def pipelines(groups: Collection[str]) -> tuple[dict[str, Pipeline], str, list[str]]:
    """Return ({name: Pipeline}, the default one's name, list of complaints); ``groups``: names of the model's."""
    named, complaints = rospy.get_param("~planning_pipelines", {}), []
    found = {}
    for name, tree in named.items() if isinstance(named, dict) else ():
        if not isinstance(tree, dict) or "planning_plugin" not in tree:
            complaints.append("pipeline '%s' has no planning_plugin; it is left out" % name)
            continue
        plugin = str(tree["planning_plugin"])
        if re.match(_NOT_BUILT_IN, plugin):
            complaints.append("pipeline '%s' is left out: its planner %s is not built in; use ompl or "
                              "pilz_industrial_motion_planner" % (name, plugin))
            continue
        found[name] = _pipeline(name, tree, groups)
    if not found:
        tree = rospy.get_param("~", {})
        plugin = str(tree.get("planning_plugin", ""))
        if re.match(_NOT_BUILT_IN, plugin):
            complaints.append("the planner %s is not built in; RRT-Connect takes its place" % plugin)
        found["ompl"] = _pipeline("ompl", tree, groups)
    usual = rospy.get_param("~default_planning_pipeline", "")
    if usual not in found:
        first = next((name for name, pipeline in found.items() if not pipeline.industrial), next(iter(found)))
        if usual:
            complaints.append("there is no pipeline '%s' for default_planning_pipeline; '%s' is taken" % (usual, first))
        usual = first
    return found, usual, complaints


def _pipeline(name: str, tree: Mapping[str, Any], groups: Collection[str]) -> Pipeline:
    pipeline = Pipeline(name)
    if str(tree.get("planning_plugin", "")).startswith(_INDUSTRIAL):
        pipeline.industrial, pipeline.usual = True, str(tree.get("default_planner_config", ""))
        pipeline.planners = {planner: {} for planner in INDUSTRIAL_PLANNERS}
        pipeline.start_bounds_error = _number(tree.get("start_state_max_bounds_error"), pipeline.start_bounds_error)
        return pipeline
    configs = tree.get("planner_configs")
    pipeline.planners = {key: {k: str(v) for k, v in (value or {}).items()} for key, value in configs.items()} \
        if isinstance(configs, dict) else {}
    pipeline.groups = {group: tree[group] for group in groups if isinstance(tree.get(group), dict)}
    for adapter in reversed(str(tree.get("request_adapters", "")).split()):
        pipeline.timing = _TIMINGS.get(adapter.rpartition("/")[2], pipeline.timing)
    pipeline.start_bounds_error = _number(tree.get("start_state_max_bounds_error"), pipeline.start_bounds_error)
    pipeline.jiggle = _number(tree.get("jiggle_fraction"), pipeline.jiggle)
    return pipeline


def described_scene(scene: Scene, planning: Mapping[str, Any]) -> tuple[Scene, list[str]]:
    """Return (Scene, list of complaints): ``scene`` with what ``robot_description_planning`` says of collisions.

    ``planning``: its mapping. Padding and scale of all links and of single ones; pairs that may touch or may not.
    """
    complaints = []

    def of_links(what: str, usual: float) -> dict[str, float]:
        usual = _number(planning.get("default_robot_" + what), usual)
        named = planning.get("default_robot_link_" + what)
        return {**dict.fromkeys(scene.model.links, usual), **(named if isinstance(named, dict) else {})}

    for what, usual in (("padding", 0.0), ("scale", 1.0)):
        for link, value in of_links(what, usual).items():
            try:
                scene = scene.with_padding(**{what: {link: _number(value, math.nan)}}) if value != usual else scene
            except PlanningError as error:
                complaints.append("robot_description_planning: %s; left out" % error)
    pairs = {}
    for entry in planning.get("default_collision_operations") or []:
        try:
            pairs[entry["object1"], entry["object2"]] = {"disable": True, "enable": False}[entry["operation"]]
        except (KeyError, TypeError):
            complaints.append("default_collision_operations: %r is left out; expected object1, object2, and operation "
                              "enable or disable" % (entry,))
    return scene.with_allowed(scene.allowed.with_entries(pairs)) if pairs else scene, complaints


def execution_settings() -> ExecutionSettings:
    """Return the ExecutionSettings of ``~trajectory_execution``."""
    tree = rospy.get_param("~trajectory_execution", {})
    usual = ExecutionSettings()
    tolerance = _number(tree.get("allowed_start_tolerance"), usual.usual_start_tolerance)
    by_joint = tree.get("joints_allowed_start_tolerance")
    if isinstance(by_joint, dict):
        tolerance = StartTolerances(tolerance, by_joint)
    return ExecutionSettings(
        bool(tree.get("execution_duration_monitoring", usual.monitored)),
        _number(tree.get("allowed_execution_duration_scaling"), usual.scaling),
        _number(tree.get("allowed_goal_duration_margin"), usual.margin), tolerance,
        bool(tree.get("wait_for_trajectory_completion", usual.wait_for_rest)),
        _number(tree.get("controller_connection_timeout"), usual.connection_timeout))


def controllers() -> tuple[list[ControllerEntry], list[str]]:
    """Return (list of Controllers, list of complaints) of ``~controller_list``."""
    fake = rospy.get_param("~moveit_controller_manager", "") == _FAKE
    entries = rospy.get_param("~controller_list", [])
    return read_list(entries, fake)


def controllers_at_present(listed: list[ControllerEntry]) -> Callable[[], list[ControllerEntry]]:
    """Return a function that returns the list of Controllers: ``listed``, or what controller managers have by then."""
    manager = rospy.get_param("~moveit_controller_manager", "")
    if manager not in PLUGINS:
        return lambda: listed
    namespace = None if PLUGINS[manager] else str(rospy.get_param("~ros_control_namespace", "/"))
    return RosControl(namespace, listed)


def initial_positions(model: PlanningModel) -> dict[str, float]:
    """Return {joint: value} of the group states that ``~initial`` names, as fake controllers begin with them."""
    found = {}
    entries = rospy.get_param("~initial", [])
    for entry in entries if isinstance(entries, list) else ():
        group = model.groups.get(entry.get("group", "")) if isinstance(entry, dict) else None
        if group is not None:
            found.update(group.states.get(entry.get("pose", ""), {}))
    return found


def capabilities() -> tuple[set[str], list[str]]:
    """Return (set of the capabilities that are wanted, list of complaints)."""
    wanted = set(DEFAULT_CAPABILITIES) | _names_in(rospy.get_param("~capabilities", ""))
    named = rospy.get_param("~planning_pipelines", {})
    for tree in named.values() if isinstance(named, dict) else ():
        wanted |= _names_in(tree.get("capabilities", "")) if isinstance(tree, dict) else set()
    wanted -= _names_in(rospy.get_param("~disable_capabilities", ""))
    unknown = sorted(wanted - set(DEFAULT_CAPABILITIES) - set(OTHER_CAPABILITIES))
    return wanted, ["there is no capability '%s'; it is left out" % name for name in unknown]


def _names_in(text: object) -> set[str]:
    """The capabilities of a parameter, by their present names."""
    named = (name.partition("/") for name in str(text).split())
    return {_INDUSTRIAL_PACKAGES.get(package, package) + slash + name for package, slash, name in named}


def _number(value: object, usual: float) -> float:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else usual
