# SPDX-License-Identifier: BSD-3-Clause
"""docs/sheets.md: its numbers of this project are those that the project gives."""
import re
from pathlib import Path

import numpy as np
import pytest

from arm_kinematics import Chain, pose_from_quaternion, solve_as_vendor
from baxter_model import joint_names, poses
from urdf_model import parse_urdf

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "sheets.md").read_text()
DESCRIPTION = ROOT / "src/baxter/baxter_common/baxter_description/urdf/baxter.urdf"


@pytest.fixture(scope="module")
def robot():
    return parse_urdf(DESCRIPTION.read_text(), source=str(DESCRIPTION))


def row(beginning):
    """The cells of the table row whose first cell begins so."""
    line, = (line for line in PAGE.splitlines() if line.startswith("| " + beginning))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_angles_of_the_second_labs_pose(robot):
    names = joint_names("left")
    table = np.array([[float(cell) for cell in row("`%s`" % name)[1:]] for name in names])
    sheet, here, difference = table.T
    neutral = poses().angles("neutral", "left")
    pose = pose_from_quaternion((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))
    answer = solve_as_vendor(Chain.from_robot(robot, "base", "left_gripper"), pose, [neutral[name] for name in names]).q
    np.testing.assert_allclose(here, answer, rtol=0.0, atol=2e-7)
    np.testing.assert_allclose(difference, 1e3 * (here - sheet), atol=0.0051)
    assert np.abs(difference).max() < 2.0


def test_torso_and_lines_of_the_description(robot):
    assert row("`baxter.urdf`: 1851 lines")[1] == "%d lines" % len(DESCRIPTION.read_text().splitlines())
    link = robot.links["torso"]
    assert "%.6f" % link.inertial.mass in row("mass of `torso`")[0]
    moments = link.inertial.inertia
    assert row("its inertia")[0] == "its inertia " + ", ".join(
        "%.6f" % moments[place] for place in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    assert [joint.origin.tolist() for joint in robot.chain("base", "torso")] == [np.eye(4).tolist()]


def test_second_pose_of_the_notes():
    settings = (ROOT / "src/courses/baxter_traj_streamer/config/streamer.yaml").read_text()
    wanted = re.findall(r"-?\d\.\d+", row("second pose")[0])
    assert len(wanted) == 7
    assert [number for number in wanted if number in settings] == wanted
