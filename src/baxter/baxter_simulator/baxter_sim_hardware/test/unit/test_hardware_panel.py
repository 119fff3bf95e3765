# SPDX-License-Identifier: BSD-3-Clause
"""Buttons, lights, wheels: the core's rules, and the topics and the service that show and move them."""
from pathlib import Path

import numpy as np
import pytest
import rospkg
from baxter_core_msgs.msg import AnalogOutputCommand, DigitalOutputCommand
from bullet_sim_msgs.srv import PressRequest
from std_msgs.msg import Empty

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.sensing import navigator_lights
from baxter_sim_hardware.sensing.panel import ANALOG, BLOWERS, DIGITAL, LIGHTS, NAVIGATORS, PUMPS, ControlPanel
from model_files.resources import ResourceFinder
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from urdf_model import merge_fixed
from world_picture.drawing import DrawingCache
from world_picture.shared_picture import PictureWriter

BAXTER = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf" / "baxter.urdf"


def test_outputs_follow_and_inputs_refuse():
    panel = ControlPanel()
    panel.set_digital("torso_left_outer_light", True)
    assert panel.digital["torso_left_outer_light"]
    assert sum(panel.digital.values()) == 1
    for name in ("left_lower_cuff", "left_light", ""):
        with pytest.raises(CommandRefused, match="'%s' is not a digital output; choices are" % name):
            panel.set_digital(name, True)


@pytest.mark.parametrize("value", [0, 1, 37, 100, 65535])
def test_analog_outputs_keep_the_integer(value):
    panel = ControlPanel()
    panel.set_analog("torso_fan", value)
    assert panel.analog["torso_fan"] == value


@pytest.mark.parametrize("name, value", [("torso_fan", -1), ("torso_fan", 65536), ("left_wheel", 3), ("fan", 3)])
def test_bad_analog_commands_change_nothing(name, value):
    panel = ControlPanel()
    with pytest.raises(CommandRefused, match="must be from 0 to 65535|is not an analog output; choices are torso_fan"):
        panel.set_analog(name, value)
    assert not any(panel.analog.values())


@pytest.mark.parametrize("navigator", NAVIGATORS)
def test_navigator_is_its_buttons_wheel_and_lights(navigator):
    panel = ControlPanel()
    panel.press(navigator + "_button_back")
    panel.turn(navigator + "_wheel", -3)
    panel.set_digital(navigator + "_outer_light", True)
    assert panel.navigator(navigator) == ([False, True, False], 253, [False, True])
    panel.turn(navigator + "_wheel", 5)
    panel.press(navigator + "_button_back", False)
    assert panel.navigator(navigator) == ([False, False, False], 2, [False, True])
    panel.reset()
    assert panel.navigator(navigator) == ([False, False, False], 0, [False, False])


def test_fingers_press_only_what_is_there():
    panel = ControlPanel()
    with pytest.raises(CommandRefused, match="'left_inner_light' is not a digital input; choices are left_button_back"):
        panel.press("left_inner_light")
    with pytest.raises(CommandRefused, match="'torso_fan' is not a wheel; choices are left_wheel"):
        panel.turn("torso_fan", 1)


def test_one_light_shows_in_all_its_topics(make_lab):
    lab = make_lab()
    lab.send("digital_io/command", DigitalOutputCommand("right_inner_light", True))
    lab.run(0.02)
    state = lab.last("digital_io/right_inner_light/state")
    assert (state.state, state.isInputOnly) == (1, False)
    everything = lab.last("digital_io_states")
    assert everything.names == list(DIGITAL)
    assert [name for name, one in zip(everything.names, everything.states, strict=True) if one.state] == [
        "right_inner_light"]
    navigator = lab.last("navigators/right_navigator/state")
    assert (navigator.light_names, navigator.lights) == (["inner", "outer"], [True, False])
    assert lab.last("navigators_states").states[1] == navigator
    lab.send("digital_io/command", DigitalOutputCommand("right_inner_light", False))
    lab.run(0.02)
    assert lab.last("navigators/right_navigator/state").lights == [False, False]


