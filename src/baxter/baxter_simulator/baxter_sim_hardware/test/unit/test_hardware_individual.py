# SPDX-License-Identifier: BSD-3-Clause
"""Robots that are not the drawing: their descriptions, what they publish of them, and lenses."""
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import xacro
from baxter_model import SIDES
from baxter_sim_hardware import effects, individual
from baxter_sim_hardware.errors import BaxterHardwareError
from baxter_sim_hardware.sensing.optics import Optics
from sensor_renderer.pinhole import Pinhole
from urdf_model import parse_urdf

HEARD = ("limb/*/endpoint_state",)

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "robot_of_serial"
MOUNTS = ["%s_torso_arm_mount" % side for side in SIDES]
ARRAY = Pinhole(1280, 800, 476.7, 476.7, 639.5, 399.5, 0.01, 100.0)


@pytest.fixture(scope="module")
def drawing(robot_file):
    return xacro.process_file(robot_file).toxml()


@pytest.fixture(scope="module")
def rows():
    return effects.read(effects.physical_robot())["serial"]


def origins(urdf_xml):
    """{joint: (2, 3) xyz and rpy} of all joints."""
    return {joint.get("name"): np.array([[float(word) for word in joint.find("origin").get(name, "0 0 0").split()]
                                         for name in ("xyz", "rpy")])
            for joint in ElementTree.fromstring(urdf_xml).findall("joint") if joint.find("origin") is not None}


def test_robot_0_is_the_drawing(drawing, rows):
    assert individual.described(drawing, 0, rows) is drawing


def test_a_robot_has_its_own_mounts_cameras_and_grippers_and_nothing_else(drawing, rows):
    before, after = origins(drawing), origins(individual.described(drawing, 3, rows))
    assert list(before) == list(after)
    moved = {name for name in before if not np.array_equal(before[name], after[name])}
    assert moved == set(individual.PLACED) and moved <= set(before)
    for name in moved:
        by = np.abs(after[name] - before[name])
        assert 1e-5 < by[0].max() < 0.013 and 1e-5 < by[1].max() < 0.021, name
    left, right = (after[name][0] - before[name][0] for name in MOUNTS)
    assert not np.allclose(left, right)


def test_the_same_serial_is_the_same_robot_and_another_is_another(drawing, rows):
    first, again, other = (individual.described(drawing, serial, rows) for serial in (1, 1, 2))
    assert first == again != other
    bare = drawing.replace('name="head_camera"', 'name="head_camera_2"')
    assert origins(individual.described(bare, 1, rows))[MOUNTS[0]].tolist() == origins(first)[MOUNTS[0]].tolist()


def test_what_the_robot_publishes_is_in_its_description(drawing, rows):
    described = individual.described(drawing, 4, rows)
    published = individual.robot_config(described)
    assert set(published) == {"/robot_config/jcb_urdf_config/torso_t0/joint/%s/origin/%s" % (name, part)
                              for name in MOUNTS for part in ("xyz", "rpy")}
    for name, origin in ((name, origins(described)[name]) for name in MOUNTS):
        for values, part in zip(origin, ("xyz", "rpy"), strict=True):
            text = published["%s%s/origin/%s" % (individual.ROBOT_CONFIG, name, part)]
            np.testing.assert_allclose([float(word) for word in text.split()], values)


def test_the_hand_is_where_the_robots_own_mount_puts_it(make_lab, drawing, rows):
    """In the physics, and in what endpoint_state says."""
    described = individual.described(drawing, 5, rows)
    hands = {}
    for key, xml in (("drawing", drawing), ("own", described)):
        lab = make_lab(parse_urdf(xml, source=key))
        lab.run(0.1)
        pose = lab.last("limb/left/endpoint_state").pose.position
        in_world = lab.model.link_pose("left_gripper").position
        hands[key] = np.array([pose.x, pose.y, pose.z])
        np.testing.assert_allclose(hands[key] + [0.0, 0.0, 0.93], in_world, atol=1e-4)
    moved = np.linalg.norm(hands["own"] - hands["drawing"])
    assert 1e-3 < moved < 0.05


@pytest.mark.parametrize("serial", [-1, "three", 2.5, True, None, 2 ** 31])
def test_what_is_no_serial_is_refused(serial):
    with pytest.raises(BaxterHardwareError, match="serial is .*; it must be a whole number"):
        individual.checked(serial)


def test_a_lab_refuses_such_a_serial(make_lab):
    with pytest.raises(Exception, match="serial is -3"):
        make_lab(parameters={"serial": -3})


