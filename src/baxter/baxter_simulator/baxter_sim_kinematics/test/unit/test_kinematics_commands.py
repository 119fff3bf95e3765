# SPDX-License-Identifier: BSD-3-Clause
"""The commands fk and ik, and errors of reach, as they are called from a shell."""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from baxter_sim_kinematics.commands import read_robot
from urdf_model import UrdfError

PACKAGE = Path(__file__).resolve().parents[2]
BAXTER = PACKAGE.parents[1] / "baxter_common/baxter_description/urdf/baxter.urdf"
NEUTRAL = "0 -0.55 0 0.75 0 1.26 0".split()
BAXTER_ARM = ("--urdf", str(BAXTER), "--base", "base", "--tip", "left_gripper")


def command(name, *arguments, **options):
    return subprocess.Popen([sys.executable, str(PACKAGE / "scripts" / name), *arguments], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, **options)


def run(name, *arguments):
    """Return (exit status, standard output, standard error)."""
    process = command(name, *arguments)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def test_fk_and_ik_agree(left):
    status, out, _ = run("fk", *BAXTER_ARM, "--json", *NEUTRAL)
    tip = json.loads(out)
    np.testing.assert_allclose(tip["position"], left.fk(list(map(float, NEUTRAL)))[:3, 3], atol=1e-12)
    assert (status, tip["beyond_limits"]) == (0, [])
    pose = [str(number) for number in (*tip["position"], *tip["quaternion_xyzw"])]
    status, out, _ = run("ik", *BAXTER_ARM, "--json", "--solutions", "3", *pose, "--seed", *NEUTRAL)
    answer = json.loads(out)
    assert (status, tuple(answer["joints"])) == (0, left.joint_names)
    assert len(answer["solutions"]) == 3
    np.testing.assert_allclose(answer["solutions"][0], list(map(float, NEUTRAL)), atol=1e-5)


def test_fk_says_what_is_beyond_its_limits_and_takes_degrees():
    _, out, _ = run("fk", *BAXTER_ARM, "--degrees", "0", "-31", "0", "43", "0", "-200", "0")
    assert "beyond its limits: left_w1" in out
    assert "quaternion" in out and "manipulability" in out


def test_ik_says_why_there_is_no_solution():
    status, out, _ = run("ik", *BAXTER_ARM, "3", "0", "0", "0", "1", "0", "0")
    assert status == 1
    assert out.startswith("no solution: out of reach")
    status, out, _ = run("ik", *BAXTER_ARM, "--json", "3", "0", "0", "0", "1", "0", "0")
    assert json.loads(out)["reason"] == "out of reach"


@pytest.mark.parametrize("arguments, text", [
    (("ik", *BAXTER_ARM, "1", "2"), "expected 7 numbers for the pose, got 2"),
    (("ik", *BAXTER_ARM, "0.6", "0", "0", "0", "0", "0", "0"), "the identity is 0 0 0 1"),
    (("fk", *BAXTER_ARM, "1", "2"), "expected 7 joint values"),
    (("fk", "--urdf", str(BAXTER), "0"), "say --tip too"),
    (("fk", "--urdf", "/no/such/file.urdf", "--tip", "x", "0"), "No such file"),
    (("reach", *BAXTER_ARM, "--volume", "1", "0", "0", "1", "0", "1"), "each lower bound below"),
    (("reach", *BAXTER_ARM, "--cell", "-1"), "must be positive"),
])
def test_bad_input_gets_one_line(arguments, text, tmp_path):
    if arguments[0] == "reach":
        arguments = (*arguments, "--out", str(tmp_path))
    status, _, err = run(*arguments)
    assert status in (1, 2)
    assert text in err
    assert "Traceback" not in err


def test_xacro_that_does_not_expand_is_named(tmp_path):
    file = tmp_path / "arm.urdf.xacro"
    for text in ("<robot", '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${no}"/></robot>'):
        file.write_text(text)
        with pytest.raises(UrdfError, match="arm.urdf.xacro"):
            read_robot(file)
