# SPDX-License-Identifier: BSD-3-Clause
"""The scene follows what messages say; none of them holds up the others."""
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Pose, TransformStamped
from moveit_msgs.msg import CollisionObject, PlanningScene
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive

from lab_testing.waiting import wait_until
from motion_planning.errors import PlanningError
from motion_planning.model import PlanningModel
from moveit_ros_move_group import monitor as module
from moveit_ros_move_group.monitor import SceneMonitor

# As long as a slow machine may need: what is tested is the answer.
PATIENCE_S = 90.0


class Topic:
    """A publisher that keeps what it is given, after so many failures."""

    def __init__(self, *_, **__):
        self.heard, self.failures = [], 0

    def publish(self, message):
        if self.failures:
            self.failures -= 1
            raise ValueError("cannot be serialised")
        self.heard.append(message)


@pytest.fixture
def make(monkeypatch, model):
    """make(model, parameters): a SceneMonitor without a master; its threads end with the test."""
    shutdown, monitors = threading.Event(), []
    monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
    monkeypatch.setattr(rospy, "Publisher", Topic)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "is_shutdown", shutdown.is_set)
    monkeypatch.setattr(module.tf2_ros, "TransformListener", lambda buffer: None)

    def made(model=model, **parameters):
        monkeypatch.setattr(rospy, "get_param", lambda name, usual: parameters.get(name.lstrip("~"), usual))
        monitors.append(SceneMonitor(model, lambda request, text: None))
        return monitors[-1]

    yield made
    shutdown.set()
    for monitor in monitors:
        monitor._publishing.join(PATIENCE_S)


def box(name, frame):
    one = CollisionObject(id=name, primitives=[SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.1] * 3)],
                          primitive_poses=[Pose()])
    one.primitive_poses[0].orientation.w = one.pose.orientation.w = 1.0
    one.header.frame_id = frame
    return one


def scene(*objects):
    message = PlanningScene(is_diff=True)
    message.world.collision_objects = list(objects)
    return message


def until(condition):
    wait_until(condition, timeout_s=PATIENCE_S, interval_s=0.001)


def test_joint_states_come_in_while_a_scene_waits_for_a_frame(make, monkeypatch):
    asked, go_on = threading.Event(), threading.Event()

    def lookup(_, name, __):
        if name == "camera":
            asked.set()
            assert go_on.wait(PATIENCE_S)
        raise module.tf2_ros.LookupException("no such frame")

    monkeypatch.setattr(module.tf2_ros, "Buffer", lambda debug: SimpleNamespace(lookup_transform_core=lookup))
    monitor = make()
    thread = threading.Thread(target=monitor.apply, args=(scene(box("crate", "camera")), "test"))
    thread.start()
    assert asked.wait(PATIENCE_S)
    heard = threading.Thread(target=monitor._on_joint_state, args=(JointState(name=["turn"], position=[1.0]),))
    heard.start()
    heard.join(PATIENCE_S)
    assert not heard.is_alive() and monitor.joint_values() == {"turn": 1.0}
    assert monitor.scene().state.q[monitor.model.index["turn"]] == 1.0
    go_on.set()
    thread.join(PATIENCE_S)


def test_what_a_robot_stands_on_is_where_tf_has_it(make, monkeypatch, texts):
    """A fixed virtual joint: the robot is where its root is. Where tf knows nothing of its parent, both are one."""
    transforms = {}

    def lookup(to, name, _):
        if (to, name) not in transforms:
            raise module.tf2_ros.LookupException("no such frame")
        return transforms[to, name]

    monkeypatch.setattr(module.tf2_ros, "Buffer", lambda debug: SimpleNamespace(lookup_transform_core=lookup))
    monkeypatch.setattr(module, "_FRAME_TIMEOUT_S", 0.0)
    model = PlanningModel.from_xml(texts[0], texts[1].replace('type="floating"', 'type="fixed"'))
    monitor = make(model)
    assert model.frame == "base" and np.array_equal(monitor.tf_frame("world"), np.eye(4))
    transforms["base", "world"] = TransformStamped()
    transforms["base", "world"].transform.translation.z = -0.7
    transforms["base", "world"].transform.rotation.w = 1.0
    transforms["world", "base"] = TransformStamped()
    assert monitor.tf_frame("world")[2, 3] == -0.7
    assert np.array_equal(monitor.scene().state.base, np.eye(4))
    assert monitor.apply(scene(box("crate", "world")), "test") == []
    assert monitor.scene().objects["crate"].pose[2, 3] == -0.7


