#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Processes that a bench runs beside a lab: lab_part.py swing | press | client | busy | boxes N | empty |
answers FILE | posture | latency N | lockstep TICKS | hostile.

Each prints "up" when it is running.
"""
import hashlib
import json
import math
import random
import statistics
import struct
import sys
import tempfile
import time
from pathlib import Path

import roslib.message
import rospy
from baxter_core_msgs.msg import JointCommand
from bullet_sim_msgs.srv import AdvanceTicks
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, UInt16
from std_srvs.srv import Empty

from baxter_model import JOINTS, SIDES, joint_names, poses
from lab_testing.hostile_descriptions import chain, write_ball, write_entity_bomb
from lab_testing.waiting import beats, wait_until

# The same numbers on both arms.
NEUTRAL = tuple(poses().angles("neutral", "left").values())
# Both hands pulled against the body, where they stop.
PRESSING = {"s0": -1.7, "s1": -0.3, "e1": 2.6}
BOX = """<sdf version="1.6"><model name="box"><link name="link"><inertial><mass>0.5</mass><inertia><ixx>0.001</ixx>
<iyy>0.001</iyy><izz>0.001</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial><collision name="c"><geometry>
<box><size>0.1 0.1 0.1</size></box></geometry></collision></link></model></sdf>"""
BUSY_MODEL = """<robot name="busy"><link name="world"/>
<gazebo><plugin name="busy" filename="libbench_busy.so"/></gazebo></robot>"""
OF_MESH = """<robot name="hostile"><link name="l"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/>
</inertial><visual><geometry><mesh filename="%s"/></geometry></visual>
<collision><geometry><mesh filename="%s"/></geometry></collision></link></robot>"""
TICK_S = 0.002
COMMAND_TICKS = 5
ON_WAY_TICKS = 10  # longer than the robot's messages take
FIRST_TICK = 500  # by then all subscribers have connected, and the robot is at rest


def up():
    print("up", flush=True)


def command_arms(target):
    """Send position commands at 100 Hz: ``target(side, wall time)`` gives seven angles."""
    publishers = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1)
                  for side in SIDES}
    enable = rospy.Publisher("/robot/set_super_enable", Bool, latch=True, queue_size=1)
    enable.publish(True)
    up()
    for _ in beats(100.0, rospy.is_shutdown):
        for side, publisher in publishers.items():
            publisher.publish(JointCommand(JointCommand.POSITION_MODE, target(side, time.monotonic()),
                                           list(joint_names(side))))


def swing():
    command_arms(lambda side, now: [angle + 0.3 * math.sin(2.0 * now) for angle in NEUTRAL])


def press():
    def target(side, _):
        mirror = 1.0 if side == "left" else -1.0
        wanted = {**dict(zip(JOINTS, NEUTRAL, strict=True)), **PRESSING}
        wanted["s0"] *= mirror
        return [wanted[joint] for joint in JOINTS]

    command_arms(target)


def client():
    """A typical node of a lab: it follows the joint states in simulation time."""
    rospy.Subscriber("/robot/joint_states", JointState, lambda message: None, queue_size=1)
    rospy.wait_for_message("/robot/joint_states", JointState, timeout=60)
    up()
    rospy.spin()


def boxes(count):
    """Boxes on the floor in rows behind the robot. Prints "up" after the last has been spawned."""
    spawn = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)
    spawn.wait_for_service(60)
    for number in range(int(count)):
        place = Pose(position=Point(-2.0 - 0.3 * (number // 10), -1.5 + 0.3 * (number % 10), 0.05))
        place.orientation.w = 1.0
        answer = spawn("box_%d" % number, BOX, "", place, "world")
        if not answer.success:
            raise SystemExit(answer.status_message)
    up()


def busy():
    """A thread inside /gazebo that computes without pause, in Python: the plugin `busy_plugin`, which the bench
    registers."""
    spawn = rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)
    spawn.wait_for_service(60)
    answer = spawn("busy", BUSY_MODEL, "", Pose(), "")
    if not answer.success:
        raise SystemExit(answer.status_message)
    up()


def empty():
    """A node that does nothing, with a service that does nothing."""
    rospy.Service("/bench_empty", Empty, lambda request: {})
    up()
    rospy.spin()


def answers(path):
    """Services /bench_answers/NAME that return a fixed answer. path: JSON {name: (type, answer in hex)}."""
    for name, (kind, data) in json.loads(Path(path).read_text()).items():
        service = roslib.message.get_service_class(kind)
        answer = service._response_class().deserialize(bytes.fromhex(data))
        rospy.Service("/bench_answers/" + name, service, lambda request, answer=answer: answer)
    up()
    rospy.spin()


def posture():
    """The joint states of a robot at rest in its neutral posture, at the robot's own rate. The kinematics node listens
    from its first request on."""
    names = [name for side in SIDES for name in joint_names(side)]
    publisher = rospy.Publisher("/robot/joint_states", JointState, queue_size=1)
    up()
    for _ in beats(50.0, rospy.is_shutdown):
        message = JointState(name=names, position=2 * NEUTRAL)
        message.header.stamp = rospy.Time.now()
        publisher.publish(message)


def latency(count):
    """Lock-step: the number of ticks from the one that receives a command to the joint's first motion. Prints them as
    JSON."""
    rospy.Publisher("/robot/set_super_enable", Bool, latch=True, queue_size=1).publish(True)
    rospy.Publisher("/robot/joint_state_publish_rate", UInt16, latch=True, queue_size=1).publish(round(1 / TICK_S))
    topic = "/robot/limb/left/joint_command"
    commands = rospy.Publisher(topic, JointCommand, queue_size=1)
    states = {}

    def note(message):
        states[message.header.stamp] = message.position[message.name.index("left_w2")]

    rospy.Subscriber("/robot/joint_states", JointState, note)
    advance = rospy.ServiceProxy("/gazebo/advance", AdvanceTicks, persistent=True)
    advance.wait_for_service(60)
    wait_until(commands.get_num_connections, "the robot to subscribe", 60.0)
    rospy.ServiceProxy("/gazebo/pause_physics", Empty)()

    def position_after(ticks, await_topics=()):
        answer = advance(ticks, list(await_topics), 20.0)
        if not answer.success:
            raise SystemExit(answer.status_message)
        wait_until(lambda: answer.sim_time in states, "joint states of %s" % answer.sim_time.to_sec(), 20.0, 0.0005)
        return states[answer.sim_time]

    up()
    found, sign = [], 1.0
    position_after(1000)
    for _ in range(int(count)):
        rest = position_after(1000)
        commands.publish(JointCommand(JointCommand.POSITION_MODE, [0.2 * sign], ["left_w2"]))
        sign = -sign
        ticks, now = 1, position_after(1, [topic])
        while abs(now - rest) < 1e-6 and ticks < 100:
            ticks, now = ticks + 1, position_after(1)
        found.append(ticks)
    print(json.dumps({"ticks": found, "median": statistics.median(found)}), flush=True)


class LockStep:
    """Commands both arms of a world that was launched paused, tick by tick."""

    def __init__(self):
        self._topics = {side: "/robot/limb/%s/joint_command" % side for side in SIDES}
        self._publishers = {side: rospy.Publisher(topic, JointCommand, queue_size=1)
                            for side, topic in self._topics.items()}
        self._advance = rospy.ServiceProxy("/gazebo/advance", AdvanceTicks, persistent=True)
        self._advance.wait_for_service(60)
        for side, publisher in self._publishers.items():
            wait_until(publisher.get_num_connections, "the robot to subscribe to " + self._topics[side], 60.0)

    def send(self, mode, values):
        """Command the joints of both arms; values: {side: seven numbers}."""
        for side, publisher in self._publishers.items():
            publisher.publish(JointCommand(mode, list(values[side]), list(joint_names(side))))

    def step(self, count, after_commands=False):
        """Advance by this many ticks, after both arms' commands have arrived if the caller asks for it; returns the
        response."""
        answer = self._advance(count, list(self._topics.values()) if after_commands else [], 60.0)
        if not answer.success:
            raise SystemExit(answer.status_message)
        return answer


def lockstep(ticks):
    """Swing both arms of a world that was launched paused, for this many ticks, with a command for each arm every
    COMMAND_TICKS. Prints a digest of all joint states, and their number, as JSON."""
    states = {}

    def note(message):
        seconds, nanoseconds = struct.unpack_from("<II", message._buff, 4)
        # Without its sequence number, which counts from the first subscription on. A stamp may have two.
        stamp = 1_000_000_000 * seconds + nanoseconds
        states[stamp] = states.get(stamp, b"") + message._buff[4:]

    rospy.Subscriber("/robot/joint_states", rospy.AnyMsg, note)
    world = LockStep()
    up()
    begin = world.step(FIRST_TICK - world.step(1).tick).sim_time.to_nsec()
    for number in range(int(ticks) // COMMAND_TICKS):
        swing = 0.3 * math.sin(2.0 * number * COMMAND_TICKS * TICK_S)
        world.send(JointCommand.POSITION_MODE, dict.fromkeys(SIDES, [angle + swing for angle in NEUTRAL]))
        end = world.step(COMMAND_TICKS, after_commands=True).sim_time.to_nsec()
    world.step(ON_WAY_TICKS)
    wait_until(lambda: max(states, default=0) > end, "joint states after %d ns" % end, 60.0)
    counted = sorted(stamp for stamp in states if begin < stamp <= end)
    digest = hashlib.sha256(b"".join(states[stamp] for stamp in counted))
    print(json.dumps({"digest": digest.hexdigest(), "states": len(counted)}), flush=True)


def hostile():
    """Spawn and delete hostile descriptions: too large, endless, or with a false header. Prints the time to each answer
    [s] as JSON."""
    spawn = rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)
    delete = rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)
    spawn.wait_for_service(60)
    with tempfile.TemporaryDirectory() as folder:
        large, lie, bomb = (str(Path(folder) / name) for name in ("large.stl", "lie.stl", "bomb.dae"))
        write_ball(large, 548, radius=random.uniform(0.5, 1.5))  # in no cache
        write_ball(lie, 5, announced=2**32 - 1)
        write_entity_bomb(bomb)
        descriptions = {"600,000 triangles": OF_MESH % (large, large), "a header that lies": OF_MESH % (lie, lie),
                        "an entity bomb": OF_MESH % (bomb, bomb), "a device": OF_MESH % ("/dev/zero", "/dev/zero"),
                        "100,000 links": chain(100_000), "3,000 links": chain(3_000)}
        up()
        found = {}
        for what, description in descriptions.items():
            begin = time.monotonic()
            spawn("hostile", description, "", Pose(Point(5.0, 0.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0)), "")
            found[what] = time.monotonic() - begin
            delete("hostile")
    print(json.dumps(found), flush=True)


def main():
    name, *arguments = rospy.myargv(sys.argv)[1:]  # without the arguments that roslaunch adds
    rospy.init_node("bench_" + name, anonymous=True, disable_rostime=name not in ("client",))
    parts = (swing, press, client, boxes, busy, empty, answers, posture, latency, lockstep, hostile)
    {function.__name__: function for function in parts}[name](*arguments)


if __name__ == "__main__":
    main()
