# SPDX-License-Identifier: BSD-3-Clause
"""The arms' behaviour and reports in collisions, and what clients can suppress."""
import numpy as np
import pytest
from bullet_sim_msgs.srv import PressRequest
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Bool, Empty, Header
from trajectory_msgs.msg import JointTrajectoryPoint

from baxter_model import JOINTS
from baxter_sim_hardware.arms import collision, stopping

HEARD = ("state", "assembly/*", "limb/*/state", "head/state", "limb/*/collision_*_state")

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
SIDES = ("left", "right")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)


def avoidance(lab, side):
    return lab.last("limb/%s/collision_avoidance_state" % side)


def detected(lab, side):
    return lab.last("limb/%s/collision_detection_state" % side).collision_state


def suppress(lab, kind, rate_hz=10.0, sides=SIDES):
    """Function for `before`: send a suppress message at a rate."""
    period = round(1.0 / (rate_hz * lab.world.time_step_s))

    def send(lab):
        if lab.world.tick % period == 0:
            for side in sides:
                lab.send("limb/%s/%s" % (side, kind), Empty())

    return send


@pytest.fixture
def crossed(make_lab):
    """Both arms, stretched out, press against each other."""
    lab = make_lab(angles=np.zeros(14), meshes=True, parameters={"enable": True})
    lab.command(POSITION, [-1.5, 1.5], names=["left_s0", "right_s0"])
    lab.run(2.5)
    return lab


def test_free_arms_touch_nothing_and_are_in_no_collision(lab):
    lab.command(POSITION, lab.position + np.tile([0.3, 0.2, -0.3, 0.3, 0.5, -0.5, 0.5], 2))
    lab.run(1.0, after=lambda lab: None)
    for side in SIDES:
        states = lab.publishers["limb/%s/collision_avoidance_state" % side].messages
        assert not any(state.collision_object or state.other_arm for state in states)
        states = lab.publishers["limb/%s/collision_detection_state" % side].messages
        assert not any(state.collision_state for state in states)


def test_arms_that_touch_name_each_other_and_yield(crossed):
    for side, other in (SIDES, SIDES[::-1]):
        state = avoidance(crossed, side)
        assert state.other_arm and state.header.frame_id == "base"
        assert all(link.startswith((other, other[0] + "_gripper")) for link in state.collision_object)
    effort = np.abs(crossed.model.read_joints()[2][crossed.arm])
    gravity = np.abs(crossed.model.gravity_efforts()[crossed.arm])
    assert np.all(effort <= 0.3 * crossed.effort_limit + gravity + 1e-3)


@pytest.mark.parametrize("kind", [collision.AVOIDANCE, collision.BODY_AVOIDANCE])
def test_suppressed_avoidance_pushes_harder_until_it_is_no_longer_suppressed(crossed, kind):
    lab = crossed
    yielded = np.abs(lab.model.read_joints()[2][lab.arm][0])
    lab.run(1.0, before=suppress(lab, kind))
    pushed = np.abs(lab.model.read_joints()[2][lab.arm][0])
    if kind == collision.BODY_AVOIDANCE:  # which is not about the other arm
        assert pushed == pytest.approx(yielded, rel=0.2) and avoidance(lab, "left").collision_object
        return
    assert pushed > 2.0 * yielded
    assert not avoidance(lab, "left").collision_object and not avoidance(lab, "left").other_arm
    lab.run(collision.SUPPRESSION_S + 0.5)
    assert np.abs(lab.model.read_joints()[2][lab.arm][0]) < 1.5 * yielded
    assert avoidance(lab, "left").other_arm


def test_an_arm_pressed_hard_is_a_collision_unless_suppressed(crossed):
    lab = crossed
    lab.run(0.5, before=suppress(lab, collision.AVOIDANCE))
    assert detected(lab, "left") and detected(lab, "right")

    sends = [suppress(lab, kind) for kind in (collision.AVOIDANCE, collision.CONTACT, collision.OVERWRENCH)]

    def send_all(lab):
        for send in sends:
            send(lab)

    lab.run(0.5, before=send_all)
    assert not detected(lab, "left")
    lab.run(collision.SUPPRESSION_S + 0.1, before=suppress(lab, collision.AVOIDANCE))
    assert detected(lab, "left")


@pytest.mark.parametrize("mode, value", [(POSITION, 1.5), (VELOCITY, 1.0), (TORQUE, 40.0), (RAW, 1.5)])
@pytest.mark.parametrize("seconds", [0.73, 2.0])
def test_a_stop_holds_arms_that_meet_and_arms_that_press_on_each_other(make_lab, mode, value, seconds):
    """Stretched out, they meet after 0.73 s at full speed."""
    lab = make_lab(angles=np.zeros(14), meshes=True, parameters={"enable": True})
    names = ["left_s0", "right_s0"]
    lab.run(seconds, before=lambda lab: lab.command(mode, [-value, value], names=names))
    where = lab.position
    way = stopping.travel(lab.velocity, lab.plugin._baxter.arms.stopping()).max()
    lab.stop()
    position, velocity, _ = lab.record(0.6)
    assert np.abs(position - where).max() < 0.02 + way
    assert np.abs(position[100:] - position[100]).max() < 0.01  # 0.2 s later; they ease off each other a little
    assert np.abs(velocity[-1]).max() < 0.02


