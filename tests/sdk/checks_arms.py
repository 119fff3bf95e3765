# SPDX-License-Identifier: BSD-3-Clause
"""Programs that move arms. A check returns what it measured, {name: number}, and raises AssertionError."""
import itertools
from functools import partial

import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryActionResult
from dynamic_reconfigure.client import Client
from robot import wait_until_heard
from std_msgs.msg import UInt16
from table import check

from baxter_model.names import MIRROR_SIGNS, SIDES, joint_names
from lab_testing.waiting import wait_until

# The keys of each arm's joints, in the order s0 ... w2: increase and decrease.
KEYS = {"left": ("98oilk.", "67yuhjn"), "right": ("43refdv", "12qwasz")}
GRIPPER_KEYS = {"left": ",m/", "right": "cxb"}  # close, open, calibrate
KEY_TRIES = 3  # the programs discard what is typed while they do not read; a user presses again
# axes of joystick.launch's sticks: the right arm's two, the left arm's two
STICKS = {"right": (0, 1), "left": (3, 4)}
BUMPER = {"right": 4, "left": 5}
TRIGGER = {"right": 2, "left": 5}  # the programs cross them: the left trigger is the right gripper's
HELP, HELD_S = 6, 0.3  # function1; how long it is held and released [s]
PUSH_N, PUSH_LIMIT_S = 6.0, 120.0  # [N, s]; a push that is not ended before
KNOCK_N, KNOCK_S, KNOCKED_RAD, RETURNED_RAD = 15.0, 0.2, 0.1, 0.03
# Pushes at the wrist of a floating arm, one after the other [N], each until a joint has moved by LEAD_RAD; how far how
# many joints have to be from their begin then.
LEADING_N, LEAD_RAD, LED_RAD, LED_JOINTS = ((0.0, 4.0, 0.0), (0.0, 0.0, 5.0)), 0.4, 0.1, 4
DAMPING = {"s0": 4.0, "s1": 4.0, "e0": 2.0, "e1": 2.0, "w0": 0.5, "w1": 0.5, "w2": 0.5}  # [Nm s/rad]
SPRINGS = "/rsdk_joint_torque_springs_left"  # the program and its parameters
# The largest that the program's settings allow [Nm/rad].
STIFFEST = {"s0": 30.0, "s1": 30.0, "e0": 15.0, "e1": 15.0, "w0": 9.0, "w1": 4.0, "w2": 4.0}
PLAYED = {"left_s0": 0.3, "left_w1": -0.3, "right_s0": -0.3, "right_w1": 0.3}


def press_key(program, key, spoken, timeout_s=60.0):
    """Press ``key`` until the program says that it has it; return how often it was lost.

    A command may keep the program from saying so for seconds of simulated time.
    """
    for lost in range(KEY_TRIES):
        seen = program.press(key, timeout_s)
        try:
            program.expect(spoken, timeout_s, seen)
            return lost
        except AssertionError:
            if lost == KEY_TRIES - 1:
                raise


def ask_for_help(stick, program):
    """Press the help button until the program answers: what a joystick sends before it is connected is lost."""
    seen, turns = len(program.output), itertools.cycle((lambda: stick.press(HELP), stick.release))

    def answered():
        next(turns)()
        return "Press Ctrl-C to quit." in program.output[seen:]

    wait_until(answered, "the answer to the joystick's help button", interval_s=HELD_S)
    stick.release()


@check("joint_position_keyboard.py")
def keyboard(lab):
    robot = lab.robot
    with lab.rosrun("baxter_examples", "joint_position_keyboard.py") as program:
        program.expect("Controlling joints")
        wait_until_heard("/rsdk_joint_position_keyboard", ["/robot/limb/%s/joint_command" % side for side in SIDES])
        lost, errors = 0, []
        for side in SIDES:
            for name, *keys in zip(joint_names(side), *KEYS[side], strict=True):
                for key, step, way in zip(keys, (0.1, -0.1), ("increase", "decrease"), strict=True):
                    goal = robot.angles[name] + step
                    lost += press_key(program, key, "command: %s %s" % (name, way))
                    errors.append(robot.wait_for_joint(name, goal, 0.03))
            for key, command, low, high in zip(GRIPPER_KEYS[side], ("close", "open", "calibrate"), (0, 95, 90),
                                               (5, 100, 100), strict=True):
                lost += press_key(program, key, "command: %s: gripper %s" % (side, command))
                robot.wait_for_gripper(side, low, high)
        program.press("\x1b")
        program.finish()
    return {"keys": 34, "keys_lost": lost, "off_rad": max(errors)}


