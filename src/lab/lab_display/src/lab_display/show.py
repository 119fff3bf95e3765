# SPDX-License-Identifier: BSD-3-Clause
"""The functions of notebooks and `rosrun lab_display show`: they get data from ROS and pass it to the modules that
draw.

Call them in a process that is a ROS node. They raise ShowError if data does not arrive in time.
"""
from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import rosgraph
import rospy
import tf2_ros
from cv_bridge import CvBridge
from sensor_msgs.msg import Image, JointState

from baxter_interface import startup
from baxter_interface.waiting import Condition, wait_in_order
from live_plot.recording import PlotRecording
from urdf_model import Robot, parse_urdf
from urdf_model.transforms import matrix_from_quaternion, rigid
from world_picture.snapshot import SnapshotError

from . import joint_plot
from .matrices import FrameMatrix
from .outside import Outside
from .picture import Picture
from .trees import FrameTree

# Longest wait for a message or a picture [s, wall].
TIMEOUT_S = 30.0
#: A camera's first picture waits until the renderer, which gives way to all else, has made the shapes of the world.
PICTURE_TIMEOUT_S = 120.0
# A shorter wait for a frame, since its name may be wrong.
TRANSFORM_TIMEOUT_S = 10.0
JOINT_STATES = "/robot/joint_states"

# A renderer works only in the thread that made it.
_outside = threading.local()


class ShowError(Exception):
    """There is nothing to show; the text gives the reason."""


def picture(eye: Sequence[float] | None = None, target: Sequence[float] | None = None, frames: Sequence[str] = (),
            size: tuple[int, int] = (640, 480), length: float = 0.12) -> Picture:
    """The simulated world from outside, as a Picture; with the axes of tf frames in it (x red, y green, z blue).

    `eye`, `target`: position of the camera and the point it looks at [m, physics' world: the floor is at z = 0,
    Baxter's base at 0.93]; by default everything is in view. `size`: width and height [pixels]. `length` of the axes
    [m].
    """
    view = _view()
    _wait("a picture of the world", view.follow, "the simulator has written none yet")
    placed = {}
    if frames:
        root = robot().root
        root_pose = view.link_pose(root)
        if root_pose is None:
            raise ShowError("the world has no model whose root is '%s'" % root)
        with _transforms() as buffer:
            placed = {name: root_pose @ _transform(buffer, root, name) for name in frames}
    return Picture.of_array(view.look(*size, eye, target, placed, length))


def camera(name: str) -> Picture:
    """The newest image of a camera, as a Picture. `name`: a topic, or for /cameras/NAME/image: NAME."""
    topic = name if name.startswith("/") else "/cameras/%s/image" % name
    message = _message(topic, Image, "is the camera open? rosrun baxter_tools camera_control.py -l",
                       PICTURE_TIMEOUT_S)
    return Picture.of_array(CvBridge().imgmsg_to_cv2(message, "rgb8"))


class JointLog:
    """Positions of joints while a `with` block runs; `joints`: which ones, None for all."""

    def __init__(self, topic: str, joints: Sequence[str] | None) -> None:
        self._topic, self._joints = topic, joints
        self._recording = PlotRecording()
        self._subscriber: rospy.Subscriber | None = None
        self._arrived = threading.Event()

    def __enter__(self) -> JointLog:
        """Returns after the first message, so that no later one is missed."""
        self._subscriber = rospy.Subscriber(self._topic, JointState, self._take)
        try:
            _wait(self._topic, self._arrived.is_set, "nobody publishes it; rostopic list shows the topics")
        except ShowError:
            self._subscriber.unregister()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()

    def _take(self, message: JointState) -> None:
        for name, position in zip(message.name, message.position, strict=True):
            if self._joints is None or name in self._joints:
                self._recording.add(name)
                self._recording.append(name, message.header.stamp.to_sec(), position)
        self._arrived.set()

    @property
    def samples(self) -> dict[str, np.ndarray]:
        """{joint: (2, n) array of times [s] and positions}."""
        return self._recording.samples()[0]


def recording(topic: str = JOINT_STATES, joints: Sequence[str] | None = None) -> JointLog:
    """`with show.recording() as log: ...` records joint states; then `show.plot(log)`."""
    return JointLog(topic, joints)


def plot(log: JointLog, title: str = "", unit: str | dict[str, str] | None = None) -> Picture:
    """Joints over time, as a Picture. Without a unit, joints that slide are in metres and the others in radians."""
    samples = log.samples
    if unit is None:
        try:
            joints = robot().joints
        except ShowError:  # joint states without a description
            joints = {}
        sliding = {name for name, joint in joints.items() if joint.type == "prismatic"}
        unit = {name: "m" if name in sliding else "rad" for name in samples}
    return joint_plot.draw(samples, unit, title)


