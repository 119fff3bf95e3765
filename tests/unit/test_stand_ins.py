# SPDX-License-Identifier: BSD-3-Clause
"""Packages that replace missing ones are hidden if the installed ROS has them."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "tools" / "stand_ins.bash"


def bash(program, *arguments):
    done = subprocess.run(
        ["bash", "-c", f"source {SCRIPT}; {program}", "test", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_listed_packages_exist_and_what_set_up_writes_is_not_tracked():
    for folder in bash('printf "%s\\n" "${STAND_INS[@]}"'):
        assert (ROOT / folder / "package.xml").is_file()
        subprocess.run(["git", "-C", ROOT, "check-ignore", "--quiet", f"{folder}/CATKIN_IGNORE"], check=True)


def test_installed_packages_win_and_ours_come_back(tmp_path):
    workspace, share = tmp_path / "ws", tmp_path / "share"
    for name in ("base/xacro", "simulator/gazebo_msgs"):
        (workspace / "src" / name).mkdir(parents=True)
    (share / "xacro").mkdir(parents=True)
    (share / "xacro" / "package.xml").touch()
    marks = [workspace / "src" / name / "CATKIN_IGNORE" for name in ("base/xacro", "simulator/gazebo_msgs")]
    bash('leave_out_stand_ins "$@"', workspace, tmp_path / "nowhere", share)
    assert [mark.exists() for mark in marks] == [True, False]
    (share / "xacro" / "package.xml").unlink()
    bash('leave_out_stand_ins "$@"', workspace, tmp_path / "nowhere", share)
    assert [mark.exists() for mark in marks] == [False, False]
