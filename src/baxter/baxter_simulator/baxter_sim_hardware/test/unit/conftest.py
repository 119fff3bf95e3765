# SPDX-License-Identifier: BSD-3-Clause
"""The whole robot without a ROS master: the plugin on a real physics world, its topics as plain lists.

A test file's HEARD has patterns (of fnmatch) of the topics that it reads; the others have no subscriber there. Without
HEARD all topics have one, and making their messages takes most of a tick.
"""
import fnmatch
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import rospkg
from baxter_core_msgs.msg import JointCommand
from std_msgs.msg import Bool, Empty, Float64

import xacro
from baxter_model import JOINTS, SIDES, poses
from baxter_sim_hardware.plugin import BaxterPlugin
from bullet_sim import Pose, World
from bullet_sim.solids import with_solids
from gazebo_ros.model_plugin import PluginContext, PluginHost, PluginSource
from loop_ros.testing import FakeLog, FakeRos
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf

PACKAGE = Path(__file__).resolve().parents[2]
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
TICK_S = 0.002
NAMESPACE = "/robot"


class _Drawn:
    def __init__(self, link, place, size_m, pixels, radius_m):
        self.link, self.place, self.size_m, self.radius_m = link, place, size_m, radius_m
        self.pixels = np.zeros((*pixels[::-1], 3), dtype=np.uint8)

    def show(self, pixels):
        self.pixels = pixels.copy()


def _own(by_name):
    """{absolute name: ...} with the names as the plugin uses them."""
    return {name.removeprefix(NAMESPACE + "/"): value for name, value in by_name.items()}


class Lab:
    """A world with Baxter in it, whose plugin has the simulator's own PluginContext.

    Arrays over the 14 arm joints are in the order of NAMES.
    ``ros``: its ``loop_ros.testing.FakeRos``. The screen has no subscriber, because its pictures would fill the memory.
    ``subscriptions``, ``publishers``, ``services``: by the plugin's names.
    """

    def __init__(self, robot, pose="neutral", parameters=None, angles=None, meshes=False, heard=("*",)):
        """meshes: whether the body has its collision meshes; without them it has no contacts, and loads faster. heard:
        patterns of the topics that have a subscriber.
        """
        self.world = World(time_step_s=TICK_S, **({"find_mesh": ResourceFinder()} if meshes else {}))
        element = ElementTree.fromstring("<plugin/>")
        options = BaxterPlugin.spawn_options(robot, element)
        self.model = self.world.spawn(with_solids(robot, options.pop("solids")), "baxter",
                                      Pose((0.0, 0.0, 0.93), (0.0, 0.0, 0.0, 1.0)), **options)
        self.arm = self.model.index(NAMES)
        if angles is None:
            angles = [poses().angles(pose, name.split("_")[0])[name] for name in NAMES]
        angles = np.clip(angles, self.model.lower[self.arm], self.model.upper[self.arm])
        self.model.set_joint_positions(self.arm, angles)
        self.log = FakeLog()
        self._heard = heard
        self.ros = FakeRos(heard=self._is_heard, clock=lambda: self.world.time_s)
        source = PluginSource(robot, element, NAMESPACE)
        self.lights = {}
        self.context = PluginContext(self.world, self.model, source, self.log, self.ros,
                                     {"baxter_sim_hardware": parameters or {}}, PluginHost(self._screen))
        self.plugin = BaxterPlugin(self.context)
        self.effort_limit = self.model.max_effort[self.arm]

    def _is_heard(self, topic):
        return topic != NAMESPACE + "/sim/screen" and any(
            fnmatch.fnmatchcase(topic.removeprefix(NAMESPACE + "/"), pattern) for pattern in self._heard)

    def hear(self, *patterns):
        """From now on these topics have a subscriber, and no others."""
        self._heard = patterns
        for topic, publisher in self.ros.publishers.items():
            publisher.has_listeners = self._is_heard(topic)

    def _screen(self, link, place, size_m, pixels, glows, radius_m):
        drawn = _Drawn(link, place, size_m, pixels, radius_m)
        if glows:
            self.lights[link] = drawn
        else:
            self.drawn = drawn
        return drawn

    # -- what tests do with it

    @property
    def subscriptions(self):
        return _own(self.ros.subscriptions)

    @property
    def publishers(self):
        return _own(self.ros.publishers)

    @property
    def services(self):
        return _own(self.ros.services)

    @property
    def faults(self):
        """List of (place, error)."""
        return self.ros.faults.noted

    def send(self, topic, message):
        self.ros.subscriptions[self.context.resolve(topic)].put(message)

    def enable(self, on=True):
        self.send("set_super_enable", Bool(on))
        self.run(TICK_S)

    def stop(self):
        self.send("set_super_stop", Empty())

    def command(self, mode, values, names=None):
        """Send one message to each limb that has a joint in `names` (default: all 14)."""
        values = dict(zip(names or NAMES, values, strict=True))
        for side in SIDES:
            chosen = [name for name in values if name.startswith(side)]
            if chosen:
                message = JointCommand(mode=mode, names=chosen, command=[float(values[name]) for name in chosen])
                self.send("limb/%s/joint_command" % side, message)

    def set_timeout(self, seconds):
        for side in SIDES:
            self.send("limb/%s/joint_command_timeout" % side, Float64(seconds))

    def run(self, seconds, before=None, after=None):
        """Tick for so long; `before(lab)` and `after(lab)` are called around each tick."""
        for _ in range(round(seconds / TICK_S)):
            if before:
                before(self)
            self.plugin.update(self.world.time_s, TICK_S)
            self.world.step()
            self.plugin.publish(self.world.time_s)
            if after:
                after(self)

    def record(self, seconds, before=None):
        """Tick for so long; return positions, velocities, efforts, each (ticks, 14)."""
        rows = []
        self.run(seconds, before, lambda lab: rows.append([values[lab.arm] for values in lab.model.read_joints()]))
        return np.array(rows).transpose(1, 0, 2)

    @property
    def position(self):
        return self.model.read_joints()[0][self.arm]

    @property
    def velocity(self):
        return self.model.read_joints()[1][self.arm]

    def last(self, topic):
        return self.publishers[topic].messages[-1]

    def close(self):
        self.world.close()


@pytest.fixture(scope="session")
def robot_file():
    return rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"


@pytest.fixture(scope="session")
def robot(robot_file):
    return parse_urdf(xacro.process_file(robot_file).toxml(), source=robot_file)


def heard_in(request):
    """The HEARD of the test's file."""
    return getattr(request.module, "HEARD", ("*",))


@pytest.fixture
def make_lab(request, robot):
    """Function that makes a Lab: make_lab(model=..., pose=..., parameters={...}, angles=..., meshes=...)."""
    labs = []

    def make(model=robot, **options):
        labs.append(Lab(model, heard=heard_in(request), **options))
        return labs[-1]

    yield make
    for lab in labs:
        lab.close()


@pytest.fixture(scope="module")
def one_lab(request, robot):
    """One Lab for all tests of a file, which may leave it in any state; making a robot takes longer than the tests."""
    made = Lab(robot, heard=heard_in(request))
    yield made
    made.close()


@pytest.fixture
def lab(make_lab):
    """An enabled robot in neutral."""
    made = make_lab(parameters={"enable": True})
    made.run(0.1)
    return made