@check("joint_position_joystick.launch xbox")
def joystick(lab):
    robot = lab.robot
    with lab.steered("joint_position_joystick.launch", "xbox", "Press Ctrl-C to stop") as (stick, program):
        ask_for_help(stick, program)
        beyond = 0.0
        for side in SIDES:
            order = joint_names(side)
            for _ in order:
                for axis, name in zip(STICKS[side], order[:2], strict=True):
                    start = robot.angles[name]
                    way = 1.0 if start <= lab.neutral[name] else -1.0
                    stick.push(axis, -way)
                    robot.wait_for_way(name, start, 0.1 * way)
                    stick.push(axis, 0.0)
                    at = robot.angles[name]
                    robot.wait_for_rest(name)
                    beyond = max(beyond, abs(robot.angles[name] - at))
                assert beyond < 0.3, "a joint went on by %.3f rad after its stick was released" % beyond
                seen = len(program.output)
                stick.press(BUMPER[side])
                program.expect("cycle joint", beyond=seen)
                stick.release()
                order = order[1:] + order[:1]
            stick.push(TRIGGER[side], -1.0)
            robot.wait_for_gripper(side, 0, 5)
            stick.push(TRIGGER[side], 1.0)
            robot.wait_for_gripper(side, 95, 100)
        program.stop()
    return {"beyond_rad": beyond}


@check("joint_position_waypoints.py")
def waypoints(lab):
    robot, offs = lab.robot, []
    with lab.rosrun("baxter_examples", "joint_position_waypoints.py", "-l", "left") as program:
        program.expect("Press Navigator 'Rethink'")
        places = []
        for change in (0.25, -0.4):
            robot.move_by("left", change)
            robot.press("left_button_ok", partial(program.expect, "Waypoint Recorded", beyond=len(program.output)))
            places.append({name: robot.angles[name] for name in joint_names("left")})
        robot.press("left_button_show", partial(program.expect, "Waypoint playback loop #1"))
        for _ in range(2):
            for place in places:
                offs.append(lab.at(place, 0.02, 60.0))
        program.stop()
    return {"off_rad": max(offs)}


@check("joint_velocity_wobbler.py")
def wobbler(lab):
    names = [name for side in SIDES for name in joint_names(side)]
    with lab.rosrun("baxter_examples", "joint_velocity_wobbler.py") as program:
        program.expect("Wobbling. Press Ctrl-C")
        watch = lab.robot.watch()
        wait_until(lambda: all(name in watch.high and watch.span(name) > 0.03 for name in names),
                   "all joints to swing")
        lab.robot.unwatch(watch)
        program.stop()
    least, fastest = min(map(watch.span, names)), max(watch.speed[name] for name in names)
    assert fastest < 0.5, "speeds up to %.2f rad/s" % fastest
    return {"least_swing_rad": least, "fastest_rad_s": fastest, "home_off_rad": lab.at(lab.neutral, 0.05)}


@check("joint_velocity_puppet.py")
def puppet(lab):
    """The arm is led as a person leads it: the cuff is squeezed, so that it floats, and the hand pushed."""
    robot = lab.robot
    with lab.rosrun("baxter_examples", "joint_velocity_puppet.py", "-l", "left") as program:
        program.expect("Puppeting:")
        names = {"left_" + joint: ("right_" + joint, sign) for joint, sign in MIRROR_SIGNS.items()}
        for name in names:
            robot.wait_for_rest(name)
        before = dict(robot.angles)
        for force in LEADING_N:
            robot.press("left_lower_cuff", partial(lead, robot, tuple(names), force))
            for name in names:
                robot.wait_for_rest(name)

        def shares():
            """Of the joints that were led far enough: {joint: the other arm's motion by this one's}."""
            return {led: (robot.angles[follows] - before[follows]) / (sign * (robot.angles[led] - before[led]))
                    for led, (follows, sign) in names.items() if abs(robot.angles[led] - before[led]) > LED_RAD}

        wait_until(lambda: all(0.8 < share < 1.2 for share in shares().values()),
                   lambda: "the other arm to follow; its shares of the motion: %s" % shares())
        ratios, led = shares(), max(abs(robot.angles[name] - before[name]) for name in names)
        program.stop()
    assert len(ratios) >= LED_JOINTS, "only %s moved by more than %g rad" % (", ".join(ratios), LED_RAD)
    return {"least_share": min(ratios.values()), "largest_share": max(ratios.values()), "joints": len(ratios),
            "led_rad": led}