def test_fan_shows_in_all_its_topics(make_lab):
    lab = make_lab()
    lab.send("analog_io/command", AnalogOutputCommand("torso_fan", 70))
    lab.run(0.02)
    assert lab.last("analog_io/torso_fan/state").value == 70.0
    assert lab.last("analog_io/torso_fan/value_uint32").data == 70
    everything = lab.last("analog_io_states")
    assert dict(zip(everything.names, [one.value for one in everything.states], strict=True))["torso_fan"] == 70.0


def test_refused_output_is_said_in_the_log(make_lab):
    lab = make_lab()
    lab.send("digital_io/command", DigitalOutputCommand("left_lower_cuff", True))
    lab.run(0.02)
    assert lab.last("digital_io/left_lower_cuff/state").state == 0
    assert "digital_io_command refused: 'left_lower_cuff' is not a digital output" in lab.log.lines[-1]


def test_press_service(make_lab):
    lab = make_lab()
    press = lab.services["sim/press"]
    assert press(PressRequest("left_lower_cuff", "press", 0)).success
    assert press(PressRequest("torso_left_wheel", "turn", -1)).success
    lab.run(0.02)
    state = lab.last("digital_io/left_lower_cuff/state")
    assert (state.state, state.isInputOnly) == (1, True)
    assert lab.last("navigators/torso_left_navigator/state").wheel == 255
    assert lab.last("analog_io/torso_left_wheel/value_uint32").data == 255
    assert press(PressRequest("left_lower_cuff", "release", 0)).success
    lab.run(0.02)
    assert lab.last("digital_io/left_lower_cuff/state").state == 0
    answer = press(PressRequest("left_lower_cuff", "squeeze", 0))
    assert not answer.success and "choices are press, release, turn" in answer.status_message
    answer = press(PressRequest("left_cuff", "press", 0))
    assert not answer.success and "'left_cuff' is not a digital input" in answer.status_message


def test_reset_of_the_world_releases_everything(make_lab):
    lab = make_lab()
    lab.services["sim/press"](PressRequest("left_lower_cuff", "press", 0))
    lab.plugin.reset()
    lab.run(0.02)
    assert lab.last("digital_io/left_lower_cuff/state").state == 0


def test_the_emergency_stop_button_stops_until_it_is_released_and_reset(lab):
    press = lab.services["sim/press"]

    def fields():
        lab.run(0.02)
        state = lab.last("state")
        return state.enabled, state.stopped, state.estop_button, state.estop_source

    assert fields() == (True, False, 0, 0)
    assert press(PressRequest("estop", "press", 0)).success
    assert fields() == (False, True, 1, 1)
    lab.send("set_super_reset", Empty())
    assert fields() == (False, True, 1, 1)
    assert press(PressRequest("estop", "release", 0)).success
    assert fields() == (False, True, 3, 1)
    lab.send("set_super_reset", Empty())
    assert fields() == (False, False, 0, 0)


def test_the_interfaces_page_lists_each_output_that_nothing_follows_from():
    page = (Path(__file__).resolve().parents[6] / "docs" / "interface.md").read_text(encoding="utf-8")
    section = page.split("### Outputs without effect")[1].split("\n### ")[0]
    for name, is_input in {**DIGITAL, **ANALOG}.items():
        navigator = next((one for one in NAVIGATORS for light in LIGHTS if name == "%s_%s_light" % (one, light)), None)
        said = "<navigator>" + name.removeprefix(navigator) if navigator else name
        said = "<limb>" + name[name.index("_"):] if name in (*PUMPS.values(), *BLOWERS.values()) else said
        if name.startswith("torso_ui_output"):
            said = "torso_ui_output"
        assert ("`" + said in section) == (not is_input), name


