# SPDX-License-Identifier: BSD-3-Clause
"""Names of models, links and collisions, as Gazebo gives and understands them."""
import pytest

from bullet_sim import Pose, World
from gazebo_ros.entities import Entities, UnknownEntity
from urdf_model import parse_urdf

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
CART = """<robot name="cart"><link name="base">%s</link><link name="camera"/><joint name="mount" type="fixed">
<parent link="base"/><child link="camera"/><origin xyz="0 0 0.3"/></joint></robot>""" % INERTIAL


@pytest.fixture
def world():
    world = World()
    yield world
    world.close()


def test_a_reference_frame_is_a_model_or_a_link_with_or_without_its_model(world):
    for number, name in enumerate(("one", "two", "camera")):
        world.spawn(parse_urdf(CART), name, Pose((float(number), 0.0, 1.0)))
    entities = Entities(world)
    places = {name: entities.frame(name)[0][:3, 3].tolist()
              for name in ("", "two", "two::camera", "base", "camera", "camera::base")}
    # A model goes before a link of its name; of several links, the first model's counts.
    assert places == {"": [0, 0, 0], "two": [1, 0, 1], "two::camera": [1, 0, 1.3], "base": [0, 0, 1],
                      "camera": [2, 0, 1], "camera::base": [2, 0, 1]}
    with pytest.raises(UnknownEntity, match="'lens' is no model and no link; models: one, two, camera"):
        entities.frame("lens")
