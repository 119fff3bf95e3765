# SPDX-License-Identifier: BSD-3-Clause
"""Actors go along their trajectories."""
import math

import numpy as np
import pytest

from bullet_sim import Pose, World
from gazebo_ros.actors import ActorMotion, ActorTrajectory
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginSource
from gazebo_ros.urdf_extras import plugins
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

STEP_S = 0.01
SCRIPT = """<robot name="r"><link name="link"/><gazebo><plugin filename="libactor_trajectory.so">%s<trajectory>
<waypoint><time>0</time><pose>0 0 1 0 0 0</pose></waypoint><waypoint><time>2</time><pose>4 0 1 0 0 %s</pose></waypoint>
</trajectory></plugin></gazebo></robot>"""


def test_a_trajectory_is_straight_between_waypoints_and_turns_the_short_way():
    way = ActorTrajectory([(2.0, (4, 0, 1, 0, 0, math.radians(350))), (1.0, (0, 2, 1, 0, 0, math.radians(10)))])
    assert way.length_s == 2.0
    assert way.pose(0.0).position == pytest.approx((0, 2, 1)) and way.pose(9.0).position == pytest.approx((4, 0, 1))
    middle = way.pose(1.5)
    assert middle.position == pytest.approx((2, 1, 1))
    assert np.abs(middle.quaternion) == pytest.approx((0, 0, 0, 1), abs=1e-6)


@pytest.mark.parametrize(("script", "at"), [
    ("", {1.0: 2.0, 3.0: 2.0}), ("<loop>false</loop>", {1.0: 2.0, 3.0: 4.0}),
    ("<delay_start>1</delay_start>", {0.5: 0.0, 2.0: 2.0}), ("<auto_start>false</auto_start>", {1.0: 0.0})])
def test_an_actor_is_where_its_script_says(script, at):
    world = World(time_step_s=STEP_S)
    try:
        robot = parse_urdf(SCRIPT % (script, "0"))
        model = world.spawn(robot, "r", Pose((0, 0, 1)), static=True)
        source = PluginSource(robot, plugins(robot)[0])
        plugin = ActorMotion(PluginContext(world, model, source, FakeLog(), FakeRos(), {}))
        for time_s, x in at.items():
            while world.time_s < time_s:
                plugin.update(world.time_s, STEP_S)
                world.step()
            assert model.base_pose().position[0] == pytest.approx(x, abs=0.1)
    finally:
        world.close()


def test_a_wrong_waypoint_is_named():
    world = World()
    try:
        robot = parse_urdf(SCRIPT % ("", "left"))
        model = world.spawn(robot, "r", static=True)
        with pytest.raises(PluginError, match="<pose> is '4 0 1 0 0 left'"):
            ActorMotion(PluginContext(world, model, PluginSource(robot, plugins(robot)[0]), FakeLog(), FakeRos(), {}))
    finally:
        world.close()