def test_the_script_prints_the_robot_and_passes_a_failure_on(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text('<robot name="r"><link name="torso"/><link name="left_arm_mount"/><joint name="%s" type="fixed">'
                    '<parent link="torso"/><child link="left_arm_mount"/></joint></robot>\n' % MOUNTS[0])

    def run(*words):
        return subprocess.run([sys.executable, str(SCRIPT), *words], capture_output=True, text=True, timeout=60)

    assert run("0", "cat", str(file)).stdout == file.read_text()
    moved = run("7", "cat", str(file))
    assert moved.returncode == 0 and 'origin xyz="' in moved.stdout and '"0 0 0"' not in moved.stdout
    for words, said in ((("x", "cat", str(file)), "serial is 'x'"), (("1", "cat", str(tmp_path / "none")), "none"),
                        (("1", "echo", "<robot"), "is no XML"), ((), "robot_of_serial SERIAL COMMAND")):
        failed = run(*words)
        assert failed.returncode != 0 and said in failed.stderr, words


# -- lenses

def test_each_camera_of_each_robot_has_its_own_lens():
    lenses = [Optics(name, set(), serial, 0).pinhole(ARRAY, ARRAY.fx)
              for serial in (1, 2) for name in ("left_hand_camera", "right_hand_camera")]
    assert len({lens.fx for lens in lenses}) == len({lens.cx for lens in lenses}) == 4
    for lens in lenses:
        assert abs(lens.fx / ARRAY.fx - 1.0) < 0.021 and abs(lens.fy / lens.fx - 1.0) < 0.0041
        assert max(abs(lens.cx - ARRAY.cx), abs(lens.cy - ARRAY.cy)) <= 20.0


def test_a_smaller_picture_is_of_the_same_lens():
    half = Pinhole(640, 400, 238.35, 238.35, 319.5, 199.5, 0.01, 100.0)
    optics = Optics("left_hand_camera", {"noise"}, 3, 0)
    whole, small = (optics.pinhole(pinhole, ARRAY.fx) for pinhole in (ARRAY, half))
    assert small.fx == pytest.approx(whole.fx / 2.0)
    assert small.cx - half.cx == pytest.approx((whole.cx - ARRAY.cx) / 2.0)


def test_without_effects_robot_0_sees_the_ideal_picture():
    optics = Optics("left_hand_camera", set(), 0, 0)
    picture = np.full((400, 640, 3), 128, dtype=np.uint8)
    assert optics.pinhole(ARRAY, ARRAY.fx) is ARRAY and optics.seen(picture, ARRAY, 1.0) is picture


def test_pictures_have_noise_and_dark_corners_the_same_for_the_same_seed():
    picture = np.full((800, 1280, 3), 128, dtype=np.uint8)

    def seen(seed, time_s):
        optics = Optics("head_camera", {"noise"}, 0, seed)
        pinhole = optics.pinhole(ARRAY, ARRAY.fx)
        assert pinhole.fx == 406.0
        optics.seen(picture, pinhole, 0.5)
        return optics.seen(picture, pinhole, time_s)

    first = seen(1, 2.0)
    assert np.array_equal(first, seen(1, 2.0))
    assert not np.array_equal(first, seen(1, 2.04)) and not np.array_equal(first, seen(2, 2.0))
    centre, corner = first[380:420, 620:660], first[:40, :40]
    assert 1.0 < centre.std() < 3.0 and abs(centre.mean() - 128.0) < 1.5
    assert 0.6 < corner.mean() / centre.mean() < 0.8
    assert picture.min() == picture.max() == 128


def test_a_robot_with_a_file_of_its_own_has_its_numbers_and_the_drawing_s_mounts(make_lab, tmp_path):
    """Also one arm's own; a missing file is named."""
    text = effects.physical_robot().read_text(encoding="utf-8").replace("{s0: 139.0,", "{s0: 139.0, left_s0: 77.0,")
    path = tmp_path / "own.yaml"
    path.write_text(text, encoding="utf-8")
    assert individual.checked(str(path)) == individual.DRAWING
    lab = make_lab(parameters={"enable": True, "effects": "lag", "serial": str(path)})
    assert lab.plugin._simulated.numbers["lag"]["proportional_gain"]["left_s0"] == 77.0
    gain = lab.plugin._baxter.actuators._numbers[3]
    assert (gain[0], gain[7]) == (77.0, 139.0)
    with pytest.raises(Exception, match="none.yaml cannot be read"):
        make_lab(parameters={"enable": True, "effects": "lag", "serial": str(tmp_path / "none.yaml")})