def robot(parameter: str = "robot_description") -> Robot:
    """The `urdf_model.Robot` on the parameter server."""
    try:
        # rospy.get_param uses a cache, which would be stale after a new simulator.
        text = rosgraph.Master(rospy.get_name()).getParam(rospy.resolve_name(parameter))
        return parse_urdf(str(text), source=parameter)
    except rosgraph.MasterError as error:
        raise ShowError("the parameter %s is not set: is a robot running?" % parameter) from error


def urdf_tree(parameter: str = "robot_description", below: str | None = None) -> FrameTree:
    """Links and joints of the robot's description, as a FrameTree: print it, or draw() it. `below`: from that link
    down."""
    tree = FrameTree.of_urdf(robot(parameter))
    return tree if below is None else tree.below(below)


def tf_tree(below: str | None = None) -> FrameTree:
    """Frames that tf knows, as a FrameTree. The robot's description tells which joints move."""
    description = robot()
    moving = {joint.child: joint.name for joint in description.joints.values() if joint.type != "fixed"}
    with _transforms() as buffer:
        def is_complete() -> bool:
            return set(description.links) <= {*_frames(buffer), *(parent for parent in _frames(buffer).values())}

        _wait("tf to name every link of the robot", is_complete, "robot_state_publisher has not sent all of them")
        tree = FrameTree({child: (parent, moving.get(child, ""), child in moving)
                          for child, parent in sorted(_frames(buffer).items())})
    return tree if below is None else tree.below(below)


def matrix(target: str, source: str) -> FrameMatrix:
    """The pose of frame `source` in frame `target`, as a FrameMatrix: print it, or use it as a (4, 4) array."""
    with _transforms() as buffer:
        return FrameMatrix(target, source, _transform(buffer, target, source))


@contextlib.contextmanager
def _transforms() -> Iterator[tf2_ros.Buffer]:
    buffer = tf2_ros.Buffer(debug=False)
    listener = tf2_ros.TransformListener(buffer)
    try:
        yield buffer
    finally:
        listener.unregister()


def _frames(buffer: tf2_ros.Buffer) -> dict[str, str]:
    """{frame: its parent}; lines are `Frame CHILD exists with parent PARENT.`"""
    words = [line.rstrip(".").split() for line in buffer.all_frames_as_string().splitlines()]
    return {line[1]: line[5] for line in words if len(line) == 6 and line[5] != "NO_PARENT"}


def _transform(buffer: tf2_ros.Buffer, target: str, source: str) -> np.ndarray:
    for name in (target, source):
        if "\0" in name:  # where tf2's library raises an error that does not name it
            raise ShowError("%r is not a frame: it has a zero in it" % name)

    def known() -> bool:
        return bool(buffer.can_transform_core(target, source, rospy.Time())[0])

    def why() -> str:
        names = sorted({*_frames(buffer), *_frames(buffer).values()})
        missing = [name for name in (target, source) if name not in names]
        return "tf knows no frame %s; it knows %s" % (" and no ".join(missing), ", ".join(names) or "none") if missing \
            else "they are not connected"

    _wait("the transform %s -> %s" % (target, source), known, why, TRANSFORM_TIMEOUT_S)
    transform = buffer.lookup_transform(target, source, rospy.Time()).transform
    rotation = matrix_from_quaternion([getattr(transform.rotation, axis) for axis in "xyzw"])
    return rigid(rotation, np.array([getattr(transform.translation, axis) for axis in "xyz"]))


def _view() -> Outside:
    try:
        folder = str(rosgraph.Master(rospy.get_name()).getParam("/gazebo/snapshot"))
        known = getattr(_outside, "view", None)
        if known is None or _outside.folder != folder or not known.is_alive:
            _outside.view, _outside.folder = Outside(folder, rospy.logwarn), folder
        return _outside.view
    except (rosgraph.MasterError, SnapshotError) as error:
        raise ShowError("no simulator on the master at %s: %s" % (rosgraph.get_master_uri(), error)) from error


def _message(topic: str, message_class: type, hint: str, timeout_s: float = TIMEOUT_S) -> Any:
    found, arrived = [], threading.Event()

    def take(message: object) -> None:
        found.append(message)
        arrived.set()

    subscriber = rospy.Subscriber(topic, message_class, take, queue_size=1, buff_size=1 << 24)
    try:
        _wait("a message on %s" % topic, arrived.is_set, hint, timeout_s)
    finally:
        subscriber.unregister()
    return found[-1]


def _wait(what: str, is_met: Callable[[], bool], hint: str | Callable[[], str],
          timeout_s: float = TIMEOUT_S) -> None:
    explain = hint if callable(hint) else lambda: hint
    try:
        wait_in_order([Condition(what, lambda: bool(is_met()), explain)], timeout_s, startup.LINE,
                      is_shutdown=rospy.is_shutdown, sleep=lambda _: time.sleep(0.02))
    except OSError as error:
        raise ShowError(error.strerror) from error
