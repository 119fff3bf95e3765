# SPDX-License-Identifier: BSD-3-Clause
"""Points of lasers of several rows; fingers that hold."""
import math

import numpy as np
import pytest

from bullet_sim import Pose
from gazebo_plugins.grasp_fix import GraspFix
from gazebo_plugins.point_lasers import BlockLaser, VelodyneLaser
from gazebo_ros.model_plugin import PluginError

ROBOT = """<robot name="r"><link name="world"/><link name="eye"/><joint name="j" type="fixed"><parent link="world"/>
<child link="eye"/><origin xyz="0 0 1"/></joint>%s</robot>"""
# Down to the floor, level and up: the floor is hit 1 m below.
RAYS = """<gazebo reference="eye"><sensor type="ray" name="s"><ray><scan><horizontal><samples>5</samples>
<min_angle>-0.4</min_angle><max_angle>0.4</max_angle></horizontal><vertical><samples>3</samples><min_angle>-0.5</min_angle>
<max_angle>0.5</max_angle></vertical></scan><range><min>0.1</min><max>10</max></range></ray>%s</sensor></gazebo>"""
HIT_M = 1.0 / math.sin(0.5)


def laser(make, plugin_class, **elements):
    lab = make(ROBOT, plugin_class, {"topicName": "points", **elements}, Pose((0, 0, 0)), sensor=RAYS)
    return lab.run(0.01).sent("points")[-1]


def test_a_block_laser_has_all_rays_row_by_row(make):
    cloud = laser(make, BlockLaser)
    assert cloud.header.frame_id == "eye" and len(cloud.points) == 15 == len(cloud.channels[0].values)
    assert [point.z for point in cloud.points[:5]] == pytest.approx(5 * [-1.0], abs=0.01)
    assert cloud.points[2].x == pytest.approx(HIT_M * math.cos(0.5), abs=0.01)
    assert math.isinf(cloud.points[7].x) and cloud.points[7].y == 0.0


@pytest.mark.parametrize("organized", ["false", "true"])
def test_a_velodyne_has_the_points_that_it_hits_with_their_rings(make, organized):
    cloud = laser(make, VelodyneLaser, organize_cloud=organized)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity", "ring", "time"]
    kind = np.dtype({"names": ["x", "y", "z", "ring"], "formats": ["<f4", "<f4", "<f4", "<u2"],
                     "offsets": [cloud.fields[k].offset for k in (0, 1, 2, 4)], "itemsize": cloud.point_step})
    points = np.frombuffer(cloud.data, kind)
    assert (cloud.height, cloud.width, cloud.is_dense) == ((1, 5, True) if organized == "false" else (3, 5, False))
    assert points["ring"].tolist() == ([0] * 5 if organized == "false" else [0] * 5 + [1] * 5 + [2] * 5)
    assert points["z"][:5] == pytest.approx(-1.0, abs=0.01) and np.isnan(points["z"][5:]).all()
    assert np.degrees(np.arctan2(points["y"], points["x"]))[0] == pytest.approx(np.degrees(-0.4), abs=0.1)


def test_what_is_too_far_for_the_plugin_is_left_out(make):
    assert laser(make, VelodyneLaser, max_range="1.5").width == 0


def test_grasp_fix_makes_fingers_firm(make, monkeypatch):
    firm = []
    monkeypatch.setattr("bullet_sim.Model.grip_firmly", lambda model, link: firm.append(link))
    make(ROBOT, GraspFix, {"arm": "<palm_link>world</palm_link><gripper_link>r::eye</gripper_link>"})
    assert firm == ["eye"]
    with pytest.raises(PluginError, match="'nose', expected some of the links .*eye"):
        make(ROBOT, GraspFix, {"arm": "<gripper_link>nose</gripper_link>"})
