# SPDX-License-Identifier: BSD-3-Clause
"""The services under /gazebo. The status_message of each response says what was found and, after an error, what would
be right."""
from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import rosgraph
import rospy
from bullet_sim_msgs.srv import AdvanceTicks, AdvanceTicksResponse
from gazebo_msgs.msg import ModelState, ODEPhysics
from gazebo_msgs.srv import (
    DeleteModel,
    DeleteModelResponse,
    GetModelProperties,
    GetModelPropertiesResponse,
    GetModelState,
    GetModelStateResponse,
    GetPhysicsProperties,
    GetPhysicsPropertiesResponse,
    GetWorldProperties,
    GetWorldPropertiesResponse,
    SetModelConfiguration,
    SetModelConfigurationResponse,
    SetModelState,
    SetModelStateResponse,
    SetPhysicsProperties,
    SetPhysicsPropertiesResponse,
    SpawnModel,
    SpawnModelResponse,
)
from geometry_msgs.msg import Vector3
from std_srvs.srv import Empty, EmptyResponse

from bullet_sim import BulletSimError
from command_line.options import counted
from gazebo_ros.body_services import BodyServices
from gazebo_ros.changes import Changes
from gazebo_ros.convert import msg_from_pose, msg_from_twist, pose_from_msg, twist_from_msg
from gazebo_ros.entities import Entities, UnknownEntity
from gazebo_ros.light_services import LightServices
from gazebo_ros.simulation import AdvanceRefused
from gazebo_ros.spawning import SpawnRefused
from gazebo_ros.urdf_extras import unscoped
from loop_ros.faults import SURVIVED, described
from loop_ros.reconfigure import Setting, SettingsServer
from loop_ros.request_queue import LoopEnded
from sim_time.stamps import stamp_ns
from urdf_model import bounds, collision_names

if TYPE_CHECKING:
    from gazebo_ros.simulation import Simulation
    from gazebo_ros.spawning import Spawner
    from gazebo_ros.world_lights import WorldLights
    from loop_ros.protocol import Log, LoopRos

_ROOT_ELEMENT = re.compile(r"<\s*([A-Za-z_][\w.:-]*)")
_NOT_CONTENT = re.compile(r"<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>", re.DOTALL)


def root_element(xml: str) -> str:
    """Name of the root element of an XML text, or "" where there is none."""
    found = _ROOT_ELEMENT.search(_NOT_CONTENT.sub("", xml))
    return found.group(1) if found else ""


def _parameters() -> dict[str, Any]:
    """The whole parameter tree, read from the master itself: rospy answers "/" from a cache which, once the node has
    logged a line, is nearly empty."""
    return rosgraph.Master(rospy.get_name()).getParam("/")


