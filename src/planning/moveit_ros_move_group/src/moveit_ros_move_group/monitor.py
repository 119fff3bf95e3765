# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the planning scene up to date with the topics and services that change it, and publishes its changes."""
from __future__ import annotations

import contextlib
import functools
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import rospy
import tf2_ros
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene, PlanningSceneWorld
from rospy.rostime import genpy  # of the stamps in messages
from sensor_msgs.msg import JointState

from command_line.options import counted
from motion_planning.errors import PlanningError
from motion_planning.scene import Scene
from moveit_ros_move_group.convert.geometry import MessageError, matrix_of
from moveit_ros_move_group.convert.octomap import octomap_message
from moveit_ros_move_group.convert.scene_in import SceneReader
from moveit_ros_move_group.convert.scene_out import scene_diff, scene_message

if TYPE_CHECKING:
    from octomap_msgs.msg import OctomapWithPose

    from motion_planning.model import PlanningModel
    from motion_planning.scene import Octree

# Time limit [s] for a frame that tf does not know yet, in wall time.
_NEWEST = rospy.Time()
_FRAME_TIMEOUT_S = 0.5
# After a frame that did not come, no other is waited for during this time [s]: a scene may name thousands.
_IMPATIENT_S = 1.0
# Default rate of publishing the scene [Hz].
_USUAL_HZ = 4.0
# Number of errors of one message that are logged one by one.
_TOLD = 10
_NAMES = {"joint_state_topic": "joint_states", "attached_collision_object_topic": "attached_collision_object",
          "planning_scene_topic": "planning_scene"}


