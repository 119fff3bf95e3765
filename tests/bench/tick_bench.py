# SPDX-License-Identifier: BSD-3-Clause
"""A whole tick of /gazebo with Baxter, compared with the physics step in it: CPU time of the loop's thread, without
subscribers, both arms swinging in free space with self-collision. It runs without a master and takes the least of many
turns, so that a busy machine gives the same figure. The suite `physics` measures the same with all other parts of a
lab."""
import contextlib
import time
from types import SimpleNamespace

import numpy as np
from arms import expanded
from baxter_core_msgs.msg import JointCommand

from baxter_model import SIDES, joint_names, poses
from baxter_sim_hardware.plugin import BaxterPlugin
from bullet_sim import Pose, World
from bullet_sim.solids import with_solids
from gazebo_ros.model_plugin import PluginContext, PluginHost, PluginSource
from gazebo_ros.publications import SimulationPublications
from gazebo_ros.simulation import HostedPlugin, Simulation
from loop_ros.faults import Faults
from loop_ros.publisher import LoopPublisher, PublisherHub
from loop_ros.request_queue import RequestQueue
from loop_ros.subscription import MessageQueue
from model_files.resources import ResourceFinder
from urdf_model import Box, Inertial, Link, Robot, Shape, parse_urdf
from world_picture.snapshot import SnapshotWriter

# The same numbers on both arms.
NEUTRAL = tuple(poses().angles("neutral", "left").values())
NAMES = {side: list(joint_names(side)) for side in SIDES}
TICKS = 50  # of a turn; each turn begins with a command for each arm, as at ten times real time and 100 Hz
TURNS = 100
ASLEEP_TICKS = 2500
SLEEPERS = 100


class _Ros:
    """Topics without subscribers."""

    def __init__(self):
        self.hub, self.subscriptions, self._reads = PublisherHub(), {}, 0

    def publisher(self, topic, msg_class, latch=False, greet=False):
        return LoopPublisher(self.hub, topic, msg_class, latch=latch, greet=greet)

    def subscription(self, topic, msg_class, depth=1, notice=lambda: None):
        return self.subscriptions.setdefault(topic, MessageQueue(depth, notice))

    def reads(self):
        self._reads += 1
        return self._reads

    def service(self, name, srv_class, handler):
        return SimpleNamespace(close=lambda: None)


def _refuse(text):
    raise SystemExit("tick: /gazebo logs an error, so its figures would mean nothing: %s" % text)


class BareWorld:
    """The robot on the floor without commands, as a context. Attributes ``world``, ``model``, ``robot``."""

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            self._build(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def _build(self, stack):
        self.world = World(find_mesh=ResourceFinder())
        stack.callback(self.world.close)
        self.world.add_ground_plane()
        self.robot = parse_urdf(expanded("baxter_description", "baxter.urdf.xacro"), source="baxter")
        options = BaxterPlugin.spawn_options(self.robot, None)
        self.model = self.world.spawn(with_solids(self.robot, options.pop("solids")), "baxter", Pose((0, 0, 0.93)),
                                      **options)
        for names in NAMES.values():
            self.model.set_joint_positions(self.model.index(names), np.array(NEUTRAL))


class Loop(BareWorld):
    """The parts of the node /gazebo, without the node."""

    def _build(self, stack):
        super()._build(stack)
        writer = SnapshotWriter()
        stack.callback(writer.close)
        ros, log = _Ros(), SimpleNamespace(info=lambda text: None, warn=print, error=_refuse)
        source, host = PluginSource(self.robot, None, "/robot"), PluginHost(add_screen=lambda *_: None)
        parameters = {"baxter_sim_hardware": {"enable": True}}
        context = PluginContext(self.world, self.model, source, log, ros, parameters, host)
        self._subscriptions = ros.subscriptions
        self._simulation = Simulation(self.world, RequestQueue(), log, Faults(log), real_time_factor=0.0)
        publications = SimulationPublications(self._simulation, ros, writer, log, clock_rate=500.0)
        self._simulation.on_turn, self._simulation.on_tick = publications.on_turn, publications.on_tick
        self._simulation.host(HostedPlugin(BaxterPlugin(context), context, self.model.name, "Baxter"))
        self._step, self._stepping_s = self.world.step, 0.0
        self.world.step = self._timed_step

    def turn(self):
        """Let both arms follow a new command for TICKS ticks; return (CPU of a tick, of the step in it) [us]."""
        swing = 0.3 * np.sin(0.0004 * self._simulation.tick)
        for side, names in NAMES.items():
            self._subscriptions["/robot/limb/%s/joint_command" % side].put(
                JointCommand(JointCommand.POSITION_MODE, [angle + swing for angle in NEUTRAL], names))
        self._stepping_s, end = 0.0, self._simulation.tick + TICKS
        begin = time.thread_time()
        self._simulation.run(lambda: self._simulation.tick >= end)
        return 1e6 * (time.thread_time() - begin) / TICKS, 1e6 * self._stepping_s / TICKS

    def add_sleepers(self):
        """Put boxes on the floor behind the robot and wait until they sleep."""
        inertial = Inertial(0.5, np.zeros(3), 0.001 * np.eye(3))
        shape = Shape(Box((0.1, 0.1, 0.1)), np.eye(4), "collision", None, "link")
        box = Robot("box", {"link": Link("link", inertial, collisions=[shape])}, {}, "link")
        for number in range(SLEEPERS):
            self.world.spawn(box, "box_%d" % number,
                             Pose((-2.0 - 0.3 * (number // 10), -1.5 + 0.3 * (number % 10), 0.05)))
        for _ in range(ASLEEP_TICKS // TICKS):
            self.turn()

    def _timed_step(self):
        begin = time.thread_time()
        self._step()
        self._stepping_s += time.thread_time() - begin


def measure(report, quick, number):
    turns = TURNS // 10 if quick else TURNS
    with Loop() as loop:
        for _ in range(20):
            loop.turn()
        tick, step = map(min, zip(*(loop.turn() for _ in range(turns)), strict=True))
        report.add("tick with arms moving: CPU", tick, "us", ("its physics step", step), samples=turns * TICKS,
                   ratio_most=1.6)
        loop.add_sleepers()
        more, _ = map(min, zip(*(loop.turn() for _ in range(turns)), strict=True))
        report.add("tick with %d sleeping objects: CPU" % SLEEPERS, more, "us", ("without them", tick),
                   samples=turns * TICKS, ratio_most=2.2)