def test_an_arm_that_is_pushed_aside_is_a_collision_unless_that_is_suppressed(lab):
    """By 50 N at the hand: within the hand's limit, above that of the joints."""
    def push(lab):
        lab.model.apply_wrench("left_gripper", (0.0, 50.0, 0.0), position=lab.model.link_pose("left_gripper").position)

    def push_suppressed(lab):
        push(lab)
        suppress(lab, collision.CONTACT, sides=("left",))(lab)

    lab.run(0.3, before=push)
    assert detected(lab, "left") and not detected(lab, "right")
    lab.run(0.3, before=push_suppressed)
    assert not detected(lab, "left")
    lab.run(collision.SUPPRESSION_S - 0.2, before=push)
    assert not detected(lab, "left")
    lab.run(0.3, before=push)
    assert detected(lab, "left")


@pytest.mark.parametrize("force, found", [(50.0, False), (130.0, True)])
def test_a_hand_that_feels_too_much_is_a_collision(lab, force, found):
    """The push is along the line from the shoulder, so that the joints' torques stay small."""
    def push(lab):
        link = lab.model.link_pose("left_gripper")
        lab.model.apply_wrench("left_gripper", (0.0, 0.0, -force), position=link.position)
        suppress(lab, collision.CONTACT)(lab)

    lab.run(0.3, before=push)
    assert detected(lab, "left") == found and not detected(lab, "right")

    def calm(lab):
        push(lab)
        suppress(lab, collision.OVERWRENCH)(lab)

    lab.run(0.3, before=calm)
    assert not detected(lab, "left")


@pytest.mark.parametrize("links, side, expected", [
    ([], "left", ([], False)),
    ([("base", "left_wrist")], "left", (["base"], False)),
    ([("base", "left_wrist")], "right", ([], False)),
    ([("l_gripper_l_finger", "right_wrist")], "left", (["right_wrist"], True)),
    ([("l_gripper_l_finger", "right_wrist")], "right", (["l_gripper_l_finger"], True)),
    ([("left_lower_shoulder", "left_wrist")], "left", (["left_lower_shoulder", "left_wrist"], False)),
])
def test_touched(links, side, expected):
    assert collision.touched(links, side) == expected


@pytest.mark.parametrize("rate_hz, falls", [(5.0, True), (0.0, False)])
def test_gravity_compensation_suppressed_lets_a_torque_mode_arm_fall(lab, rate_hz, falls):
    start = lab.position
    send = suppress(lab, collision.GRAVITY, rate_hz, sides=("left",)) if rate_hz else lambda lab: None

    def stream(lab):
        lab.command(TORQUE, np.zeros(14))
        send(lab)

    lab.run(1.0, before=stream)
    moved = np.abs(lab.position - start)
    assert (moved[:7].max() > 0.3) == falls
    assert moved[7:].max() < 0.01
    if falls:  # and it is caught again when the messages stop
        lab.run(collision.SUPPRESSION_S + 0.4, before=lambda lab: lab.command(TORQUE, np.zeros(14)))
        lab.run(0.5)
        assert np.abs(lab.velocity).max() < 0.05


def squeeze(lab, side, pressed=True):
    action = PressRequest.PRESS if pressed else PressRequest.RELEASE
    assert lab.services["sim/press"](PressRequest("%s_lower_cuff" % side, action, 0)).success


@pytest.mark.parametrize("side", SIDES)
def test_a_squeezed_cuff_lets_the_arm_float_and_a_released_one_holds_it(lab, side):
    own = slice(0, 7) if side == "left" else slice(7, 14)
    squeeze(lab, side)
    lab.run(0.1)
    start = lab.position

    def push(lab):
        link = side + "_gripper"
        lab.model.apply_wrench(link, (0.0, 8.0, 0.0), position=lab.model.link_pose(link).position)

    lab.command(POSITION, start + 0.3)
    lab.run(0.6, before=push)
    assert any("its cuff is squeezed" in line for line in lab.log.lines)
    assert np.abs(lab.position - start)[own].max() > 0.1
    squeeze(lab, side, False)
    lab.run(0.4)
    rest = lab.position
    lab.run(0.5)
    assert np.abs(lab.position - rest)[own].max() < 1e-3
    lab.command(POSITION, rest)
    lab.run(0.1)


def test_a_squeezed_cuff_of_a_disabled_robot_does_nothing(lab):
    lab.enable(False)
    squeeze(lab, "left")
    lab.run(0.1)
    start = lab.position

    def push(lab):
        lab.model.apply_wrench("left_gripper", (0.0, 8.0, 0.0), position=lab.model.link_pose("left_gripper").position)

    lab.run(0.5, before=push)
    assert np.abs(lab.position - start).max() < 1e-3


