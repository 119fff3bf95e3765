# SPDX-License-Identifier: BSD-3-Clause
"""The node: reads what it needs, builds the core, serves."""
from __future__ import annotations

import argparse
import logging
import sys

import rospy

from disk_cache import compiler_pages
from model_files.resources import ResourceFinder
from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import sphere_model_of
from moveit_ros_move_group import settings, tuning
from moveit_ros_move_group.capabilities import (
    cartesian,
    frames,
    kinematics,
    motion,
    pick_place,
    planners,
    scene,
    sequence,
)
from moveit_ros_move_group.context import Context
from moveit_ros_move_group.execution import Executor
from moveit_ros_move_group.failures import Failures
from moveit_ros_move_group.handles import ControllerHandles
from moveit_ros_move_group.industrial import IndustrialPlanner
from moveit_ros_move_group.monitor import SceneMonitor
from moveit_ros_move_group.planning import Planner
from moveit_ros_move_group.ros_control import RosControl
from moveit_ros_move_group.sensors import Sensors
from rospy_nodes.start import MissingParameter, end_on_signals, limit_ports, wait_for_param

# Wall time to wait for the robot's model [s].
_DESCRIPTION_TIMEOUT_S = 60.0
# Wall time after the start in which controllers may come up before they are missed [s].
_CONTROLLERS_TIMEOUT_S = 10.0

# Wall time in which a robot is prepared for planning before services are offered [s]. Many clients wait 5 s for them.
_PREPARED_S = 2.0

_DESCRIPTION = """Plan and execute motions behind MoveIt's interface.

Actions: move_group, execute_trajectory, pickup, place, sequence_move_group.
Services: plan_kinematic_path, compute_ik, compute_fk, compute_cartesian_path, check_state_validity,
get_planning_scene, apply_planning_scene, clear_octomap, query_planner_interface, get_planner_params,
set_planner_params, plan_sequence_path, execute_kinematic_path, ~save_map, ~load_map; by the capabilities.
Subscribes: joint_states, planning_scene, collision_object, attached_collision_object, planning_scene_world,
trajectory_execution_event, and the sensors' topics. Publishes: ~monitored_planning_scene, ~display_planned_path,
~display_contacts, ~display_octomap, ~display_grasp_markers, ~failures, and /tf by the capability TfPublisher.
Parameters: ~robot_description (the name of the URDF's), ~controller_list, ~moveit_controller_manager,
~ros_control_namespace, ~initial, ~allow_trajectory_execution, ~planning_pipelines, ~default_planning_pipeline,
~capabilities, ~disable_capabilities, ~planning_scene_frame_publishing_rate [Hz], ~planning_scene_tf_prefix,
~sensors, ~octomap_frame, ~octomap_resolution [m], ~max_range [m],
~trajectory_execution/..., ~plan_execution/..., ~planning_scene_monitor/..., ~planning_scene_monitor_options/...
"""


def build() -> tuple[Context, list[object]]:
    """Return the Context, and what has to be kept alive. Raises PlanningError, MissingParameter."""
    name = rospy.get_param("~robot_description", rospy.get_param("~planning_scene_monitor_options/robot_description",
                                                                  "robot_description"))
    urdf = wait_for_param(name, _DESCRIPTION_TIMEOUT_S)
    srdf = wait_for_param(name + "_semantic", _DESCRIPTION_TIMEOUT_S)
    planning = rospy.get_param(name + "_planning", None) or {}
    limits = planning.get("joint_limits")
    model = PlanningModel.from_xml(urdf, srdf, {"joint_limits": limits} if limits else None)
    failures = Failures(model.frame)
    monitor = SceneMonitor(model, lambda request, text: failures.tell(request, 0, text))
    exact = ExactChecker(model, MeshReader(ResourceFinder()))
    scene_now, unclear = settings.described_scene(monitor.scene(), planning)
    monitor.change(lambda _: scene_now, "robot_description_planning")
    pipes, usual, complaints = settings.pipelines(model.groups)
    wanted, unknown = settings.capabilities()
    for text in (*model.warnings, *exact.warnings, *unclear, *complaints, *unknown):
        rospy.logwarn("%s", text)
    may_execute = rospy.get_param("~allow_trajectory_execution", True)
    context = Context(model, monitor, exact, failures, pipes, usual, _executor(monitor) if may_execute else None)
    kept = _capabilities(context, wanted, name, may_execute)
    kept.append(Sensors(monitor, sphere_model_of(exact)))
    if context.executor is not None:
        kept.append(motion.StopEvent(context.executor))
    return context, kept