class GazeboServices:
    """Advertises the services; fast work runs in the loop, slow work in the thread of the request."""

    def __init__(self, simulation: Simulation, spawner: Spawner, lights: WorldLights, ros: LoopRos, log: Log) -> None:
        """Advertises everything at once; requests wait until the loop runs. ``lights``: :class:`WorldLights`."""
        self._simulation = simulation
        self._world = simulation.world
        self._spawner = spawner
        self._ros = ros
        self._log = log
        self._entities = Entities(simulation.world)
        self._has_commands = False
        self._changes = Changes()
        self._bodies = BodyServices(simulation, self._entities, self._changes, ros, log, self._note_command)
        LightServices(lights, ros)
        #: For the loop, before each physics step.
        self.push = self._bodies.push
        self._settings = self._open_settings(ros)
        self._state_requests = {}
        self._model_state_commands = ros.subscription("/gazebo/set_model_state", ModelState, depth=10,
                                               notice=self._note_command)
        for name, srv_class, handler in (
                ("delete_model", DeleteModel, self._delete_model),
                ("get_model_properties", GetModelProperties, self._get_model_properties),
                ("get_model_state", GetModelState, self._get_model_state),
                ("get_physics_properties", GetPhysicsProperties, self._get_physics_properties),
                ("get_world_properties", GetWorldProperties, self._get_world_properties),
                ("pause_physics", Empty, self._pause),
                ("reset_simulation", Empty, lambda _: self._reset(time_too=True)),
                ("reset_world", Empty, lambda _: self._reset(time_too=False)),
                ("set_model_configuration", SetModelConfiguration, self._set_model_configuration),
                ("set_model_state", SetModelState, self._set_model_state),
                ("set_physics_properties", SetPhysicsProperties, self._set_physics_properties),
                ("unpause_physics", Empty, self._unpause)):
            ros.service("/gazebo/" + name, srv_class, handler)
        for name, srv_class, handler in (
                ("advance", AdvanceTicks, self._advance),
                ("spawn_sdf_model", SpawnModel, self._spawn_model),
                ("spawn_urdf_model", SpawnModel, self._spawn_model)):
            ros.service_in_thread("/gazebo/" + name, srv_class, handler)

    def take_commands(self) -> None:
        """Loop thread: execute the messages of /gazebo/set_model_state and /gazebo/set_link_state."""
        if not self._has_commands:
            return
        # Cleared before the queues are read: a message that arrives from here on sets it again.
        self._has_commands = False
        self._bodies.take_commands()
        self._model_state_commands.handle(self._take_model_state)

    def _take_model_state(self, command):
        try:
            self._put_model(command)
        except (UnknownEntity, BulletSimError, ValueError) as error:
            self._log.warn_throttle(5.0, "/gazebo/set_model_state: %s" % error)

    def _note_command(self):
        self._has_commands = True

    # -- services in the thread of the request ------------------------------------------------------------------

    def _spawn_model(self, request):
        try:
            is_sdf = root_element(request.model_xml) in ("sdf", "gazebo")
            prepare = self._spawner.prepare_sdf if is_sdf else self._spawner.prepare
            prepared = prepare(request.model_name, request.model_xml, request.robot_namespace,
                               _parameters)
            self._spawner.make_shapes(prepared)
            self._simulation.requests.call(self._spawn_prepared, prepared, request)
        except (SpawnRefused, BulletSimError, LoopEnded) as error:
            return SpawnModelResponse(False, "SpawnModel: Failure - %s" % error)
        except SURVIVED as error:  # a plugin's constructor is user code
            self._log.error("spawning '%s' failed: %s" % (request.model_name, described(error)))
            return SpawnModelResponse(False, "SpawnModel: Failure - %s: %s" % (type(error).__name__, error))
        notes = [prepared.mended] if prepared.mended else []
        if not self._ros.flush():
            notes.append("the ROS master has not answered yet, which must know its topics and services")
        return SpawnModelResponse(True, "; ".join(["SpawnModel: Successfully spawned entity", *notes]))

    def _spawn_prepared(self, prepared, request):
        try:
            pose = self._entities.pose_in_world(pose_from_msg(request.initial_pose), request.reference_frame)
        except (UnknownEntity, BulletSimError) as error:
            raise SpawnRefused(str(error)) from error
        self._spawner.spawn(prepared, pose)

    def _advance(self, request):
        requests = self._simulation.requests
        try:
            done = requests.call(self._simulation.start_advance, request.ticks, request.await_topics, request.timeout_s)
            tick, time_ns = done.result()
        except (AdvanceRefused, LoopEnded) as error:
            tick, time_ns = self._simulation.tick, self._simulation.time_ns
            return AdvanceTicksResponse(False, "advance: %s" % error, rospy.Time(*divmod(time_ns, 10**9)), tick)
        return AdvanceTicksResponse(True, "advance: done", rospy.Time(*divmod(time_ns, 10**9)), tick)

    # -- services in the loop -----------------------------------------------------------------------------------

    def _delete_model(self, request):
        try:
            self._spawner.delete(request.model_name)
        except BulletSimError as error:
            return DeleteModelResponse(False, "DeleteModel: model does not exist - %s" % error)
        self._state_requests.pop(request.model_name, None)
        self._bodies.forget(request.model_name)
        self._changes.forget(request.model_name)
        return DeleteModelResponse(True, "DeleteModel: successfully deleted model")

    def _pause(self, _):
        self._simulation.paused = True
        return EmptyResponse()

    def _unpause(self, _):
        self._simulation.paused = False
        return EmptyResponse()

    def _reset(self, time_too):
        # Wrenches belong to the world before the reset; after it, nothing moves without a new command. In Gazebo they
        # go on.
        self._bodies.forget()
        self._changes.take_back()
        self._settings.show(**self._physics())
        self._simulation.reset(time_too)
        return EmptyResponse()

    def _get_world_properties(self, _):
        return GetWorldPropertiesResponse(self._simulation.time_s, list(self._world.models), True, True,
                                          "GetWorldProperties: got properties")

    def _get_model_properties(self, request):
        response = GetModelPropertiesResponse()
        try:
            model = self._entities.model(request.model_name)
        except UnknownEntity as error:
            response.status_message = "GetModelProperties: %s" % error
            return response
        links = model.gazebo_links
        response.canonical_body_name = next(iter(links), "")
        response.body_names = list(links)
        response.geom_names = [collision.name for collision in collision_names(model.robot).values()]
        inner = (link.partition("::") for link in links)
        response.child_model_names = list(dict.fromkeys(child for child, scope, _ in inner if scope))
        response.joint_names = list(model.joint_names)
        response.is_static = bool(model.static)
        response.success = True
        response.status_message = "GetModelProperties: got properties"
        return response

    def _get_model_state(self, request):
        response = GetModelStateResponse()
        try:
            model = self._entities.model(request.model_name)
            pose, linear, angular = self._entities.relative(model.model_pose(), *model.model_twist(),
                                                            request.relative_entity_name)
        except UnknownEntity as error:
            response.status_message = "GetModelState: %s" % error
            return response
        count = self._state_requests[request.model_name] = self._state_requests.get(request.model_name, 0) + 1
        response.header.seq = count
        response.header.stamp = stamp_ns(self._simulation.time_ns)
        response.header.frame_id = request.relative_entity_name
        response.pose = msg_from_pose(pose)
        response.twist = msg_from_twist(linear, angular)
        response.success = True
        response.status_message = "GetModelState: got properties"
        return response

    def _set_model_state(self, request):
        try:
            self._put_model(request.model_state)
        except (UnknownEntity, BulletSimError, ValueError) as error:
            return SetModelStateResponse(False, "SetModelState: %s" % error)
        return SetModelStateResponse(True, "SetModelState: set model state done")

    def _put_model(self, state):
        model = self._entities.model(state.model_name)
        pose = self._entities.pose_in_world(pose_from_msg(state.pose), state.reference_frame)
        linear, angular = twist_from_msg(state.twist)
        rotation = self._entities.frame(state.reference_frame)[0][:3, :3]
        linear = bounds.SPEED.check(rotation @ linear, "the linear velocity in the world")
        angular = bounds.TURN_RATE.check(rotation @ angular, "the angular velocity in the world")
        model.set_base_pose(pose)
        if model.free:
            model.set_base_twist(linear, angular)

    def _set_model_configuration(self, request):
        names, positions = request.joint_names, request.joint_positions
        try:
            model = self._entities.model(request.model_name)
            if len(names) != len(positions):
                raise ValueError("%s but %s; give one position for each joint"
                                 % (counted(len(names), "joint name"), counted(len(positions), "position")))
            self._put_joints(model, [unscoped(model.name, name) for name in names], positions)
        except (UnknownEntity, BulletSimError, ValueError) as error:
            return SetModelConfigurationResponse(False, "SetModelConfiguration: %s" % error)
        self._simulation.joints_were_set(model.name)
        return SetModelConfigurationResponse(True, "SetModelConfiguration: success")

    @staticmethod
    def _put_joints(model, names, positions):
        position = np.array(positions, dtype=float)
        if names:
            index = model.index(names)
            for name, value in zip(names, positions, strict=True):
                bounds.JOINT_POSITION.check(value, "the position of joint '%s'" % name)
            model.set_joint_positions(index, np.clip(position, model.lower[index], model.upper[index]))

    def _get_physics_properties(self, _):
        simulation = self._simulation
        factor = simulation.real_time_factor
        return GetPhysicsPropertiesResponse(
            time_step=simulation.step_s, pause=simulation.paused, max_update_rate=factor / simulation.step_s,
            gravity=Vector3(*self._world.gravity),
            ode_config=ODEPhysics(sor_pgs_iters=self._world.solver_iterations), success=True,
            status_message="GetPhysicsProperties: got properties")

    def _set_physics_properties(self, request):
        gravity = request.gravity
        try:
            self._set_physics(request.time_step, request.max_update_rate, (gravity.x, gravity.y, gravity.z),
                              request.ode_config.sor_pgs_iters or self._world.solver_iterations)
        except (BulletSimError, ValueError) as error:
            return SetPhysicsPropertiesResponse(False, "SetPhysicsProperties: %s" % error)
        self._settings.show(**self._physics())
        return SetPhysicsPropertiesResponse(
            True, "SetPhysicsProperties: time step, gravity, update rate and solver iterations set; the rest of "
                  "ode_config has no counterpart here")

    def _set_physics(self, time_step, max_update_rate, gravity, iterations):
        """Raises ``ValueError`` or ``BulletSimError``."""
        simulation = self._simulation
        # Check everything before anything is set.
        bounds.TIME_STEP.check(time_step, "time_step")
        bounds.UPDATE_RATE.check(max_update_rate, "max_update_rate")
        bounds.SOLVER_ITERATIONS.check(iterations, "sor_pgs_iters")
        bounds.GRAVITY.check(gravity, "gravity")
        before = (self._world.gravity, self._world.solver_iterations, simulation.step_s,
                  simulation.real_time_factor / simulation.step_s)
        if not abs(time_step - simulation.step_s) <= 1e-9:
            simulation.set_step(time_step)  # first, since a plugin may refuse it
        self._changes.note(("", "physics"), lambda: self._put_physics(*before))
        if iterations != self._world.solver_iterations:
            self._world.set_solver_iterations(iterations)
        self._world.set_gravity(gravity)
        factor = max_update_rate * simulation.step_s
        if abs(factor - simulation.real_time_factor) > 1e-9:
            simulation.real_time_factor = factor

    def _put_physics(self, gravity, iterations, step_s, update_rate):
        simulation = self._simulation
        self._world.set_gravity(gravity)
        self._world.set_solver_iterations(iterations)
        if step_s != simulation.step_s:
            simulation.set_step(step_s)
        if update_rate * step_s != simulation.real_time_factor:
            simulation.real_time_factor = update_rate * step_s

    # -- the same for dynamic_reconfigure -------------------------------------------------------------------------

    def _physics(self):
        simulation = self._simulation
        return {"time_step": simulation.step_s, "max_update_rate": simulation.real_time_factor / simulation.step_s,
                **dict(zip(("gravity_x", "gravity_y", "gravity_z"), map(float, self._world.gravity), strict=True)),
                "sor_pgs_iters": self._world.solver_iterations}

    def _open_settings(self, ros):
        now = self._physics()

        def apply(values):
            try:
                self._set_physics(values["time_step"], values["max_update_rate"],
                                  [values["gravity_" + axis] for axis in "xyz"], values["sor_pgs_iters"])
            except BulletSimError as error:
                raise ValueError(str(error)) from error

        return SettingsServer(ros, "/gazebo", [
            Setting("time_step", now["time_step"], bounds.TIME_STEP.low, bounds.TIME_STEP.high,
                    "length of a step [s]"),
            Setting("max_update_rate", now["max_update_rate"], 0.0, bounds.UPDATE_RATE.high,
                    "steps per second [Hz]; 0: as many as can be"),
            # A useful range for a slider: Gazebo's own, although the service accepts more.
            *(Setting("gravity_" + axis, now["gravity_" + axis], -100.0, 100.0, "along %s [m/s^2]" % axis)
              for axis in "xyz"),
            Setting("sor_pgs_iters", now["sor_pgs_iters"], bounds.SOLVER_ITERATIONS.low,
                    bounds.SOLVER_ITERATIONS.high, "iterations of the constraint solver"),
        ], apply)
