# SPDX-License-Identifier: BSD-3-Clause
"""Cameras and their settings: what is taken, and what is refused with which text."""
import pytest

from baxter_interface import camera
from baxter_interface.camera_settings import AUTO, MODES, CameraSettings


def test_every_mode_is_taken_and_others_are_refused_with_the_list():
    settings = CameraSettings()
    for mode in MODES:
        settings.set_resolution(list(mode))
        assert settings.resolution == mode
    with pytest.raises(ValueError, match="1280x800, 960x600.*got 640x480"):
        settings.set_resolution((640, 480))
    with pytest.raises(AttributeError, match="pair"):
        settings.set_resolution((640,))


@pytest.mark.parametrize(("name", "largest"), [("exposure", 100), ("gain", 79), ("white_balance_red", 4095)])
def test_control_with_an_automatic(name, largest):
    settings = CameraSettings()
    assert settings.get(name) == AUTO
    for value in (AUTO, 0, largest):
        settings.set(name, value)
        assert settings.get(name) == value
    for value in (-2, largest + 1, 0.5):
        with pytest.raises(ValueError, match="camera"):
            settings.set(name, value)
    assert settings.get(name) == largest


def test_switch_is_on_or_off():
    settings = CameraSettings()
    settings.set("flip", True)
    assert settings.get("flip") == 1
    for value in (-1, 2):
        with pytest.raises(ValueError, match="from 0 to 1, got"):
            settings.set("flip", value)


def test_window_stays_on_the_sensor():
    settings = CameraSettings(resolution=(640, 400))
    settings.set_window((640, 400))
    assert (settings.get("window_x"), settings.get("window_y")) == (640, 400)
    with pytest.raises(ValueError, match="to 640 400.*got 641 0"):
        settings.set_window((641, 0))
    settings.set("half_resolution", 1)
    settings.set_window((0, 0))
    with pytest.raises(ValueError, match="to 0 0"):
        settings.set_window((1, 0))
    with pytest.raises(AttributeError, match="pair"):
        settings.set_window((1, 2, 3))


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_rate_is_a_positive_number(fps):
    with pytest.raises(ValueError, match="above 0"):
        CameraSettings().set_fps(fps)


@pytest.mark.parametrize(("names", "may_lack_power"), [
    (["left_hand_camera", "right_hand_camera", "head_camera"], False), (["left_hand_camera", "head_camera"], True)])
def test_unknown_camera_is_answered_by_those_that_are_there(monkeypatch, names, may_lack_power):
    monkeypatch.setattr(camera, "list_cameras", lambda: names)
    with pytest.raises(camera.UnknownCamera) as caught:
        camera.CameraController("left_hand")
    text = str(caught.value)
    assert all(name in text for name in names) and ("closing" in text) is may_lack_power