def test_a_suppressed_cuff_does_nothing(lab):
    squeeze(lab, "left")
    start = lab.position

    def push(lab):
        suppress(lab, collision.CUFF)(lab)
        lab.model.apply_wrench("left_gripper", (0.0, 8.0, 0.0), position=lab.model.link_pose("left_gripper").position)

    lab.send("limb/left/" + collision.CUFF, Empty())
    lab.run(0.5, before=push)
    assert np.abs(lab.position - start).max() < 1e-3


def test_feed_forward_takes_the_lag_out_of_a_raw_stream(lab):
    """Set-points at 100 Hz are followed one command late; with their velocities they are followed at once."""
    def lag(with_velocity):
        lab.enable(False)
        lab.enable()
        lab.run(0.2)
        start, begin = lab.position, lab.world.time_s
        speed = 0.3

        def stream(lab):
            if lab.world.tick % 5 == 0:
                lab.command(RAW, start + speed * (lab.world.time_s - begin))
                for side in SIDES:
                    if with_velocity:
                        lab.send("limb/%s/inverse_dynamics_command" % side,
                                 JointTrajectoryPoint(velocities=[speed] * 7))

        lab.run(0.4, before=stream)
        return np.abs(start + speed * (lab.world.time_s - begin) - lab.position).max()

    assert lag(False) > 2e-3
    assert lag(True) < 1e-3


def test_feed_forward_of_the_time_before_a_reset_moves_nothing(lab):
    """After a reset of the clock its stamp is in the future, and its age is unchanged."""
    lab.enable()
    lab.run(0.5)
    for side in SIDES:
        lab.send("limb/%s/inverse_dynamics_command" % side, JointTrajectoryPoint(velocities=[1.0] * 7))
    lab.run(0.01)
    lab.world.reset_time()
    lab.plugin.reset()
    lab.enable()
    start = lab.position

    def stream(lab):
        if lab.world.tick % 5 == 0:
            lab.command(RAW, start)

    lab.run(0.3, before=stream)
    assert np.abs(lab.position - start).max() < 1e-3


def test_positions_alone_feed_nothing_forward(lab):
    lab.enable()
    lab.run(0.1)
    start, lines = lab.position, len(lab.log.lines)
    lab.send("limb/left/inverse_dynamics_command", JointTrajectoryPoint(positions=[1.0] * 7))
    lab.run(0.1)
    assert np.abs(lab.position - start).max() < 1e-4
    assert lab.log.lines[lines:] == []


@pytest.mark.parametrize("velocities", [[0.1] * 6, [float("nan")] * 7, []])
def test_senseless_feed_forward_is_refused(lab, velocities):
    lab.send("limb/left/inverse_dynamics_command", JointTrajectoryPoint(velocities=velocities))
    lab.run(0.01)
    assert "must have 7 finite numbers" in lab.log.lines[-1]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("frame, axis", [("base", (0.0, 0.1, 0.0)), ("tip", (0.1, 0.0, 0.0))])
def test_a_twist_moves_the_tip(lab, side, frame, axis):
    message = TwistStamped(header=Header(frame_id=side + "_gripper" if frame == "tip" else frame))
    message.twist.linear.x, message.twist.linear.y, message.twist.linear.z = axis
    lab.run(0.4, before=lambda lab: lab.send("limb/%s/command_twist_stamped" % side, message))
    linear, angular = lab.model.link_twist(side + "_gripper")
    rotation = lab.model.link_pose(side + "_gripper").matrix()[:3, :3] if frame == "tip" else np.eye(3)
    np.testing.assert_allclose(linear, rotation @ axis, atol=0.01)
    np.testing.assert_allclose(angular, 0.0, atol=0.03)
    lab.run(0.6)  # it expires
    assert np.abs(lab.velocity).max() < 1e-3


@pytest.mark.parametrize("frame", ["head", "/", "//base"])
def test_a_twist_in_another_frame_is_refused(lab, frame):
    message = TwistStamped(header=Header(frame_id=frame))
    message.twist.linear.x = 0.1
    lab.send("limb/left/command_twist_stamped", message)
    lab.run(0.1)
    assert "twist in frame '%s'" % frame in lab.log.lines[-1]
    assert np.abs(lab.velocity).max() < 1e-3


def test_velocity_to_zero_stops_one_limb(lab):
    goal = lab.position + np.tile([0.5, 0.3, 0.5, 0.5, 0.5, -0.5, 0.5], 2)
    lab.command(POSITION, goal)
    lab.run(0.3)
    lab.send("limb/left/command_velocity_tozero", Bool(True))
    lab.run(2.0)
    assert np.abs(lab.position - goal)[:7].max() > 0.1
    assert np.abs(lab.position - goal)[7:].max() < 1e-3
    assert np.abs(lab.velocity).max() < 1e-3


def test_assemblies_say_what_the_robot_says(lab):
    lab.stop()
    lab.run(0.05)
    wanted = lab.last("state")
    assert wanted.stopped
    for topic in (*("assembly/%s/state" % name for name in (*SIDES, "head", "torso")),
                  *("limb/%s/state" % side for side in SIDES), "head/state"):
        assert lab.last(topic) == wanted, topic
