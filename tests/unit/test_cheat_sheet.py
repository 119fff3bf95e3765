# SPDX-License-Identifier: BSD-3-Clause
"""docs/cheat_sheet.md agrees with the robot's description, its interface and the packages."""
import math
import os
import re
import shutil
from pathlib import Path

import pytest
import rospkg

import xacro
from urdf_model import parse_urdf

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "cheat_sheet.md").read_text()
DESCRIPTION = "urdf/baxter.urdf.xacro"


@pytest.fixture(scope="module")
def limits():
    """{joint: its Limit} of the robot's description."""
    file = str(Path(rospkg.RosPack().get_path("baxter_description")) / DESCRIPTION)
    robot = parse_urdf(xacro.process_file(file).toxml(), source=file)
    return {joint.name: joint.limit for joint in robot.joints.values()}


def rows(heading):
    """The cells of the table below a heading, without its two first lines."""
    section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return [[cell.strip() for cell in line.strip("|").split(" | ")]
            for line in section.splitlines() if line.startswith("|")][2:]


def as_printed(value, text):
    """The value with as many decimals as the text has."""
    return f"{value:.{len(text.partition('.')[2])}f}"


def test_joints_have_the_limits_of_the_description(limits):
    table = rows("Joints")
    assert [row[0] for row in table] == [f"`{joint}`" for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")]
    for joint, _, lower, upper, velocity in table:
        for side in ("left_", "right_"):
            limit = limits[side + joint.strip("`")]
            found = [as_printed(value, text) for value, text in
                     ((limit.lower, lower), (limit.upper, upper), (limit.velocity, velocity))]
            assert found == [lower, upper, velocity], joint
    low, high = re.search(r"`head_pan` turns from (\S+) to (\S+) rad", PAGE).groups()
    assert (as_printed(limits["head_pan"].lower, low), as_printed(limits["head_pan"].upper, high)) == (low, high)
    assert math.isclose(float(high), math.pi / 2, abs_tol=1e-4)


def test_the_robots_topics_stand_on_the_page_of_its_interface():
    interface = (ROOT / "docs" / "interface.md").read_text().replace("<limb>", "LIMB")
    # Served by nodes of their own, which interface.md names in its prose.
    named = [row[0] for row in rows("Topics and services") if row[0].startswith("`/robot")]
    assert len(named) >= 5
    missing = [topic for row in named for topic in re.findall(r"`(/[^`]+)`", row)
               if topic not in interface and "follow_joint_trajectory" not in topic]
    assert missing == []


def test_commands_exist():
    packages = rospkg.RosPack()
    commands = set(re.findall(r"`rosrun (\w+) (\S+?)[ `]", PAGE))
    assert len(commands) >= 8
    for package, name in sorted(commands):
        if package in ("rviz", "tf"):  # Debian's: its executables lie outside of the package's folder
            continue
        folder = packages.get_path(package)
        found = [path for path in Path(folder).rglob(name) if path.is_file() and os.access(path, os.X_OK)]
        assert found, f"{package} {name}"
    for tool in sorted(set(re.findall(r"`(ros(?:service|topic)) ", PAGE))):
        assert shutil.which(tool), tool
