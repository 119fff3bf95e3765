# SPDX-License-Identifier: BSD-3-Clause
"""Lights as services change them, and pictures in shared memory."""
import re

import numpy as np
import pytest
from gazebo_msgs.srv import SetLightPropertiesRequest

from gazebo_ros.entities import UnknownEntity
from gazebo_ros.light_services import LightServices
from gazebo_ros.world_lights import WorldLights, lights_of_links
from loop_ros.testing import FakeRos
from sdf_model import Light, ModelFolders, SceneLook, parse_sdf_model
from urdf_model import merge_fixed, parse_urdf
from urdf_model.transforms import pose_matrix
from world_picture.shared_picture import PictureReader, PictureWriter
from world_picture.snapshot import SnapshotError

SUN = Light("sun", "directional", pose_matrix((1.0, 2.0, 3.0), (0.0, 0.0, np.pi / 2)), (0.8, 0.8, 0.8, 1.0),
            (0.2, 0.2, 0.2, 1.0), (0.9, 0.01, 0.001), (1.0, 0.0, -1.0), True)


def test_viewers_are_told_in_the_frame_of_the_world_and_of_each_change():
    lights, told = WorldLights([SUN], SceneLook(ambient=(0.1, 0.2, 0.3))), []
    lights.on_change = lambda: told.append(lights.listed())
    listed = lights.listed()
    assert listed["ambient"] == (0.1, 0.2, 0.3) and listed["background"] is None and listed["shadows"]
    sun, = listed["lights"]
    assert sun["direction"] == pytest.approx([0.0, 1.0, -1.0]) and sun["place"] == [1.0, 2.0, 3.0]
    lights.change("sun", diffuse=(1.0, 0.0, 0.0, 1.0))
    assert told[-1]["lights"][0]["diffuse"] == [1.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="diffuse of light 'sun' is .*nan.*, expected finite"):
        lights.change("sun", diffuse=(float("nan"), 0.0, 0.0, 1.0))
    with pytest.raises(UnknownEntity, match="'lamp' does not exist; lights: sun"):
        lights.change("lamp", diffuse=(1.0, 0.0, 0.0, 1.0))
    lights.delete("sun")
    assert told[-1]["lights"] == [] and len(told) == 2


@pytest.mark.parametrize("number, word", [(float("nan"), "not finite"), (1e300, "norm of"),
                                          (float("inf"), "not finite")])
def test_the_service_refuses_a_pose_that_is_none_with_the_reason(number, word):
    ros = FakeRos()
    LightServices(WorldLights([SUN]), ros)
    request = SetLightPropertiesRequest(light_name="sun")
    request.pose.orientation.z = number
    response = ros.services["/gazebo/set_light_properties"](request)
    assert not response.success and word in response.status_message
    request.pose.orientation.z, request.attenuation_linear = 2.0, number
    assert "attenuation of light 'sun'" in ros.services["/gazebo/set_light_properties"](request).status_message
    request.attenuation_linear = 1.0
    assert ros.services["/gazebo/set_light_properties"](request).success


def test_a_world_that_names_no_light_leaves_it_to_the_viewer():
    assert WorldLights([]).listed()["lights"] is None


LAMP = """<sdf version="1.6"><model name="post"><link name="foot"/><link name="head"><pose>0 0 2 0 0 0</pose>
<light name="bulb" type="spot"><pose>0.5 0 0 0 0 0</pose><direction>1 0 0</direction>
<cast_shadows>1</cast_shadows></light></link>
<joint name="j" type="fixed"><parent>foot</parent><child>head</child></joint></model></sdf>"""
URDF_LAMP = """<robot name="post"><link name="foot"/><gazebo reference="%s"><light name="bulb" type="%s">
<diffuse>%s</diffuse></light></gazebo></robot>"""


def test_lights_in_links_are_in_the_frame_of_the_body():
    robot = parse_sdf_model(LAMP, "post", ModelFolders([])).robot
    bulb, = lights_of_links(robot, merge_fixed(robot), pytest.fail)
    assert bulb["link"] == "foot" and bulb["place"] == pytest.approx([0.5, 0.0, 2.0])
    assert bulb["direction"] == pytest.approx([1.0, 0.0, 0.0]) and bulb["type"] == "spot" and bulb["cast_shadows"]
    robot = parse_urdf(URDF_LAMP % ("foot", "point", "1 0 0 1"))
    bulb, = lights_of_links(robot, merge_fixed(robot), pytest.fail)
    assert (bulb["type"], bulb["diffuse"]) == ("point", [1.0, 0.0, 0.0])


@pytest.mark.parametrize(("values", "text"), [(("knee", "point", "1 0 0 1"), "'bulb' of 'post' is on 'knee'.*foot"),
                                              (("foot", "point", "red"), "a light of 'post'.*red")])
def test_a_light_that_cannot_be_used_is_named_and_left_out(values, text):
    said = []
    robot = parse_urdf(URDF_LAMP % values)
    assert lights_of_links(robot, merge_fixed(robot), said.append) == []
    assert len(said) == 1 and re.search(text, said[0])


def test_a_picture_is_read_when_it_is_new(tmp_path):
    writer = PictureWriter(tmp_path / "p", 4, 2)
    reader = PictureReader(tmp_path / "p")
    assert (reader.width, reader.height) == (4, 2)
    assert not reader.read().any() and reader.read() is None
    writer.show(np.full((2, 4, 3), 7, dtype=np.uint8))
    assert (reader.read() == 7).all() and reader.read() is None
    writer.close()
    assert not (tmp_path / "p").exists() and reader.read() is None
    with pytest.raises(SnapshotError, match="no picture in"):
        PictureReader(tmp_path / "p")
