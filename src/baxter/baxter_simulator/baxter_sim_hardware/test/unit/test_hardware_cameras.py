# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's cameras without a robot: modes, controls, power."""
import errno

import numpy as np
import pytest

from baxter_sim_hardware.sensing.cameras import (
    CONTROLS,
    EXPOSURE,
    FLIP,
    GAIN,
    HALF,
    MIRROR,
    MODES,
    WHITE_B,
    WINDOW_X,
    WINDOW_Y,
    CameraRefused,
    CaptureSettings,
    Rack,
)

FOCAL = 476.7
POINT = np.array([[0.1, -0.05, 1.0]])


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_shows_the_same_field(mode):
    pinhole = CaptureSettings(*mode, 25.0, {}).checked().pinhole(FOCAL, 0.05, 50.0)
    assert (pinhole.width / 2) / pinhole.fx == pytest.approx(640 / FOCAL)
    assert pinhole.project([[0.0, 0.0, 1.0]])[0] == pytest.approx([(mode[0] - 1) / 2, (mode[1] - 1) / 2])


def test_a_window_is_cut_from_the_array():
    whole = CaptureSettings(1280, 800, 25.0, {}).pinhole(FOCAL, 0.05, 50.0)
    part = CaptureSettings(320, 200, 25.0, {WINDOW_X: 500, WINDOW_Y: 300}).checked().pinhole(FOCAL, 0.05, 50.0)
    assert part.project(POINT) == pytest.approx(whole.project(POINT) - [500, 300])
    half = CaptureSettings(320, 200, 25.0, {WINDOW_X: 250, WINDOW_Y: 150, HALF: 1}).checked().pinhole(FOCAL, 0.05, 50.0)
    assert half.project(POINT) == pytest.approx((whole.project(POINT) + 0.5) / 2 - 0.5 - [250, 150])


@pytest.mark.parametrize("flip", [0, 1])
@pytest.mark.parametrize("mirror", [0, 1])
def test_a_turned_picture_and_its_pinhole_agree(flip, mirror):
    settings = CaptureSettings(320, 200, 25.0, {FLIP: flip, MIRROR: mirror})
    pinhole = settings.pinhole(FOCAL, 0.05, 50.0)
    u, v = np.round(pinhole.project(POINT)[0]).astype(int)
    picture = np.zeros((200, 320, 3), dtype=np.uint8)
    picture[v, u] = 200
    row, column = np.argwhere(settings.developed(picture)[:, :, 0])[0]
    assert settings.turned(pinhole).project(POINT)[0] == pytest.approx([column, row], abs=0.51)


def test_light_controls_change_levels():
    grey = np.full((2, 2, 3), 80, dtype=np.uint8)
    assert CaptureSettings(320, 200, 25.0, {}).developed(grey)[0, 0].tolist() == [80, 80, 80]
    assert CaptureSettings(320, 200, 25.0, {EXPOSURE: 25}).developed(grey)[0, 0].tolist() == [40, 40, 40]
    assert CaptureSettings(320, 200, 25.0, {GAIN: 79}).developed(grey)[0, 0].tolist() == [160, 160, 160]
    assert CaptureSettings(320, 200, 25.0, {WHITE_B: 0}).developed(grey)[0, 0].tolist() == [80, 80, 0]
    assert CaptureSettings(320, 200, 25.0, {EXPOSURE: 100, GAIN: 79}).developed(grey)[0, 0].tolist() == [255, 255, 255]


@pytest.mark.parametrize(("settings", "text"), [
    (CaptureSettings(800, 800, 25.0, {}), "800 x 800 is not a resolution"),
    (CaptureSettings(-1, 10**9, 25.0, {}), "not a resolution"),
    (CaptureSettings(320, 200, -3.0, {}), "-3 pictures"), (CaptureSettings(320, 200, 1e6, {}), "pictures a second"),
    (CaptureSettings(320, 200, float("nan"), {}), "nan pictures"),
    (CaptureSettings(320, 200, 25.0, {EXPOSURE: 101}), "exposure of 101"),
    (CaptureSettings(320, 200, 25.0, {42: 1}), "control 42"),
    (CaptureSettings(320, 200, 25.0, {WINDOW_X: 1000}), "does not fit"),
    (CaptureSettings(960, 600, 25.0, {WINDOW_X: 0, HALF: 1}), "640 x 400")])
def test_what_no_camera_can_do_is_refused(settings, text):
    with pytest.raises(CameraRefused, match=text) as caught:
        settings.checked()
    assert caught.value.code == errno.EINVAL


def test_all_controls_take_automatic_and_no_rate_means_the_usual_one():
    settings = CaptureSettings(320, 200, 0.0, dict.fromkeys(CONTROLS, -1)).checked()
    assert settings.rate == 25.0 and settings.window is None


def rack(most_open):
    made = Rack(most_open)
    for name in ("left", "right"):
        made.add(name, CaptureSettings(640, 400, 25.0, {}))
    made.add("head", None)
    return made


def test_two_of_three_have_power():
    cameras = rack(2)
    assert cameras.available() == ["left", "right"]
    with pytest.raises(CameraRefused, match="left and right are open") as caught:
        cameras.open_camera("head", CaptureSettings(320, 200, 25.0, {}))
    assert caught.value.code == errno.ENODEV
    cameras.close_camera("left")
    assert "head" in cameras.available()
    cameras.open_camera("head", CaptureSettings(320, 200, 25.0, {}))
    assert cameras.available() == ["right", "head"]
    cameras.open_camera("head", CaptureSettings(640, 400, 25.0, {}))  # again, in another mode


def test_without_that_rule_all_can_be_open():
    cameras = rack(3)
    cameras.open_camera("head", CaptureSettings(320, 200, 25.0, {}))
    assert cameras.available() == ["left", "right", "head"] and len(cameras.open) == 3


def test_closed_and_unknown_cameras_are_named():
    cameras = rack(3)
    with pytest.raises(CameraRefused, match="head is closed already") as closed:
        cameras.close_camera("head")
    with pytest.raises(CameraRefused, match="no camera 'nose'; cameras: left, right, head") as unknown:
        cameras.open_camera("nose", CaptureSettings(320, 200, 25.0, {}))
    assert (closed.value.code, unknown.value.code) == (errno.EINVAL, errno.ENODEV)


def test_a_refused_request_leaves_the_camera_as_it_was():
    cameras = rack(3)
    before = dict(cameras.open)
    with pytest.raises(CameraRefused):
        cameras.open_camera("left", CaptureSettings(1, 1, 25.0, {}))
    assert cameras.open == before
