# SPDX-License-Identifier: BSD-3-Clause
"""One plugin of one model in a small world."""
import pytest

from bullet_sim import World
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginSource
from gazebo_ros.urdf_extras import plugins, sensor_plugins
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

STEP_S = 0.001


class PluginLab:
    """A world with a floor, and a model with one plugin. ``urdf`` has a place for its ``<gazebo>`` element."""

    def __init__(self, urdf, plugin_class, elements, pose=None, sensor=None, filename="x.so",
                 raw=""):
        self.world = World(time_step_s=STEP_S)
        self.world.add_ground_plane()
        inside = raw + "".join("<%s>%s</%s>" % (tag, text, tag) for tag, text in elements.items())
        plugin = '<plugin name="p" filename="%s">%s</plugin>' % (filename, inside)
        text = urdf % ((sensor or "<gazebo>%s</gazebo>") % plugin)
        robot = parse_urdf(text)
        self.model = self.world.spawn(robot, robot.name, pose)
        self.ros, self.log = FakeRos(), FakeLog()
        element, = plugins(robot) + sensor_plugins(robot, pytest.fail)
        source = PluginSource(robot, element, "/ns", text)
        context = PluginContext(self.world, self.model, source, self.log, self.ros, {})
        try:
            self.plugin = plugin_class(context)
        except PluginError:
            self.world.close()
            raise

    def run(self, seconds, meanwhile=lambda: None):
        for _ in range(round(seconds / STEP_S)):
            meanwhile()
            self.plugin.update(self.world.time_s, STEP_S)
            self.world.step()
            self.plugin.publish(self.world.time_s)
        return self

    def sent(self, topic):
        """The messages that the plugin has published on a topic in its namespace."""
        return self.ros.publishers["/ns/" + topic].messages


@pytest.fixture
def make():
    """Make a PluginLab."""
    made = []

    def make_one(*arguments, **options):
        made.append(PluginLab(*arguments, **options))
        return made[-1]

    yield make_one
    for each in made:
        each.world.close()