class SceneMonitor:
    """The scene as it is now: what messages said, with the robot where its joint states say it is.

    continuous: names of the joints that turn without end. publishes, publishes_states: whether changes of the scene,
    and of the robot alone, are published, at most ``hz`` times per second. All methods may be called from any thread.
    """

    def __init__(self, model: PlanningModel, say_failure: Callable[[str, str], object],
                 topics: Mapping[str, str] | None = None) -> None:
        """say_failure(request, text): told what could not be applied. topics: {key of _NAMES: topic} of the node's own
        parameters."""
        self.model = model
        self.continuous = {name for name, turns in zip(model.variables, model.continuous, strict=True) if turns}
        self._say_failure = say_failure
        # Changes of the scene wait for each other, and may wait for tf; no other call waits for them.
        self._changing, self._lock, self._news = threading.RLock(), threading.RLock(), threading.Condition()
        self._scene, self._octomap = Scene(model), None
        self._values, self._stamps, self._updates = {}, {}, 0
        # Joints that a scene message has placed since any joint has moved.
        self._placed: set[str] = set()
        self._base, self._newest_stamp = np.eye(4), rospy.Time()
        self._listeners, self._clear_sensors = [], lambda: None
        self._asking = threading.local()
        self._buffer, self._patient_from = None, 0.0
        self.reader = SceneReader(self.tf_frame)
        options = rospy.get_param("~planning_scene_monitor_options", {})
        topics = {key: options.get(key, usual) for key, usual in {**_NAMES, **(topics or {})}.items()}
        if model.virtual_joint is not None:
            self._listen_to_tf()
        self._bounds_error = float(np.finfo(float).eps)
        settings = rospy.get_param("~planning_scene_monitor", {})
        self.publishes = bool(settings.get("publish_planning_scene", False))
        self.publishes_states = bool(settings.get("publish_state_updates", False))
        hz = settings.get("publish_planning_scene_hz", _USUAL_HZ)
        self.hz = hz if isinstance(hz, (int, float)) and 0.0 < hz < math.inf else _USUAL_HZ
        self._publisher = rospy.Publisher(options.get("monitored_planning_scene_topic", "~monitored_planning_scene"),
                                          PlanningScene, queue_size=100)
        self.joint_state_topic = rospy.resolve_name(topics["joint_state_topic"])
        self._subscribers = [
            rospy.Subscriber(topics["joint_state_topic"], JointState, self._on_joint_state, queue_size=25),
            rospy.Subscriber(topics["planning_scene_topic"], PlanningScene, self._on_scene, queue_size=100),
            rospy.Subscriber("collision_object", CollisionObject, self._on_object, queue_size=1024),
            rospy.Subscriber(topics["attached_collision_object_topic"], AttachedCollisionObject, self._on_attached,
                             queue_size=1024),
            rospy.Subscriber("planning_scene_world", PlanningSceneWorld, self._on_world, queue_size=10)]
        self._publishing = threading.Thread(target=self._publish_changes, daemon=True)
        self._publishing.start()

    # -- the scene ----------------------------------------------------------------------------------------------

    def scene(self, as_told: bool = False) -> Scene:
        """The Scene with the robot where it is now, joints without a joint state where the scene had them.

        as_told: joints that a scene message has placed stay there until a joint moves, as in MoveIt; for requests that
        move nothing.
        """
        with self._lock:
            scene = self._scene
            q = scene.state.q.copy()
            for name, value in self._values.items():
                if not (as_told and name in self._placed):
                    q[self.model.index[name]] = value
            state = scene.state.with_q(self._onto_limits(q))
            return scene.with_state(state.with_base(self._robot_base(state.base)))

    def octomap(self) -> OctomapWithPose | None:
        """The OctomapWithPose that the scene's octomap came with, or None."""
        octomap = self._octomap
        return octomap() if callable(octomap) else octomap

    def apply(self, message: PlanningScene, request: str) -> list[str]:
        """Apply a PlanningScene; return the list of sentences on what could not be. ``request`` names who asked."""
        # The poses of attached objects depend on the robot's posture.
        errors = self._change(lambda _: self.reader.with_planning_scene(self.scene(as_told=True), message), request,
                              message.world.octomap)
        joints = message.robot_state.joint_state
        with self._lock:
            q = self._scene.state.q
            self._placed |= {name for name, value in zip(joints.name, joints.position, strict=False)
                             if name in self.model.index and q[self.model.index[name]] == value}
        return errors

    def clear_octomap(self) -> None:
        self._clear_sensors()
        self._change(lambda scene: (scene.with_octomap(None), []), "clear_octomap")

    def set_octomap(self, octree: Octree | None, pose: np.ndarray) -> None:
        """Put an Octree, or None, at ``pose`` (4, 4) in the place of the scene's octomap."""
        stamp = rospy.Time.now()
        # Many maps come between two requests for one.
        message = None if octree is None else functools.cache(lambda: octomap_message(octree, pose, self.model.frame,
                                                                                      stamp))
        self._change(lambda scene: (scene.with_octomap(octree, pose), []), "octomap", message)

    def on_clear_octomap(self, clear: Callable[[], None]) -> None:
        """``clear()`` is called before the octomap is cleared."""
        self._clear_sensors = clear

    def change(self, function: Callable[[Scene], Scene], request: str) -> None:
        """Put ``function(scene)`` in the scene's place. Raises PlanningError and leaves the scene as it is."""
        with self._changing:
            self._replace(function(self._scene))
        self._tell()

    def on_change(self, listener: Callable[[], object]) -> None:
        """``listener()`` is called after each change of the scene that is not the robot's motion."""
        self._listeners.append(listener)

    def _change(self, function: Callable[[Scene], tuple[Scene, list[str]]], request: str,
                octomap: OctomapWithPose | Callable[[], OctomapWithPose] | None = None) -> list[str]:
        """Put the scene of ``function(scene)`` = (scene, errors) in the scene's place; return the errors.

        octomap: the OctomapWithPose that a new octomap comes from.
        """
        with self._changing:
            try:
                scene, errors = function(self._scene)
                self._replace(scene, octomap)
            except PlanningError as error:
                errors = [str(error)]
            except Exception as error:  # the node must survive any message
                errors = ["%s: %s" % (type(error).__name__, error)]
        for error in errors[:_TOLD]:
            self._say_failure(request, error)
        if len(errors) > _TOLD:
            self._say_failure(request, "%d more of this message could not be applied" % (len(errors) - _TOLD))
        self._tell()
        return errors

    def _replace(self, scene: Scene,
                 octomap: OctomapWithPose | Callable[[], OctomapWithPose] | None = None) -> None:
        with self._lock:
            if scene.octomap is not self._scene.octomap:
                self._octomap = None if scene.octomap is None else octomap
            self._scene = scene

    def _tell(self) -> None:
        for listener in self._listeners:
            listener()

    def _on_scene(self, message: PlanningScene) -> None:
        self.apply(message, "planning_scene")

    def _on_object(self, message: CollisionObject) -> None:
        self._change(lambda scene: (self.reader.with_collision_object(scene, message), []), "collision_object")

    def _on_attached(self, message: AttachedCollisionObject) -> None:
        self._change(lambda _: (self.reader.with_attached_object(self.scene(as_told=True), message), []),
                     "attached_collision_object")

    def _on_world(self, message: PlanningSceneWorld) -> None:
        self._change(lambda scene: self.reader.with_world(scene, message), "planning_scene_world", message.octomap)

    # -- the robot ----------------------------------------------------------------------------------------------

    def joint_values(self) -> dict[str, float]:
        """{joint: newest value} of the joints that have been heard of."""
        with self._lock:
            return dict(self._values)

    def joint_update(self) -> tuple[int, dict[str, float]]:
        """(number of the newest joint state, {joint: value})"""
        with self._lock:
            return self._updates, dict(self._values)

    def missing_joints(self) -> list[str]:
        """Joints of the model that no message has told a value of; passive ones do not count."""
        with self._lock:
            return [name for name in self.model.variables
                    if name not in self._values and name not in self.model.passive]

    def state_stamp(self) -> genpy.Time:
        """The stamp of the newest joint state."""
        return self._newest_stamp

    def wait_for_state(self, after: rospy.Time, timeout_s: float, joints: Sequence[str] = (),
                       given_up: Callable[[], bool] = lambda: False) -> str | None:
        """Wait in wall time until each of ``joints`` has a value no older than ``after`` (rospy.Time).

        Returns None if it came or the caller gave up, or the reason why it did not come.
        """
        deadline = time.monotonic() + timeout_s
        with self._news:
            while True:
                if rospy.is_shutdown() or given_up():
                    return None
                with self._lock:
                    late = [name for name in joints if self._stamps.get(name, rospy.Time()) < after
                            or name not in self._values]
                if not late:
                    return None
                rest = deadline - time.monotonic()
                if rest <= 0.0:
                    break
                self._news.wait(min(rest, 0.05))
        never = [name for name in late if name not in self._values]
        if never:
            return "no joint state has come for %s; is %s the right topic, and does every joint stand in it?" % (
                ", ".join(never), self.joint_state_topic)
        return "the newest joint state of %s is of %.3f s, older than the request (%.3f s); do clocks agree?" % (
            late[0], self._stamps[late[0]].to_sec(), after.to_sec())

    def _on_joint_state(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            rospy.logwarn_throttle(30.0, "a joint state on %s has %s but %s; it is left out"
                                   % (self.joint_state_topic, counted(len(message.name), "name"),
                                      counted(len(message.position), "position")))
            return
        stamp = message.header.stamp
        with self._lock:
            if stamp + rospy.Duration(1) < self._newest_stamp:
                self._stamps.clear()  # time has gone back, as by a reset of the simulation
            for name, value in zip(message.name, message.position, strict=True):
                if name in self.model.index and math.isfinite(value):
                    if self._placed and value != self._values.get(name, value):
                        self._placed.clear()
                    self._values[name], self._stamps[name] = value, stamp
            self._newest_stamp = stamp
            self._updates += 1
        with self._news:
            self._news.notify_all()

    def _onto_limits(self, q: np.ndarray) -> np.ndarray:
        low, high = self.model.bounds.T
        near = ~self.model.continuous & (q > low - self._bounds_error) & (q < high + self._bounds_error)
        return np.where(near, np.clip(q, low, high), q)

    def _robot_base(self, before: np.ndarray) -> np.ndarray:
        joint = self.model.virtual_joint
        if joint is None or joint.type == "fixed":
            return before
        try:
            assert self._buffer is not None  # such a robot's monitor listens from the start
            found = self._buffer.lookup_transform_core(joint.parent_frame, joint.child_link, rospy.Time())
            return matrix_of(found.transform)
        except (tf2_ros.TransformException, MessageError) as error:
            rospy.logwarn_throttle(30.0, "tf does not say where '%s' is in '%s' (%s); taken as the same"
                                   % (joint.child_link, joint.parent_frame, error))
            return before

    # -- frames -------------------------------------------------------------------------------------------------

    @contextlib.contextmanager
    def asking_for(self, given_up: Callable[[], bool]) -> Iterator[None]:
        """A context in which the thread's waits for frames end as soon as ``given_up()``."""
        self._asking.given_up = given_up
        try:
            yield
        finally:
            self._asking.given_up = None

    def tf_frame(self, name: str, stamp: genpy.Time = _NEWEST) -> np.ndarray:
        """Return the pose (4, 4) of a tf frame in the planning frame at ``stamp``. Raises PlanningError."""
        if "\0" in name:  # where tf2's library raises ValueError
            raise MessageError("%r is not a frame: it has a zero in it" % name)
        buffer = self._listen_to_tf()
        given_up = getattr(self._asking, "given_up", None)
        deadline = time.monotonic() + _FRAME_TIMEOUT_S
        while True:
            for known in (self.model.frame, self.model.root):
                try:
                    found = matrix_of(buffer.lookup_transform_core(known, name, stamp).transform)
                    return found if known == self.model.frame else self.scene().frame(known) @ found
                except tf2_ros.TransformException as error:
                    reason = str(error)
            now = time.monotonic()
            if now > deadline:
                self._patient_from = now + _IMPATIENT_S
            if now < self._patient_from or rospy.is_shutdown() or given_up is not None and given_up():
                if self.model.virtual_joint is not None and name == self.model.virtual_joint.parent_frame:
                    return np.eye(4)  # the robot's base, as its description says
                raise MessageError("'%s' is not a frame: neither of the robot, nor an object or subframe of the scene, "
                                   "nor does tf lead from it to '%s' (%s)" % (name, self.model.frame, reason))
            time.sleep(0.02)

    def _listen_to_tf(self) -> tf2_ros.Buffer:
        with self._lock:
            if self._buffer is None:
                self._buffer = tf2_ros.Buffer(debug=False)
                self._listener = tf2_ros.TransformListener(self._buffer)
            return self._buffer

    # -- what is published ---------------------------------------------------------------------------------------

    def _publish_changes(self) -> None:
        published = None
        while not rospy.is_shutdown():
            time.sleep(1.0 / self.hz)
            if not self.publishes:
                continue
            try:
                published = self._publish_change(published)
            except Exception as error:  # the next scene may be publishable
                if not rospy.is_shutdown():
                    rospy.logerr_throttle(30.0, "the scene could not be published: %s: %s"
                                          % (type(error).__name__, error))

    def _publish_change(self, published: Scene | None) -> Scene | None:
        scene, stamp = self.scene(), self.state_stamp()
        if published is None:
            self._publisher.publish(scene_message(scene, octomap=self.octomap(), stamp=stamp))
            return scene
        if np.array_equal(scene.state.q, published.state.q) and scene.state.attached is published.state.attached and \
                np.array_equal(scene.state.base, published.state.base) or not self.publishes_states and \
                scene.state.attached is published.state.attached:
            scene = scene.with_state(published.state)
        unchanged = scene.state is published.state and all(
            getattr(scene, name) is getattr(published, name)
            for name in ("objects", "allowed", "colours", "octomap", "transforms", "link_padding", "link_scale"))
        if not unchanged:
            self._publisher.publish(scene_diff(published, scene, stamp, self.octomap()))
        return scene
