# SPDX-License-Identifier: BSD-3-Clause
"""Links that no joint holds are seen where they are."""
from types import SimpleNamespace

import numpy as np
import pytest

from bullet_sim import Pose, World
from gazebo_ros.publications import SimulationPublications
from sdf_model import parse_sdf_model
from sensor_renderer.mirror import Mirror
from sensor_renderer.moments import blended
from urdf_model import drawing_urdf
from world_picture.drawing import DrawingCache

LINK = """<link name="%s"><pose>%s</pose><collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry>
</collision><visual name="v"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></visual></link>"""
MODEL = """<sdf version="1.6"><model name="boxes">%s<model name="inner"><pose>0 2 0 0 0 0.5</pose>%s%s<joint name="j"
type="revolute"><parent>one</parent><child>two</child><axis><xyz>0 0 1</xyz></axis></joint></model></model></sdf>""" % (
    LINK % ("base", "0.5 0 1 0 0 0"), LINK % ("one", "0 0 1 0.2 0 0"), LINK % ("two", "0 0 1.3 0 0.1 0"))


@pytest.fixture
def falling():
    """(World, Model) of two bodies that have moved away from each other."""
    world = World(time_step_s=0.001)
    robot = parse_sdf_model(MODEL, "m.sdf").robot
    model = world.spawn(robot, "boxes", Pose((1, 2, 30), (0, 0, 0.6, 0.8)))
    model.apply_wrench("inner::one", (300.0, 0, 0), (50.0, 0, 20.0))
    model.set_joint_positions(model.index(["inner::j"]), np.array([0.3]))
    for _ in range(300):
        world.step()
    yield world, model
    world.close()


def test_a_viewer_shows_all_links_where_the_world_has_them(falling, tmp_path):
    world, model = falling
    written = []
    fake = SimpleNamespace(_simulation=SimpleNamespace(world=world, tick=0, time_s=0.0, paused=False),
                           _snapshot=SimpleNamespace(write=lambda tick, time_s, parts, paused: written.extend(parts)))
    SimulationPublications.write_snapshot(fake)
    values = np.concatenate(written)
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": "boxes", "urdf": drawing_urdf(model.merged), "joints": list(model.joint_names),
                       "loose": True}])
    body = mirror.bodies["boxes"]
    assert body.size == len(values) == 7 + 1 + 7 and model.merged.loose == ("inner::one",)
    mirror.set_state(values)
    for name in ("base", "inner::one", "inner::two"):
        frame = model.merged.frames[name]
        np.testing.assert_allclose(body.link_matrix(frame.link) @ frame.offset, model.link_pose(name).matrix(),
                                   atol=2e-6)
    assert abs(model.link_pose("inner::one").position[0] - model.link_pose("base").position[0]) > 0.05
    other = values.copy()
    other[[3, 4, 5, 6, 11, 12, 13, 14]] *= -1.0  # the same turns
    np.testing.assert_allclose(blended(body.sizes, values, other, 0.5), values)
    turned = body.moved({"inner::j": 0.3 + np.pi})
    assert list(turned) == [2] and turned[2][:3, 0] @ body.matrices[2][:3, 0] < 1.0
