# SPDX-License-Identifier: BSD-3-Clause
"""The lights around the head: what clients switch, in pictures of the robot."""
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import rospkg
from std_msgs.msg import Float32, UInt16

from baxter_sim_hardware.sensing import sonar_lights
from baxter_sim_hardware.sensing.sensors import LIGHTS_OVERRIDE
from baxter_sim_hardware.topics.sensors import LIGHT_TURNS, SONAR_RATE_HZ
from model_files.resources import ResourceFinder
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import looking_at
from urdf_model import Box, merge_fixed, parse_urdf
from world_picture.drawing import DrawingCache
from world_picture.shared_picture import PictureWriter

BAXTER = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf" / "baxter.urdf"
# The lights are read from the picture.
HEARD = ()
PINHOLE = Pinhole.from_field_of_view(240, 160, 0.6, 0.05, 5.0)
RED, GREEN, YELLOW = (255, 0, 0), (0, 255, 0), (255, 200, 40)


@pytest.fixture
def seen(make_lab, tmp_path):
    """Function(mask, red, green, side) -> what glows in a picture of the robot from 0.5 m before that side of the ring
    [rad to the left of straight ahead]: {colour: (n, 2) columns and rows [m] from the ring's middle}."""
    lab = make_lab()
    light = lab.lights["sonar_ring"]
    ring = merge_fixed(lab.context.robot).frames["sonar_ring"]
    band = ring.offset @ light.place
    pictures = PictureWriter(tmp_path / "light", *sonar_lights.PIXELS)
    mirror = Mirror(DrawingCache(), ResourceFinder(), pytest.fail)
    mirror.set_scene([{"name": "baxter", "urdf": BAXTER.read_text(encoding="utf-8"), "joints": [], "screens": [
        {"link": ring.link, "offset": band.ravel().tolist(), "size": light.size_m, "radius": light.radius_m,
         "picture": str(pictures.path), "glows": True}]}])
    body = mirror.bodies["baxter"]
    body.set_state(np.concatenate([[0, 0, 0, 0, 0, 0, 1], np.zeros(body.size - 7)]))
    middle = (body.link_matrix(ring.link) @ band)[:3, 3]
    renderer = GlRenderer()

    def look(mask, red, green, side):
        lab.send("sonar/head_sonar/lights/set_lights", UInt16(LIGHTS_OVERRIDE | mask))
        lab.send("sonar/head_sonar/lights/set_red_level", Float32(red))
        lab.send("sonar/head_sonar/lights/set_green_level", Float32(green))
        lab.run(0.15)
        pictures.show(light.pixels)
        view = looking_at(middle + 0.5 * np.array([np.cos(side), np.sin(side), 0.2]), middle)
        picture = renderer.render(mirror, PINHOLE, view)[0].astype(int)
        found = {}
        for colour in (RED, GREEN, YELLOW):
            rows, columns = (np.abs(picture - colour).max(axis=2) < 60).nonzero()
            metre = PINHOLE.fx / 0.5
            found[colour] = np.stack([(columns - PINHOLE.cx) / metre, (rows - PINHOLE.cy) / metre], axis=1)
        return found

    yield look
    renderer.close()
    pictures.close()


@pytest.mark.parametrize("sonar", range(0, 12, 2))
def test_a_sonars_light_is_seen_where_the_sonar_is(seen, sonar):
    side = sonar * 2.0 * np.pi / 12
    for away in (0.0, 0.7, -0.7):
        place = seen(1 << sonar, 0.0, 0.0, side + away)[YELLOW]
        # From its left it is to the left in the picture, by the ring's radius.
        assert len(place) > 5 and place.mean(axis=0)[0] == pytest.approx(-0.085 * np.sin(away), abs=0.008)
    assert not len(seen(1 << sonar, 0.0, 0.0, side + np.pi)[YELLOW]), "it is hidden by the ring"
    assert not len(seen(0, 0.0, 0.0, side)[YELLOW])


def test_the_halo_is_a_line_around_the_head_below_the_lights(seen):
    for side in (0.0, 2.0, 4.0):
        red = seen(0, 100.0, 0.0, side)
        assert not len(red[GREEN]) and np.ptp(red[RED][:, 0]) > 0.13
        green = seen(1, 0.0, 100.0, 0.0)
        assert not len(green[RED]) and green[YELLOW][:, 1].mean() < green[GREEN][:, 1].mean()


def test_echoes_light_up_without_a_client(lab):
    light = lab.lights["sonar_ring"]
    all_listened = (LIGHT_TURNS + 0.5) / SONAR_RATE_HZ
    lab.run(all_listened)
    before = light.pixels.any()
    lab.send("sonar/head_sonar/set_sonars_enabled", UInt16(0))
    lab.run(0.15)
    assert not light.pixels.any(), "no sonar is on"
    lab.send("sonar/head_sonar/lights/set_green_level", Float32(50.0))
    lab.run(0.15)
    assert light.pixels.max() == 127 and light.pixels[:, :, 1].any(axis=1).sum() < 10
    lab.plugin.reset()
    lab.run(all_listened)
    assert light.pixels.any() == before


def test_a_ring_of_another_shape_has_no_lights():
    robot = parse_urdf(BAXTER.read_text(encoding="utf-8"))
    ring = robot.links["sonar_ring"]
    assert sonar_lights.around(ring)[1][1] == ring.visuals[0].geometry.length
    box = dataclasses.replace(ring.visuals[0], geometry=Box((0.1, 0.1, 0.1)))
    assert sonar_lights.around(dataclasses.replace(ring, visuals=[box])) is None
