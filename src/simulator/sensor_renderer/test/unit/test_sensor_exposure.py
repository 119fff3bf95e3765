# SPDX-License-Identifier: BSD-3-Clause
"""A physical camera's picture of the ideal one: exposure, gain, noise; and the Kinect's noise of depth."""
import numpy as np
import pytest

from sensor_renderer import structured_light
from sensor_renderer.camera_sensor import CameraSensor
from sensor_renderer.exposure import Exposure, ExposureSettings
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.moments import DrawnMoments, Moment, blended
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.sensor_element import CameraElement
from sensor_renderer.structured_light import StructuredLight, shadowed
from urdf_model.transforms import matrix_from_quaternion
from world_picture.drawing import DrawingCache

GREY = np.full((100, 200, 3), 120, dtype=np.uint8)
PINHOLE = Pinhole.from_field_of_view(320, 240, 1.0, 0.05, 20.0)
KINECT = Pinhole.from_field_of_view(640, 480, 1.0, 0.1, 100.0)
EYE = """<robot name="eye"><link name="eye"/></robot>"""
BALL = """<robot name="ball"><link name="ball"><visual><geometry><box size="0.1 0.1 0.1"/></geometry>
<material name="r"><color rgba="0.9 0 0 1"/></material></visual></link></robot>"""


def light(level):
    """Linear light of an sRGB level, by the standard's formula."""
    share = np.asarray(level, dtype=float) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def developed(pictures=(GREY,), time_s=1.0, **settings):
    return Exposure(seed=1).developed(list(pictures), ExposureSettings(**settings), time_s)


def test_without_settings_a_picture_stays_as_it_is():
    assert developed() is GREY


@pytest.mark.parametrize(("settings", "factor"), [
    ({"exposure_time": 0.02}, 2.0), ({"exposure_time": 0.005}, 0.5), ({"gain": 6.0206}, 2.0),
    ({"exposure_time": 0.02, "gain": -6.0206}, 1.0)])
def test_time_and_gain_multiply_light(settings, factor):
    assert light(developed(**settings)).mean() == pytest.approx(factor * light(120), rel=0.02)


def test_light_beyond_white_is_white():
    assert (developed(gain=24.0) == 255).all()


def test_the_noise_of_light_is_its_root_and_that_of_reading_is_constant():
    """EMVA 1288: variance of electrons = electrons + read noise squared."""
    full_well, read = 2000.0, 30.0
    for level in (100, 150, 200):
        electrons = light(level) * full_well
        seen = light(developed([np.full((400, 400, 3), level, np.uint8)], full_well=full_well, read_noise=read))
        assert seen.mean() * full_well == pytest.approx(electrons, rel=0.02)
        assert seen.std() * full_well == pytest.approx(np.sqrt(electrons + read**2), rel=0.06)


def test_noise_belongs_to_the_time_of_the_picture():
    noisy = [developed(full_well=1000.0, time_s=time_s) for time_s in (1.0, 1.0, 2.0)]
    assert np.array_equal(noisy[0], noisy[1]) and not np.array_equal(noisy[0], noisy[2])


@pytest.mark.parametrize("level", [15, 120, 250])
def test_automatic_gain_finds_its_brightness(level):
    sensor, settings = Exposure(), ExposureSettings(exposure_time=0.03, auto_exposure=True)
    for step in range(12):
        picture = sensor.developed([np.full((90, 90, 3), level, np.uint8)], settings, 0.1 * step)
    assert light(picture).mean() == pytest.approx(light(0.45 * 255), rel=0.1)


def test_blur_mixes_light_not_levels():
    black, white = np.zeros((4, 4, 3), np.uint8), np.full((4, 4, 3), 255, np.uint8)
    assert light(developed([black, white], exposure_time=0.01)).mean() == pytest.approx(0.5, abs=0.005)


def test_a_state_between_two_is_between_them():
    half = np.sqrt(0.5)
    before = np.array([0.0, 0, 0, 0, 0, 0, 1, 0.2, 1.0, 1.0, 1.0, 0, 0, 0, 1])
    after = np.array([1.0, 0, 2, 0, 0, -half, -half, 0.6, 1.0, 1.0, 1.0, 0, 0, 0, 1])  # -q is the same turn as q
    found = blended([8, 7], before, after, 0.5)
    assert found[:3] == pytest.approx([0.5, 0, 1]) and found[7] == pytest.approx(0.4)
    turn = matrix_from_quaternion(found[3:7])
    assert turn[:2, 0] == pytest.approx([half, half]) and found[8:] == pytest.approx(before[8:])


@pytest.fixture
def passing(tmp_path):
    """A DrawnMoments in which a red cube of 0.1 m flies past a camera at 1 m, from left to right with 2 m/s."""
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": "eye", "urdf": EYE, "joints": []}, {"name": "ball", "urdf": BALL, "joints": []}],
                     {"background": (0.0, 0.0, 0.0)})
    renderer = GlRenderer()
    world = DrawnMoments(mirror, lambda: renderer)
    for step in range(11):
        time_s = 0.004 * step
        world.remember(time_s, np.array([0, 0, 0, 0, 0, 0, 1.0, 1.05, -2.0 * (time_s - 0.03), 0, 0, 0, 0, 1.0]), 0.1)
    yield world
    renderer.close()