def _executor(monitor: SceneMonitor) -> Executor:
    controllers, complaints = settings.controllers()
    for text in complaints:
        rospy.logwarn("%s", text)
    present = settings.controllers_at_present(controllers)
    if isinstance(present, RosControl):
        rospy.loginfo("controllers: asked for at the controller managers when a motion is executed")
    else:
        rospy.loginfo("controllers: %s", ", ".join(map(str, controllers)) or "none; plans cannot be executed")
    model = monitor.model
    limits = dict(zip(model.variables, model.bounds.tolist(), strict=True))
    handles = ControllerHandles(controllers, settings.initial_positions(model), limits)
    return Executor(present, settings.execution_settings(), monitor, handles.of)


def _capabilities(context: Context, wanted: set[str], description: str, may_execute: bool) -> list[object]:
    planner = Planner(context, IndustrialPlanner(context, description))
    planner.prepare(_PREPARED_S, compiler_pages.release)
    timeouts = {group: entry["kinematics_solver_timeout"]
                for group, entry in (rospy.get_param(description + "_kinematics", {}) or {}).items()
                if isinstance(entry, dict) and isinstance(entry.get("kinematics_solver_timeout"), (int, float))}
    offered = {
        "MoveGroupCartesianPathService": lambda: cartesian.CartesianPathService(context),
        "MoveGroupKinematicsService": lambda: kinematics.Kinematics(context, timeouts),
        "MoveGroupExecuteTrajectoryAction": lambda: motion.ExecuteAction(context),
        "MoveGroupMoveAction": lambda: motion.MoveAction(context, planner, may_execute),
        "MoveGroupPickPlaceAction": lambda: pick_place.PickPlaceActions(context, planner, may_execute),
        "MoveGroupPlanService": lambda: motion.PlanService(context, planner),
        "MoveGroupQueryPlannersService": lambda: planners.Planners(context),
        "MoveGroupStateValidationService": lambda: scene.StateValidity(context),
        "MoveGroupGetPlanningSceneService": lambda: scene.GetScene(context),
        "ApplyPlanningSceneService": lambda: scene.ApplyScene(context),
        "ClearOctomapService": lambda: scene.ClearOctomap(context),
        "MoveGroupExecuteService": lambda: motion.ExecuteService(context),
        "TfPublisher": lambda: frames.TfPublisher(context),
    }
    served = {"move_group/" + name: make for name, make in offered.items()}
    served.update({"pilz_industrial_motion_planner/MoveGroupSequence" + kind: make for kind, make in (
        ("Action", lambda: sequence.SequenceAction(context, planner, may_execute)),
        ("Service", lambda: sequence.SequenceService(context, planner)))})
    made = [make() for name, make in served.items() if name in wanted]
    move_action = next((one for one in made if isinstance(one, motion.MoveAction)), None)
    return made + tuning.servers(context.executor, context.monitor, move_action)


def tell_of_silent_controllers(executor: Executor | None) -> None:
    """Warn of controllers that do not answer, by which command they are started. Servers may start after this node."""
    if executor is None:
        return
    try:
        silent = {}
        for controller in executor.silent(_CONTROLLERS_TIMEOUT_S):
            silent.setdefault(controller.remedy, []).append(str(controller))
        for remedy, names in silent.items():
            if not rospy.is_shutdown():
                rospy.logwarn("no answer yet from %s: plans for its joints cannot be executed; %s", ", ".join(names),
                              remedy)
    except PlanningError as error:
        rospy.logwarn("%s", error)


def main() -> None:
    parser = argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--debug", action="store_true", help="log more")
    options = parser.parse_args(rospy.myargv()[1:])
    end_on_signals()
    try:
        limit_ports()
        rospy.init_node("move_group", disable_signals=True, log_level=rospy.DEBUG if options.debug else rospy.INFO)
        logging.getLogger("actionlib").setLevel(logging.WARNING)
        context, kept = build()
    except (PlanningError, MissingParameter, rospy.ROSInitException) as error:
        if not rospy.is_shutdown():
            sys.exit("move_group: %s" % error)
        return
    # Scripts wait for this line.
    print("\nYou can start planning now!\n", flush=True)
    tell_of_silent_controllers(context.executor)
    rospy.spin()
    del kept