def lead(robot, names, force):
    """Push the hand of the floating left arm until one of its joints is LEAD_RAD from where it was."""
    start = {name: robot.angles[name] for name in names}
    robot.push("left_wrist", force, PUSH_LIMIT_S)
    wait_until(lambda: robot.off(start) > LEAD_RAD, "the arm to give way to %s N" % (force,))
    robot.release("left_wrist")


@check("joint_torque_springs.py")
def springs(lab):
    robot = lab.robot
    rate = rospy.Publisher("/robot/joint_state_publish_rate", UInt16, queue_size=1, latch=True)
    rate.publish(100)  # as the robot starts
    # What a run sets stays on the master, and the next one starts with it.
    if rospy.has_param(SPRINGS):
        rospy.delete_param(SPRINGS)
    with lab.rosrun("baxter_examples", "joint_torque_springs.py", "-l", "left") as program:
        program.expect("Running. Ctrl-c to quit")
        home = {name: lab.neutral[name] for name in joint_names("left")}
        wait_until(lambda: robot.off(home) < 0.03, "the neutral pose")
        settings = Client(SPRINGS, timeout=90.0)
        settings.update_configuration({joint + "_damping_coefficient": value for joint, value in DAMPING.items()})

        def deflection():
            robot.push("left_wrist", (0.0, 0.0, PUSH_N), PUSH_LIMIT_S)
            lab.wait_for_off(home, 0.05, "a push of %g N to move the arm" % PUSH_N)
            deflected = lab.settled_off(home)
            robot.release("left_wrist")
            return deflected, lab.settled_off(home)

        soft, back = deflection()
        robot.push("left_wrist", (0.0, 0.0, KNOCK_N), KNOCK_S)
        knocked = lab.wait_for_off(home, KNOCKED_RAD, "a knock of %g N to move the arm" % KNOCK_N)
        returned = lab.time_until_near(home, RETURNED_RAD)
        settings.update_configuration({joint + "_spring_stiffness": value for joint, value in STIFFEST.items()})
        stiff, stiff_back = deflection()
        ended = program.stop()
    assert soft > 0.1 and stiff < 0.8 * soft, "%g N deflect soft springs by %.3f rad, stiff ones by %.3f" % (
        PUSH_N, soft, stiff)
    assert max(back, stiff_back) < 0.03, "the arm came back to %.3f and %.3f rad" % (back, stiff_back)
    return {"soft_rad": soft, "stiff_rad": stiff, "back_rad": max(back, stiff_back), "knocked_rad": knocked,
            "returned_s": returned, "ended_s": ended}


@check("joint_recorder.py")
def recorder(lab):
    lab.recording = None
    path, robot = lab.folder / "recorded.csv", lab.robot
    with lab.rosrun("baxter_examples", "joint_recorder.py", "-f", str(path)) as program:
        program.expect("Recording. Press Ctrl-C")
        begin = rospy.get_time()
        watch = robot.watch()
        robot.move({name: lab.neutral[name] + change for name, change in PLAYED.items()})
        robot.press("left_upper_button", lambda: robot.wait_for_gripper("left", 0, 5))
        robot.press("left_lower_button", lambda: robot.wait_for_gripper("left", 95, 100))
        robot.move({name: lab.neutral[name] + 0.3 * change for name, change in PLAYED.items()})
        for name in PLAYED:
            robot.wait_for_rest(name)
        seconds = rospy.get_time() - begin
        robot.unwatch(watch)
        program.stop()
    names, *lines = path.read_text().splitlines()
    names = names.split(",")
    rows = [[float(word) for word in line.split(",")] for line in lines if line.count(",") == len(names) - 1]
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    rows_per_s = len(rows) / (rows[-1][0] - rows[0][0])
    off = max(abs(max(columns[n]) - watch.high[n]) + abs(min(columns[n]) - watch.low[n]) for n in PLAYED)
    assert len(names) == 17 and rows[-1][0] - rows[0][0] > seconds - 1.0, "%d columns, %.1f s of %.1f" % (
        len(names), rows[-1][0], seconds)
    assert 90.0 < rows_per_s < 110.0, "%.1f rows a second" % rows_per_s
    assert off < 0.03 and min(columns["left_gripper"]) < 5 < 95 < max(columns["left_gripper"]), "%.3f rad off" % off
    lab.recording = (path, columns)
    return {"rows_per_s": rows_per_s, "off_rad": off}


