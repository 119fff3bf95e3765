# SPDX-License-Identifier: BSD-3-Clause
"""Every motion of the robot, interrupted in every way: afterwards nothing moves until a new command comes."""
import random

import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorCommand, HeadPanCommand
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Empty

HEARD = ("state", "sim/resets")

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
SIDES = ("left", "right")
WAY = np.tile([0.4, -0.4, 0.3, 0.4, -0.4, 0.4, 0.5], 2)
PUSH = np.tile([3.0, -3.0, 2.0, 3.0, -0.3, 0.3, 0.2], 2)  # [Nm]
# So long a motion goes on before it is interrupted [s].
UNDER_WAY_S = 0.3
# A braking joint rests within this time and distance; a command that is still valid is followed to its end.
BRAKING_S, BRAKING_RAD, END_S = 0.5, 0.1, 2.5
# A holding joint moves by no more than this [rad; m] in this time.
STILL, HOLD_S = 1e-3, 0.3
# Rest is looked for after each of these times [s].
LOOK_S = 0.05


def stream(mode, values):
    """A program that sends ``values(lab, share of the way)`` at each tick."""
    def beat(lab, start, time_s):
        lab.command(mode, values(start, min(time_s / 1.0, 1.0)))

    return beat


def once(send):
    """A command that is sent once."""
    def beat(lab, start, time_s):
        if time_s == 0.0:
            send(lab, start)

    return beat


def twist(lab, start, time_s):
    for side in SIDES:
        message = TwistStamped()
        message.header.frame_id = "base"
        message.twist.linear.z = -0.2
        lab.send("limb/%s/command_twist_stamped" % side, message)


def close_gripper(lab, start):
    lab.numbers = getattr(lab, "numbers", 0)
    for command, arguments in (("set", '{"velocity": 15.0}'), ("go", '{"position": 0.0}')):
        lab.numbers += 1
        lab.send("end_effector/left_gripper/command", EndEffectorCommand(
            id=65538, command=command, args=arguments, sender="test", sequence=lab.numbers))


MOTIONS = {
    "position, a goal far away": once(lambda lab, start: lab.command(POSITION, start + WAY)),
    "position, a stream": stream(POSITION, lambda start, share: start + share * WAY),
    "raw position, a stream": stream(RAW, lambda start, share: start + share * WAY),
    "raw position, a goal far away": stream(RAW, lambda start, share: start + WAY),
    "velocity": stream(VELOCITY, lambda start, share: WAY),
    "torque": stream(TORQUE, lambda start, share: PUSH),
    "twist": twist,
    "head": once(lambda lab, start: lab.send("head/command_head_pan", HeadPanCommand(
        target=1.2, speed_ratio=0.1, enable_pan_request=HeadPanCommand.REQUEST_PAN_ENABLE))),
    "gripper": once(close_gripper),
}


def reset_world(lab):
    lab.world.reset_models()
    lab.plugin.reset()


def reset_simulation(lab):
    lab.world.reset_models()
    lab.world.reset_time()
    lab.plugin.reset()


def put_joints(lab):
    lab.model.set_joint_positions(lab.arm, lab.model.read_joints()[0][lab.arm] + 0.1)
    lab.plugin.joints_set()


def estop(lab):
    lab.plugin._robot.press_estop(True)


def estop_and_back(lab):
    estop(lab)
    lab.run(0.1)
    lab.plugin._robot.press_estop(False)
    lab.run(0.1)
    lab.send("set_super_reset", Empty())
    lab.run(0.1)


def disable_and_enable(lab):
    lab.enable(False)
    lab.run(0.1)
    lab.enable()


def stop_and_enable(lab):
    lab.stop()
    lab.run(0.1)
    lab.send("set_super_reset", Empty())
    lab.run(0.01)
    lab.enable()


def halt(lab):
    """The command of action servers when a goal ends early."""
    lab.command(VELOCITY, np.zeros(len(WAY)))


def other_mode(lab):
    """A command to one joint of each arm takes its arm over."""
    names = [side + "_w2" for side in SIDES]
    lab.command(TORQUE, [0.0, 0.0], names)


# {name: (interruption, whether moving joints brake at once)}. After a program has ended, its last position command
# stays valid.
INTERRUPTIONS = {
    "reset_world": (reset_world, True), "reset_simulation": (reset_simulation, True),
    "joints set": (put_joints, True), "disable": (lambda lab: lab.enable(False), True),
    "disable and enable": (disable_and_enable, True), "stop": (lambda lab: lab.stop(), True),
    "stop, reset and enable": (stop_and_enable, True), "emergency stop": (estop, True),
    "emergency stop and back": (estop_and_back, True), "halt": (halt, False), "other mode": (other_mode, False),
    "lost publisher": (lambda lab: None, False),
}
# Commands of the arms do not affect the head and the gripper.
PAIRS = [(motion, interruption) for motion in MOTIONS for interruption in INTERRUPTIONS
         if not (motion in ("head", "gripper") and interruption in ("halt", "other mode"))]


