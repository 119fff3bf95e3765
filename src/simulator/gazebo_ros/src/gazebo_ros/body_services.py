# SPDX-License-Identifier: BSD-3-Clause
"""The services and the topic under /gazebo that are about single links and joints."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from bullet_sim_msgs.msg import Drag
from gazebo_msgs.msg import LinkState
from gazebo_msgs.srv import (
    ApplyBodyWrench,
    ApplyBodyWrenchResponse,
    ApplyJointEffort,
    ApplyJointEffortResponse,
    BodyRequest,
    BodyRequestResponse,
    GetJointProperties,
    GetJointPropertiesResponse,
    GetLinkProperties,
    GetLinkPropertiesResponse,
    GetLinkState,
    GetLinkStateResponse,
    JointRequest,
    JointRequestResponse,
    SetJointProperties,
    SetJointPropertiesResponse,
    SetLinkProperties,
    SetLinkPropertiesResponse,
    SetLinkState,
    SetLinkStateResponse,
)

from bullet_sim import BulletSimError, Pose
from command_line.options import counted
from gazebo_ros import dragging
from gazebo_ros.convert import msg_from_pose, msg_from_twist, pose_from_msg, twist_from_msg, vector_from_msg
from gazebo_ros.entities import WORLD_FRAMES, UnknownEntity
from gazebo_ros.jobs import TimedJobs
from gazebo_ros.link_placing import joints_to, placed, rates
from loop_ros.faults import SURVIVED
from urdf_model import bounds

if TYPE_CHECKING:
    from collections.abc import Callable

    from gazebo_ros.changes import Changes
    from gazebo_ros.entities import Entities
    from gazebo_ros.simulation import Simulation
    from loop_ros.protocol import Log, LoopRos

_REFUSALS = (UnknownEntity, BulletSimError, ValueError)
_JOINT_TYPES = {"revolute": GetJointPropertiesResponse.REVOLUTE, "continuous": GetJointPropertiesResponse.CONTINUOUS,
                "prismatic": GetJointPropertiesResponse.PRISMATIC}
# Largest number of wrenches and efforts at a time. Only a program that never ends one reaches it, and each one costs
# time in every tick.
_MAX_JOBS = 1000
# A hand has one pointer.
_MAX_DRAGS = 20
# Fields of ODEJointProperties that are about ODE's solver and have no counterpart in Bullet.
_ODE_ONLY = ("erp", "cfm", "stop_erp", "stop_cfm", "fudge_factor", "fmax", "vel")


class BodyServices:
    """Advertises the services. Everything here runs in the loop thread."""

    def __init__(self, simulation: Simulation, entities: Entities, changes: Changes, ros: LoopRos, log: Log,
                 notice: Callable[[], object]) -> None:
        """``entities``: :class:`gazebo_ros.entities.Entities`; ``changes``: :class:`gazebo_ros.changes.Changes`;
        ``notice()`` is called when :meth:`take_commands` has something to do."""
        self._simulation = simulation
        self._world = simulation.world
        self._entities = entities
        self._changes = changes
        self._log = log
        self._faults = ros.faults
        self._wrenches = TimedJobs()  # of (model, link)
        self._efforts = TimedJobs()  # of (model, joint)
        self._drags = dragging.Drags()  # of (model, link)
        self._drag_commands = ros.subscription("/gazebo/drag", Drag, depth=10, notice=notice)
        self._link_state_commands = ros.subscription("/gazebo/set_link_state", LinkState, depth=10, notice=notice)
        for name, srv_class, handler in (
                ("apply_body_wrench", ApplyBodyWrench, self._apply_body_wrench),
                ("apply_joint_effort", ApplyJointEffort, self._apply_joint_effort),
                ("clear_body_wrenches", BodyRequest, self._clear_body_wrenches),
                ("clear_joint_forces", JointRequest, self._clear_joint_forces),
                ("get_joint_properties", GetJointProperties, self._get_joint_properties),
                ("get_link_properties", GetLinkProperties, self._get_link_properties),
                ("get_link_state", GetLinkState, self._get_link_state),
                ("set_joint_properties", SetJointProperties, self._set_joint_properties),
                ("set_link_properties", SetLinkProperties, self._set_link_properties),
                ("set_link_state", SetLinkState, self._set_link_state)):
            ros.service("/gazebo/" + name, srv_class, handler)

    def take_commands(self) -> None:
        """Execute the messages of /gazebo/set_link_state and /gazebo/drag."""
        self._link_state_commands.handle(self._take_link_state)
        self._drag_commands.handle(self._take_drag)

    def _take_link_state(self, command):
        try:
            self._put_link(command)
        except _REFUSALS as error:
            self._log.warn_throttle(5.0, "/gazebo/set_link_state: %s" % error)

    def _take_drag(self, command):
        try:
            model, link = self._entities.link(command.link)
            target = model.name, link
            if not command.hold:
                self._drags.remove(lambda other: other == target)
                return
            if model.static and model.merged.frames[link].link == model.merged.root:
                raise ValueError("link '%s' is fixed in the world; nothing pulls it away" % command.link)
            grip = vector_from_msg(command.grip, bounds.POSITION, "the grip")
            end = vector_from_msg(command.target, bounds.POSITION, "the target")
        except _REFUSALS as error:
            self._log.warn_throttle(5.0, "/gazebo/drag: %s" % error)
            return
        if target not in self._drags and len(self._drags) >= _MAX_DRAGS:
            self._log.warn_throttle(5.0, "/gazebo/drag: %s are pulled already, expected less"
                                    % counted(len(self._drags), "link"))
            return
        self._drags.ask(target, dragging.Drag(grip, end, time.monotonic()))

    def push(self) -> None:
        """Before a physics step: apply the wrenches, efforts and pulls that are due."""
        if self._drags:
            for target, drag in self._drags.due(time.monotonic()):
                self._push_one(self._drags, target, self._pull_link, drag)
        if not (self._wrenches or self._efforts):
            return
        now = self._simulation.time_ns
        for target, (force, torque) in self._wrenches.due(now):
            self._push_one(self._wrenches, target, self._push_link, force, torque)
        for target, effort in self._efforts.due(now):
            self._push_one(self._efforts, target, self._push_joint, effort)

    def _push_one(self, jobs, target, push, *arguments):
        try:
            push(*target, *arguments)
        except SURVIVED as error:
            self._faults.note("pushing %s::%s" % target, error, "it is pushed no more")
            jobs.remove(lambda other: other == target)

    def _pull_link(self, model_name, link, drag):
        dragging.push(self._world.models[model_name], link, drag, self._simulation.step_s)

    def _push_link(self, model_name, link, force, torque):
        self._world.models[model_name].apply_wrench(link, force, torque)

    def _push_joint(self, model_name, joint, effort):
        model = self._world.models[model_name]
        index = model.index([joint])
        model.add_effort(index, model.limited_effort(index, np.array([effort])))

    def forget(self, model_name: str | None = None) -> None:
        """Drop the wrenches, efforts and pulls of a model that is gone, or all."""
        for jobs in (self._wrenches, self._efforts, self._drags):
            jobs.remove(lambda target: model_name is None or target[0] == model_name)

    # -- wrenches and efforts -------------------------------------------------------------------------------------

    def _apply_body_wrench(self, request):
        try:
            model, link = self._entities.link(request.body_name)
            if model.static and model.merged.frames[link].link == model.merged.root:
                raise ValueError("link '%s' is fixed in the world; no wrench moves it" % request.body_name)
            self._make_room(self._wrenches)
            force = vector_from_msg(request.wrench.force, bounds.FORCE, "the force")
            torque = vector_from_msg(request.wrench.torque, bounds.TORQUE, "the torque")
            # From the link's origin to the point, in world axes; the force itself acts at the centre of mass.
            lever = vector_from_msg(request.reference_point, bounds.POSITION, "the reference point")
            if request.reference_frame not in WORLD_FRAMES:
                frame = self._entities.frame(request.reference_frame)[0]
                rotation = frame[:3, :3]
                force, torque = rotation @ force, rotation @ torque
                lever = rotation @ lever + frame[:3, 3] - np.array(model.link_pose(link).position)
            torque = bounds.TORQUE.check(torque + np.cross(lever, force), "the torque at the centre of mass")
        except _REFUSALS as error:
            return ApplyBodyWrenchResponse(False, "ApplyBodyWrench: %s" % error)
        payload = (force, torque)
        self._wrenches.add((model.name, link), payload, request.start_time.to_nsec(), request.duration.to_nsec())
        return ApplyBodyWrenchResponse(True, "ApplyBodyWrench: wrench will be applied")

    def _apply_joint_effort(self, request):
        try:
            model, joint = self._entities.joint(request.joint_name)
            self._make_room(self._efforts)
            effort = bounds.EFFORT.check(float(request.effort), "the effort on joint '%s'" % joint)
        except _REFUSALS as error:
            return ApplyJointEffortResponse(False, "ApplyJointEffort: %s" % error)
        self._efforts.add((model.name, joint), effort, request.start_time.to_nsec(), request.duration.to_nsec())
        return ApplyJointEffortResponse(True, "ApplyJointEffort: effort will be applied")

    @staticmethod
    def _make_room(jobs):
        if len(jobs) >= _MAX_JOBS:
            raise ValueError("%d are under way already, expected less; give them a duration, or clear them "
                             "(clear_body_wrenches, clear_joint_forces)" % len(jobs))

    def _clear_body_wrenches(self, request):
        try:
            model, link = self._entities.link(request.body_name)
            self._wrenches.remove(lambda target: target == (model.name, link))
        except UnknownEntity as error:
            self._log.warn("/gazebo/clear_body_wrenches: %s" % error)
        return BodyRequestResponse()

    def _clear_joint_forces(self, request):
        try:
            model, joint = self._entities.joint(request.joint_name)
            self._efforts.remove(lambda target: target == (model.name, joint))
        except UnknownEntity as error:
            self._log.warn("/gazebo/clear_joint_forces: %s" % error)
        return JointRequestResponse()

    # -- links ----------------------------------------------------------------------------------------------------

    def _get_link_state(self, request):
        response = GetLinkStateResponse()
        try:
            model, link = self._entities.link(request.link_name)
            pose, linear, angular = self._entities.relative(model.link_pose(link), *model.link_twist(link),
                                                            request.reference_frame)
        except UnknownEntity as error:
            response.status_message = "GetLinkState: %s" % error
            return response
        response.link_state = LinkState(request.link_name, msg_from_pose(pose), msg_from_twist(linear, angular),
                                        request.reference_frame)
        response.success = True
        response.status_message = "GetLinkState: got state"
        return response

    def _set_link_state(self, request):
        try:
            self._put_link(request.link_state)
        except _REFUSALS as error:
            return SetLinkStateResponse(False, "SetLinkState: %s" % error)
        return SetLinkStateResponse(True, "SetLinkState: success")

    def _put_link(self, state):
        model, link = self._entities.link(state.link_name)
        frame, root = model.merged.frames[link], model.root_of(link)
        pose = self._entities.pose_in_world(pose_from_msg(state.pose), state.reference_frame).matrix()
        linear, angular = twist_from_msg(state.twist)
        rotation = self._entities.frame(state.reference_frame)[0][:3, :3]
        linear, angular = rotation @ linear, rotation @ angular
        is_fixed = model.static and root == model.merged.root
        if is_fixed and frame.link != root:
            self._put_joints_of(model, frame, pose, linear, angular)
            return
        # All that joints hold together moves, so that this link is at the given pose.
        in_body = np.linalg.inv(model.body_frame(root)) @ model.link_pose(link).matrix()
        base = pose @ np.linalg.inv(in_body)
        if is_fixed:
            model.set_base_pose(Pose.from_matrix(base))
            return
        at = base if root == model.merged.root else base @ model.merged.frames[root].offset
        linear = bounds.SPEED.check(linear + np.cross(angular, at[:3, 3] - pose[:3, 3]),
                                    "the linear velocity of link '%s'" % root)
        model.set_root_pose(root, Pose.from_matrix(base))
        model.set_root_twist(root, linear, angular)

    def _put_joints_of(self, model, frame, pose, linear, angular):
        """Move the joints between the fixed root and a link, so that this is as near as possible to ``pose``."""
        body = pose @ np.linalg.inv(frame.offset)
        joints = joints_to(model.merged, frame.link)
        index = model.index([joint.name for joint in joints])
        position, jacobian = placed(joints, model.base_pose().matrix(), body, model.read_joints()[0][index],
                                    model.lower[index], model.upper[index])
        linear = bounds.SPEED.check(linear + np.cross(angular, body[:3, 3] - pose[:3, 3]),
                                    "the linear velocity of the link's body")
        model.set_joint_positions(index, position, rates(jacobian, linear, angular))
        self._simulation.joints_were_set(model.name)

    def _get_link_properties(self, request):
        response = GetLinkPropertiesResponse()
        try:
            model, link = self._entities.link(request.link_name)
            inertial = model.inertial(link)
            response.gravity_mode = model.has_weight(link)
        except _REFUSALS as error:
            response.status_message = "GetLinkProperties: %s" % error
            return response
        response.com = msg_from_pose(Pose(tuple(inertial.centre)))
        response.mass = inertial.mass
        for name, i, j in _INERTIA:
            setattr(response, name, inertial.inertia[i, j])
        response.success = True
        response.status_message = "GetLinkProperties: got properties"
        return response

    def _set_link_properties(self, request):
        try:
            model, link = self._entities.link(request.link_name)
            old, had_weight = model.inertial(link), model.has_weight(link)
            pose = pose_from_msg(request.com)
            centre = old.centre if np.allclose(pose.position, old.centre, atol=1e-6) else np.array(pose.position)
            inertia = np.zeros((3, 3))
            for name, i, j in _INERTIA:
                inertia[i, j] = inertia[j, i] = getattr(request, name)
            # Before it is turned, which NaN would spread and infinity make NaN.
            bounds.INERTIA.check(inertia.ravel(), "the inertia of link '%s'" % link)
            rotation = pose.matrix()[:3, :3]
            inertia = rotation @ inertia @ rotation.T
            if not (request.mass == old.mass and np.allclose(inertia, old.inertia, rtol=1e-12, atol=0.0)
                    and centre is old.centre):
                model.set_inertial(link, request.mass, inertia, centre)
                self._changes.note((model.name, link, "inertial"),
                                   lambda: model.set_inertial(link, old.mass, old.inertia, old.centre))
            model.set_weight(link, request.gravity_mode)
            self._changes.note((model.name, link, "weight"), lambda: model.set_weight(link, had_weight))
        except _REFUSALS as error:
            return SetLinkPropertiesResponse(False, "SetLinkProperties: %s" % error)
        return SetLinkPropertiesResponse(True, "SetLinkProperties: properties set")

    # -- joints ---------------------------------------------------------------------------------------------------

    def _get_joint_properties(self, request):
        response = GetJointPropertiesResponse()
        try:
            model, joint = self._entities.joint(request.joint_name)
        except UnknownEntity as error:
            response.status_message = "GetJointProperties: %s" % error
            return response
        index, = model.index([joint])
        position, rate, _ = model.read_joints()
        response.type = _JOINT_TYPES[model.merged.joints[joint].type]
        response.damping = [model.damping[index]]
        response.position = [position[index]]
        response.rate = [rate[index]]
        response.success = True
        response.status_message = "GetJointProperties: got properties"
        return response

    def _set_joint_properties(self, request):
        wanted = request.ode_joint_config
        ignored = [name for name in _ODE_ONLY if getattr(wanted, name)]
        try:
            model, joint = self._entities.joint(request.joint_name)
            index = int(model.index([joint])[0])
            damping, upper, lower = (_single(wanted, name) for name in ("damping", "hiStop", "loStop"))
            if damping is None and upper is None and lower is None:
                raise ValueError("nothing to set: damping, hiStop and loStop are empty, and %s"
                                 % ("%s has no counterpart here" % ", ".join(ignored) if ignored else "so is the rest"))
            if damping is not None:
                bounds.DAMPING.check(damping, "damping")
            old_lower, old_upper, old_damping = (
                float(values[index]) for values in (model.lower, model.upper, model.damping))
            if upper is not None or lower is not None:
                model.set_limits(index, old_lower if lower is None else lower, old_upper if upper is None else upper)
                self._changes.note((model.name, joint, "limits"), lambda: model.set_limits(index, old_lower, old_upper))
            if damping is not None:
                model.set_damping(index, damping)
                self._changes.note((model.name, joint, "damping"), lambda: model.set_damping(index, old_damping))
        except _REFUSALS as error:
            return SetJointPropertiesResponse(False, "SetJointProperties: %s" % error)
        rest = "; no counterpart here: %s" % ", ".join(ignored) if ignored else ""
        return SetJointPropertiesResponse(True, "SetJointProperties: properties set%s" % rest)


_INERTIA = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))


def _single(config, name):
    """The first value of a field of ODEJointProperties, or None if it is empty; joints have one axis."""
    values = list(getattr(config, name))
    if values and not np.isfinite(values[0]):
        raise ValueError("%s is %s, expected a finite number" % (name, values[0]))
    return values[0] if values else None