def test_a_light_glows_on_its_navigator_alone(make_lab):
    lab = make_lab()
    assert set(lab.lights) == {"left_arm_itb", "right_arm_itb", "left_torso_itb", "right_torso_itb", "sonar_ring"}
    lab.lights.pop("sonar_ring")
    areas = {}
    for light in LIGHTS:
        lab.send("digital_io/command", DigitalOutputCommand("torso_left_%s_light" % light, True))
        lab.run(0.02)
        areas[light] = lab.lights["left_torso_itb"].pixels.any(axis=2)
        assert [link for link, drawn in lab.lights.items() if drawn.pixels.any()] == ["left_torso_itb"]
        lab.send("digital_io/command", DigitalOutputCommand("torso_left_%s_light" % light, False))
        lab.run(0.02)
        assert not lab.lights["left_torso_itb"].pixels.any()
    assert not (areas["inner"] & areas["outer"]).any(), "two rings, one around the other"
    middle = [area[area.shape[0] // 2].nonzero()[0] for area in (areas["outer"], areas["inner"])]
    assert middle[0].min() < middle[1].min() and middle[1].max() < middle[0].max()

    lab.send("digital_io/command", DigitalOutputCommand("left_outer_light", True))
    lab.run(0.02)
    assert lab.lights["left_arm_itb"].pixels.any()
    lab.plugin.reset()
    assert not lab.lights["left_arm_itb"].pixels.any()


@pytest.mark.parametrize("navigator", NAVIGATORS)
def test_a_light_is_seen_on_the_robot(make_lab, tmp_path, navigator):
    """Switched at run time by a client's message, in a picture of the robot from 25 cm in front of the navigator."""
    lab = make_lab()
    frames = merge_fixed(lab.context.robot).frames
    link = navigator_lights.LINKS[navigator]
    light, itb = lab.lights[link], frames[link]
    pictures = PictureWriter(tmp_path / "light", *navigator_lights.PIXELS)
    mirror = Mirror(DrawingCache(), ResourceFinder(), pytest.fail)
    mirror.set_scene([{"name": "baxter", "urdf": BAXTER.read_text(encoding="utf-8"), "joints": [], "screens": [
        {"link": itb.link, "offset": (itb.offset @ light.place).ravel().tolist(), "size": light.size_m,
         "picture": str(pictures.path), "glows": True}]}])
    body = mirror.bodies["baxter"]
    body.set_state(np.concatenate([[0, 0, 0, 0, 0, 0, 1], np.zeros(body.size - 7)]))
    corners = np.concatenate([part.triangles[:, :3] for part in body.parts[body.link_names.index(itb.link)]])
    corners = (corners - itb.offset[:3, 3]) @ itb.offset[:3, :3]
    wheel = corners[(np.linalg.norm(corners[:, :2], axis=1) < 0.04) & (corners[:, 2] > 0.024) & (corners[:, 2] < 0.06)]
    assert (wheel.min(axis=0) + wheel.max(axis=0))[:2] / 2.0 == pytest.approx(light.place[:2, 3], abs=0.002)
    # Optical frames look along z, y down.
    camera = np.diag([1.0, -1.0, -1.0, 1.0])
    camera[2, 3] = 0.25
    view = body.link_matrix(itb.link) @ itb.offset @ camera
    renderer, seen = GlRenderer(), []
    for inner, outer in ((False, False), (True, False), (True, True), (False, False)):
        for name, on in zip(LIGHTS, (inner, outer), strict=True):
            lab.send("digital_io/command", DigitalOutputCommand("%s_%s_light" % (navigator, name), on))
            lab.run(0.02)
        pictures.show(light.pixels)
        seen.append(renderer.render(mirror, Pinhole.from_field_of_view(200, 200, 0.6, 0.05, 5.0), view)[0].astype(int))
    renderer.close()
    pictures.close()
    dark, inner, both, again = seen
    # Most of each ring is in front of the mesh; pixels of 0.7 mm or larger.
    expected = [(navigator_lights.picture(*on).max(axis=2) > 128).mean() * np.prod(light.size_m)
                for on in ((True, False), (True, True))]
    pixel = (2.0 * np.tan(0.3) / 200 * (0.25 - navigator_lights.ABOVE_M)) ** 2
    for picture, area in zip((inner, both), expected, strict=True):
        changed = np.abs(picture - dark).max(axis=2) > 15
        assert changed.sum() * pixel > 0.9 * area
        assert picture[changed].mean(axis=0)[2] > 200
    assert (again == dark).all()