def as_new(lab):
    lab.plugin._robot.press_estop(False)
    lab.send("set_super_reset", Empty())
    lab.run(0.01)
    reset_world(lab)
    for subscribed in lab.subscriptions.values():
        for subscription in subscribed.all:
            subscription.drain()
    lab.enable()
    lab.run(0.05)
    assert lab.last("state").enabled


def move(lab, name, seconds=UNDER_WAY_S):
    start, begin_s = lab.position, lab.world.time_s
    before = joints(lab)
    lab.run(seconds, before=lambda lab: MOTIONS[name](lab, start, round(lab.world.time_s - begin_s, 6)))
    return farthest(lab, before)


def joints(lab):
    return lab.model.read_joints()[0].copy()


def farthest(lab, before):
    return float(np.abs(joints(lab) - before).max())


def run_until(lab, condition, limit_s):
    """Until ``condition(joints before the last LOOK_S)``, or for so long."""
    end_s, met = lab.world.time_s + limit_s, False
    while not met and lab.world.time_s < end_s:
        before = joints(lab)
        lab.run(LOOK_S)
        met = condition(before)


def assert_rests(lab, brakes, what):
    """``brakes``: whether it must be near where it was interrupted."""
    here = joints(lab)
    run_until(lab, lambda before: farthest(lab, before) < 0.1 * STILL, BRAKING_S if brakes else END_S)
    if brakes:
        assert farthest(lab, here) < BRAKING_RAD, "%s: moved on" % what
    here = joints(lab)
    lab.run(HOLD_S)
    assert farthest(lab, here) < STILL, "%s: moves without a command" % what


@pytest.mark.parametrize("motion, interruption", PAIRS)
def test_nothing_moves_after_an_interruption_until_a_new_command(one_lab, motion, interruption):
    lab, (interrupt, brakes) = one_lab, INTERRUPTIONS[interruption]
    as_new(lab)
    assert move(lab, motion) > 3 * STILL
    interrupt(lab)
    lab.run(0.002)
    assert_rests(lab, brakes, "%s, %s" % (motion, interruption))
    # Enabled again, it stays where it is; and then it obeys.
    lab.plugin._robot.press_estop(False)
    lab.send("set_super_reset", Empty())
    lab.run(0.01)
    lab.enable()
    assert_rests(lab, True, "%s, %s, enabled again" % (motion, interruption))
    goal = lab.position + 0.05 * np.sign(WAY)
    lab.command(POSITION, goal)
    run_until(lab, lambda before: np.abs(lab.position - goal).max() < 1e-3, 1.0)
    assert np.abs(lab.position - goal).max() < 2e-3


@pytest.mark.parametrize("interruption", ["reset_world", "reset_simulation", "joints set"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_commands_that_came_before_a_reset_do_not_act_after_it(one_lab, motion, interruption):
    """Read together with the request, in the same turn of the loop."""
    lab = one_lab
    as_new(lab)
    MOTIONS[motion](lab, lab.position, 0.0)
    INTERRUPTIONS[interruption][0](lab)
    here = joints(lab)
    lab.run(HOLD_S)
    assert farthest(lab, here) < STILL


@pytest.mark.parametrize("seed", range(3))
def test_no_sequence_of_motions_and_interruptions_leaves_anything_moving(one_lab, seed):
    lab, source, done = one_lab, random.Random(seed), []
    as_new(lab)
    for _ in range(8):
        motion, interruption = source.choice(list(MOTIONS)), source.choice(list(INTERRUPTIONS))
        done.append((motion, interruption))
        move(lab, motion, source.uniform(0.05, 0.4))
        interrupt, brakes = INTERRUPTIONS[interruption]
        interrupt(lab)
        lab.run(0.002)
        assert_rests(lab, brakes, "seed %d, %s" % (seed, done))


def test_who_waits_for_it_is_told_of_each_time_that_the_joints_are_put_elsewhere(make_lab):
    lab = make_lab()
    lab.run(0.1)
    for put in (reset_world, reset_simulation, put_joints):
        before = lab.last("sim/resets").data
        put(lab)
        assert lab.last("sim/resets").data != before
    before = lab.last("sim/resets").data
    assert make_lab().last("sim/resets").data != before  # another robot in its place


def test_an_arm_that_has_collided_takes_commands_after_a_reset_of_the_time(make_lab):
    lab = make_lab(parameters={"enable": True})
    lab.run(1.0)
    lab.plugin._baxter.halt("left", 2.0)
    assert lab.plugin._baxter.halted("left")
    reset_simulation(lab)
    assert lab.world.time_s < 1.0 and not lab.plugin._baxter.halted("left")