def judge_playback(lab, watch, tolerance):
    """How far peaks, ends [rad] and grippers [%] are from the recording's."""
    _, columns = lab.recording
    peaks = max(max(abs(watch.high[n] - max(columns[n])), abs(watch.low[n] - min(columns[n]))) for n in PLAYED)
    end = max(abs(lab.robot.angles[n] - columns[n][-1]) for n in PLAYED)
    percents = abs(min(watch.percents["left"]) - min(columns["left_gripper"]))
    assert max(peaks, end) < tolerance and percents < 8.0, "peak %.3f, end %.3f rad, gripper %.1f %% off" % (
        peaks, end, percents)
    return {"peak_off_rad": peaks, "end_off_rad": end, "gripper_off_percent": percents}


@check("joint_position_file_playback.py")
def position_playback(lab):
    lab.need_recording(recorder)
    watch = lab.robot.watch()
    with lab.rosrun("baxter_examples", "joint_position_file_playback.py", "-f", str(lab.recording[0])) as program:
        program.finish()
    lab.robot.unwatch(watch)
    return judge_playback(lab, watch, 0.03)


@check("joint_trajectory_file_playback.launch")
def trajectory_playback(lab):
    lab.need_recording(recorder)
    watch = lab.robot.watch()
    with lab.roslaunch("baxter_examples", "joint_trajectory_file_playback.launch",
                       "file_path:=%s" % lab.recording[0]) as program:
        program.expect("Exiting - File Playback Complete")
        assert "failed or did not finish" not in program.output, program.output[-300:]
        for name in PLAYED:
            lab.robot.wait_for_rest(name)
        measured = judge_playback(lab, watch, 0.04)
        program.stop()
    lab.robot.unwatch(watch)
    return measured


def last_point(side):
    """{joint: angle [rad]} of the client's last point in 1.2.0."""
    first = (-0.11, -0.62, -1.15, 1.32, 0.80, 1.27, 2.39)
    return {side + "_" + joint: 1.25 * angle * (sign if side == "right" else 1)
            for (joint, sign), angle in zip(MIRROR_SIGNS.items(), first, strict=True)}


def judge_client(lab, side, program, tolerance):
    results = []
    listener = rospy.Subscriber("/robot/limb/%s/follow_joint_trajectory/result" % side,
                                FollowJointTrajectoryActionResult, results.append)
    program.expect("Exiting - Joint Trajectory Action Test Complete")
    wait_until(lambda: results, "the goal's result")
    listener.unregister()
    off = lab.robot.off(last_point(side))
    assert results[-1].status.status == GoalStatus.SUCCEEDED, results[-1]
    assert off < tolerance, "%.3f rad off its last point" % off
    return {"off_rad": off}


def client(lab, mode, tolerance):
    with lab.rosrun("baxter_interface", "joint_trajectory_action_server.py", "-l", "left", "-m", mode) as server:
        server.expect("Running. Ctrl-c to quit")
        with lab.rosrun("baxter_examples", "joint_trajectory_client.py", "-l", "left") as program:
            measured = judge_client(lab, "left", program, tolerance)
            program.finish()
        server.stop()
    return measured


@check("joint_trajectory_client.py position")
def client_position(lab):
    return client(lab, "position", 0.05)


@check("joint_trajectory_client.py position_w_id")
def client_position_w_id(lab):
    return client(lab, "position_w_id", 0.05)


@check("joint_trajectory_client.py velocity")
def client_velocity(lab):
    return client(lab, "velocity", 0.3)  # their controller leaves its last velocity by its gain of 2 /s


@check("joint_trajectory_client.launch")
def client_launch(lab):
    with lab.roslaunch("baxter_examples", "joint_trajectory_client.launch") as program:
        measured = judge_client(lab, "right", program, 0.05)
        program.stop()
    return measured
