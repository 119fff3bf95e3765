# SPDX-License-Identifier: BSD-3-Clause
"""The commands fk, ik and reach, as they are called from a shell."""
import csv
import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from baxter_sim_kinematics import Chain, reach, solve
from urdf_model.transforms import rigid

pytestmark = pytest.mark.once

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


# -- reach -----------------------------------------------------------------------------------------------------------


def reach_arguments(folder, *more):
    return ("reach", *BAXTER_ARM, "--volume", "0.3", "1.1", "-0.2", "0.6", "-0.2", "0.6", "--cell", "0.1",
            "--orientations", "6", "--out", str(folder), *more)


def test_map_is_written_as_data_and_picture(tmp_path, left):
    status, out, err = run(*reach_arguments(tmp_path, "--tool", "0", "0", "-1", "--jobs", "2"))
    assert status == 0, err
    assert "100 % of 512 cells" in err
    data = np.load(tmp_path / "reach.npz")
    share, manipulability = data["share"], data["manipulability"]
    assert share.shape == manipulability.shape == (8, 8, 8)
    assert 0.2 < share.mean() < 1.0
    assert (np.isnan(manipulability) == (share == 0.0)).all()
    rows = list(csv.DictReader(open(tmp_path / "reach.csv")))
    assert len(rows) == 512
    for row, part in zip(rows, share.ravel(), strict=True):
        assert float(row["reached_percent"]) == pytest.approx(100 * part, abs=0.01)
    # One cell by hand: its centre, gripper down.
    best = rows[int(np.argmax(share))]
    down = rigid(np.diag([1.0, -1.0, -1.0]), [float(best[axis]) for axis in ("x_m", "y_m", "z_m")])
    solve(left, down, left.mid_range)
    picture = cv2.imread(str(tmp_path / "reach.png"))
    assert picture is not None and min(picture.shape[:2]) > 200 and len(np.unique(picture.reshape(-1, 3), axis=0)) > 8


def test_interrupted_map_goes_on_where_it_was(tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert run(*reach_arguments(whole))[0] == 0
    first = command(*reach_arguments(broken, "--jobs", "1"), start_new_session=True)
    for line in first.stderr:  # a line each tenth
        if not line.startswith("0 %"):
            break
    os.killpg(first.pid, signal.SIGINT)
    _, err = first.communicate(timeout=60)
    assert "Traceback" not in err
    kept = {path: path.stat().st_mtime_ns for path in (broken / "parts").glob("0*.npz")}
    assert kept
    assert not (broken / "reach.npz").exists() or len(kept) == 16
    status, _, err = run(*reach_arguments(broken))
    assert status == 0, err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    for name in ("share", "manipulability"):
        np.testing.assert_array_equal(np.load(broken / "reach.npz")[name], np.load(whole / "reach.npz")[name])
    # Another map does not mix with it.
    status, _, err = run(*reach_arguments(broken, "--starts", "7"))
    assert status == 1 and "another starts (40 there)" in err


def test_map_of_a_planar_arm_is_the_ring_that_it_should_be(tmp_path):
    """Two links of 1 m and 0.6 m and a hand that turns freely: the ring from 0.4 m to 1.6 m, in the plane only."""
    joints = [(0, 0, 0), (1.0, 0, 0), (0.6, 0, 0)]
    chain = Chain("base", "tip", [("j%d" % i, "continuous", "l%d" % i, rigid(np.eye(3), origin), (0, 0, 1), None, None)
                                  for i, origin in enumerate(joints)]
                  + [("end", "fixed", "tip", rigid(np.eye(3), (0, 0, 0)), (0, 0, 1), None, None)])
    settings = reach.MapSettings((-1.8, -1.8, -0.1), (1.8, 1.8, 0.1), 0.2, 5, (0.0, 0.0, 1.0), 30, "ring")
    share, _ = reach.compute(chain, settings, tmp_path, 2)
    radius = np.linalg.norm(settings.centres()[:, :2], axis=1).reshape(settings.shape)
    inside = (radius > 0.45) & (radius < 1.55)
    outside = (radius < 0.35) | (radius > 1.65)
    assert settings.shape == (18, 18, 1)
    assert (share[inside] == 1.0).all()
    assert (share[outside] == 0.0).all()


def test_orientations_are_rotations_and_tools_point_where_they_should():
    for tool in (None, (0.3, -0.4, 1.0), (0, 0, -1)):
        settings = reach.MapSettings((0, 0, 0), (1, 1, 1), 0.5, 30, tool, 1, "")
        for rotation in settings.rotations():
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(rotation) == pytest.approx(1.0)
            if tool is not None:
                np.testing.assert_allclose(rotation[:, 2], np.array(tool) / math.dist(tool, (0, 0, 0)), atol=1e-12)


class Touches:
    """A checker of the postures in which the joint s0 is above zero."""

    def contact(self, joint_names, q):
        return "a touch" if q[0] > 0.0 else None


def test_postures_with_contacts_do_not_count(tmp_path, left):
    """The checker forbids half of the first joint's range, so poses need other postures, or are lost."""
    settings = reach.MapSettings((0.3, -0.2, 0.0), (1.1, 1.0, 0.2), 0.2, 8, None, 40, "left", True)
    every, _ = reach.cell_values(left, settings, settings.centres())
    free, manipulability = reach.cell_values(left, settings, settings.centres(), Touches())
    assert (free <= every).all() and 0.0 < free.mean() < every.mean()
    assert (np.isnan(manipulability) == (free == 0.0)).all()
    share, _ = reach.compute(left, settings, tmp_path, 2, new_checker=Touches)
    np.testing.assert_array_equal(share.ravel(), free)
    with pytest.raises(reach.ReachError, match="needs a collision checker"):
        reach.compute(left, settings, tmp_path, 2)


def test_no_reached_pose_counts_as_beyond_the_wrist(left):
    """Poses of random postures; the same poses, far away, do."""
    rng = np.random.default_rng(3)
    poses = np.array([left.fk(q) for q in rng.uniform(left.lower, left.upper, (500, len(left)))])
    assert not reach._beyond_wrist(left, poses).any()
    poses[:, :3, 3] += 1.2 * (poses[:, :3, 3] - left.shoulder)
    assert reach._beyond_wrist(left, poses).mean() > 0.5


def test_cells_in_parts_are_the_cells_of_the_whole():
    settings = reach.MapSettings((-0.4, 0.1, 0.3), (0.5, 1.0, 0.9), 0.13, 4, None, 1, "")
    whole = settings.centres()
    parts = [settings.centres(first, 32) for first in range(0, len(whole), 32)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert len(whole) == np.prod(settings.shape) and (whole[1] - whole[0])[2] == pytest.approx(0.13)


def test_map_without_self_collisions_by_command(tmp_path):
    status, _, err = run("reach", "--volume", "0.0", "0.8", "0.0", "0.8", "-0.1", "0.3", "--cell", "0.4",
                         "--orientations", "6", "--self-collision", "--jobs", "1", "--out", str(tmp_path))
    assert status == 0, err
    data = np.load(tmp_path / "reach.npz")
    assert data["self_collision"] and 0.0 < data["share"].mean() < 0.9