def test_frames_that_do_not_come_are_not_waited_for_one_by_one(make, monkeypatch):
    waits, asking = [], threading.get_ident()
    monitor = make()

    def sleep(seconds):
        if threading.get_ident() == asking:
            waits.append(seconds)
        else:  # the thread that publishes the scene
            time.sleep(seconds)

    now = iter(range(1000000))
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: 0.01 * next(now), sleep=sleep))
    errors = monitor.apply(scene(*[box("crate%d" % k, "nowhere%d" % k) for k in range(90)]), "test")
    assert len(errors) == 90 and all("is not a frame" in error for error in errors)
    assert len(waits) < 200


def test_a_scene_that_cannot_be_published_is_followed_by_others(make):
    monitor = make(planning_scene_monitor={"publish_planning_scene": True, "publish_planning_scene_hz": 200.0})
    monitor._publisher.failures = 2
    until(lambda: monitor._publisher.heard)
    assert not monitor._publisher.failures


@pytest.mark.parametrize("hz", [0, -5.0, "often", float("inf")])
def test_a_rate_that_is_none_counts_as_the_usual_one(make, hz):
    monitor = make(planning_scene_monitor={"publish_planning_scene_hz": hz})
    assert monitor.hz == 4.0


def test_joint_states_of_unequal_lists_are_left_out(make):
    monitor = make()
    monitor._on_joint_state(JointState(name=["turn", "reach"], position=[1.0]))
    assert monitor.joint_values() == {}


def test_a_frame_with_a_zero_is_refused_at_once_by_name(make, monkeypatch):
    """tf2's library raises an error of its own for such names."""
    monkeypatch.setattr(module, "_FRAME_TIMEOUT_S", PATIENCE_S)
    monitor = make()
    with pytest.raises(PlanningError, match=r"^'no\\x00where' is not a frame"):
        monitor.tf_frame("no\0where")
    assert monitor.apply(scene(box("crate", "no\0where"), box("tray", "world")), "test") == [
        "ADD of collision object 'crate' refused: 'no\\x00where' is not a frame: it has a zero in it"]
    assert list(monitor.scene().objects) == ["tray"]


def test_a_state_that_a_scene_message_tells_stays_until_a_joint_moves(make):
    """Clients put the robot somewhere by a scene and ask for plans from there; what moves the robot knows better."""
    monitor = make()
    turn = monitor.model.index["turn"]

    def told_and_measured():
        return monitor.scene(as_told=True).state.q[turn], monitor.scene().state.q[turn]

    monitor._on_joint_state(JointState(name=["turn"], position=[0.25]))
    message = scene(box("crate", "world"))
    message.robot_state.is_diff = True
    message.robot_state.joint_state.name, message.robot_state.joint_state.position = ["turn", "nobody"], [1.0, 2.0]
    assert monitor.apply(message, "test") == [] and told_and_measured() == (1.0, 0.25)
    monitor._on_joint_state(JointState(name=["turn"], position=[0.25]))
    assert monitor.apply(scene(box("tray", "world")), "test") == [] and told_and_measured() == (1.0, 0.25)
    monitor._on_joint_state(JointState(name=["turn"], position=[0.5]))
    assert told_and_measured() == (0.5, 0.5)


def test_a_state_that_is_refused_places_no_joint(make):
    monitor = make()
    turn = monitor.model.index["turn"]
    monitor._on_joint_state(JointState(name=["turn"], position=[0.25]))
    message = scene()
    message.robot_state.joint_state.name, message.robot_state.joint_state.position = ["turn"], [float("nan")]
    assert "not finite" in monitor.apply(message, "test")[0]
    assert monitor.scene(as_told=True).state.q[turn] == 0.25