def red(picture):
    """The width of what is red [pixels], at half of the greatest red beyond the green."""
    row = picture[120].astype(int)
    share = light(row[:, 0]) - light(row[:, 1])
    return int((share > 0.5 * share.max()).sum()), float((share * np.arange(len(row))).sum() / share.sum())


def test_what_moves_is_blurred_along_its_way_and_the_stamp_is_the_middle(passing):
    camera = CameraElement("eye", PINHOLE, OPTICAL, "rgb8", 0.0)
    sensor, now = CameraSensor(camera), Moment(passing, "eye", "eye", 0.04)
    sharp = sensor.taken(now.at(0.03), True, False)[1]
    sensor.exposure = ExposureSettings(exposure_time=0.02, blur_pictures=16)
    middle, blurred, depth = sensor.taken(now, True, True)
    assert middle.time_s == pytest.approx(0.03) and depth[120, 160] == pytest.approx(1.0, abs=1e-3)
    pixels_m = PINHOLE.fx / 1.0
    assert red(sharp)[0] == pytest.approx(0.1 * pixels_m, abs=2) and red(sharp)[1] == pytest.approx(159.5, abs=1.0)
    # It is longer by its way, at half of the greatest light, and as far as its middle in the middle of the exposure.
    assert red(blurred)[1] == pytest.approx(159.5, abs=1.5)
    full = (light(blurred[120, :, 0]) - light(blurred[120, :, 1]) > 0.02).sum()
    assert full == pytest.approx((0.1 + 2.0 * 0.02) * pixels_m, abs=4)


def test_what_stands_still_is_drawn_once(passing, monkeypatch):
    calls = []
    true = passing.renderer.render
    monkeypatch.setattr(passing.renderer, "render", lambda *arguments: calls.append(1) or true(*arguments))
    sensor = CameraSensor(CameraElement("eye", PINHOLE, OPTICAL, "rgb8", 0.0))
    sensor.exposure = ExposureSettings(exposure_time=0.02)
    still = np.array([0, 0, 0, 0, 0, 0, 1.0, 1.05, 0, 0, 0, 0, 0, 1.0])
    passing.forget()
    for step in range(11):
        passing.remember(0.004 * step, still, 0.1)
    sensor.taken(Moment(passing, "eye", "eye", 0.04), True, False)
    assert len(calls) == 1


def test_the_world_forgets_what_no_camera_needs(passing):
    passing.remember(0.2, np.array([0, 0, 0, 0, 0, 0, 1.0, 9.0, 0, 0, 0, 0, 0, 1.0]), 0.02)
    assert len(passing._states) == 2


def test_depth_has_the_steps_and_the_error_of_the_kinect():
    """Khoshelham and Oude Elberink: at 3 m steps of 26 mm and a random error of 13 mm, four times those of 1.5 m."""
    sensor = StructuredLight(KINECT, seed=3)
    for z in (1.0, 1.5, 3.0):
        found = sensor.measured(np.full((480, 640), z, dtype=np.float32), 0.5)
        inside = found[:, 60:]
        assert np.isfinite(inside).all()
        steps = np.diff(np.unique(inside))
        assert steps == pytest.approx(2.85e-3 * z * z, rel=0.1)
        # Half a step of noise, and a twelfth of a squared step of rounding.
        assert inside.std() == pytest.approx(2.85e-3 * z * z * np.sqrt(0.25 + 1 / 12), rel=0.05)


def test_depth_ends_at_the_range_of_the_sensor():
    sensor = StructuredLight(KINECT)
    for z, seen in ((0.45, False), (0.55, True), (4.8, True), (5.5, False)):
        found = sensor.measured(np.full((480, 640), z, dtype=np.float32), 0.0)[:, 120:]
        assert np.isfinite(found).all() if seen else np.isnan(found).all()


def test_the_projector_throws_a_shadow_to_the_left_of_near_things():
    depth = np.full((40, 640), 2.0, dtype=np.float32)
    depth[10:30, 300:400] = 1.0
    dark = shadowed(depth, KINECT.fx)
    width = KINECT.fx * structured_light.BASELINE_M * (1.0 / 1.0 - 1.0 / 2.0)
    assert not dark[:10].any() and not dark[30:].any() and not dark[10:30, 300:].any()
    counts = dark[10:30].sum(axis=1)
    assert counts == pytest.approx(width, abs=1.5)
    assert dark[20, 299] and not dark[20, 299 - int(width) - 2]


def test_a_slanted_surface_hides_no_part_of_itself():
    columns = (np.arange(640) - KINECT.cx) / KINECT.fx
    for slope in (-0.8, 0.8):
        # The plane z = 1.5 + slope x.
        depth = np.tile((1.5 / (1.0 - slope * columns)).astype(np.float32), (20, 1))
        assert not shadowed(depth, KINECT.fx).any()


def test_pixels_at_an_edge_take_the_depth_of_either_side():
    depth = np.full((480, 640), 2.0, dtype=np.float32)
    depth[:, 320:400] = 1.5
    found = StructuredLight(KINECT, seed=2).measured(depth, 0.0)
    # To the right, where there is no shadow.
    assert 0.1 < (found[:, 399] > 1.8).mean() < 0.5 and (found[:, 397] > 1.8).mean() < 0.05
    assert 0.1 < (found[:, 400] < 1.8).mean() < 0.5
