# SPDX-License-Identifier: BSD-3-Clause
"""Other people's packages: fetched from a git repository, refused if they are Python 2, built, preferred to ours."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON_2 = "def hello():\n    print 'hello'\n"
MANIFEST = """<package format="3"><name>{name}</name><version>1.0.0</version><description>test</description>
<maintainer email="a@example.org">A</maintainer><license>BSD</license>
<buildtool_depend>catkin</buildtool_depend></package>"""
CMAKE = """cmake_minimum_required(VERSION 3.0.2)
project({name})
find_package(catkin REQUIRED)
catkin_python_setup()
catkin_package()
"""
SETUP = """from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup
setup(**generate_distutils_setup(packages=["{name}"], package_dir={{"": "src"}}))
"""


def make_package(folder, name, text):
    (folder / "src" / name).mkdir(parents=True)
    (folder / "package.xml").write_text(MANIFEST.format(name=name))
    (folder / "CMakeLists.txt").write_text(CMAKE.format(name=name))
    (folder / "setup.py").write_text(SETUP.format(name=name))
    (folder / "src" / name / "__init__.py").write_text(text)


def bash(program, *arguments):
    """Standard output of a program that may use overlay.bash; raises if it fails."""
    command = ["bash", "-c", f'source "{ROOT}/tools/overlay.bash"; {program}', "test", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def check(folder):
    command = [sys.executable, str(ROOT / "tools" / "check_overlay.py"), str(folder)]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.fixture
def workspace(tmp_path):
    """One with a package robot_sdk of its own, and a git repository, listed in a rosinstall file, that has one too."""
    root, theirs = tmp_path / "ws", tmp_path / "theirs"
    make_package(root / "src" / "group" / "robot_sdk", "robot_sdk", 'WHOSE = "ours"\n')
    make_package(root / "src" / "group" / "robot_tools", "robot_tools", 'WHOSE = "ours"\n')
    make_package(theirs / "robot_sdk", "robot_sdk", 'WHOSE = "theirs"\n')
    git = ["git", "-C", str(theirs), "-c", "user.name=A", "-c", "user.email=a@example.org"]
    subprocess.run([*git, "init", "-q", "-b", "main"], check=True)
    subprocess.run([*git, "add", "."], check=True)
    subprocess.run([*git, "commit", "-q", "-m", "first"], check=True)
    (tmp_path / "sdk.rosinstall").write_text(f"- git: {{local-name: sdk, uri: '{theirs}', version: main}}\n")
    return root


def test_theirs_is_fetched_built_and_wins_and_ours_comes_back(workspace, tmp_path):
    bash('import_overlay "$@"', workspace, tmp_path / "sdk.rosinstall")
    assert bash('leave_out_overlaid "$@"', workspace) == "robot_sdk\n"
    whose = """
        cd "$0" && catkin_make >log 2>&1 || { cat log >&2; exit 1; }
        source devel/setup.bash
        rospack find robot_sdk
        python3 -c 'import robot_sdk, robot_tools; print(robot_sdk.WHOSE, robot_tools.WHOSE)'
    """
    done = subprocess.run(["bash", "-c", whose, str(workspace)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    path, names = done.stdout.splitlines()
    assert Path(path).resolve() == workspace / "src_overlay" / "sdk" / "robot_sdk"
    assert names == "theirs ours"

    subprocess.run(["rm", "-r", str(workspace / "src_overlay")], check=True)
    assert bash('leave_out_overlaid "$@"', workspace) == ""
    assert list((workspace / "src").rglob("CATKIN_IGNORE")) == []
    assert not (workspace / "src" / "overlay").is_symlink()


def test_a_folder_that_nobody_fetched_counts_as_well(workspace):
    make_package(workspace / "src_overlay" / "mine" / "robot_tools", "robot_tools", 'WHOSE = "mine"\n')
    assert bash('leave_out_overlaid "$@"', workspace) == "robot_tools\n"
    assert (workspace / "src" / "overlay" / "mine" / "robot_tools" / "package.xml").is_file()


def test_the_same_name_twice_is_refused(workspace):
    for folder in ("a", "b"):
        make_package(workspace / "src_overlay" / folder / "robot_sdk", "robot_sdk", "")
    with pytest.raises(subprocess.CalledProcessError) as failure:
        bash('leave_out_overlaid "$@"', workspace)
    assert "twice" in failure.value.stderr and "src_overlay/a" in failure.value.stderr


def test_python_2_is_refused_with_file_and_line(tmp_path):
    make_package(tmp_path / "fine", "fine", "print('hello')\n")
    assert check(tmp_path).returncode == 0
    (tmp_path / "fine" / "node").write_text("#!/usr/bin/env python\n" + PYTHON_2)
    (tmp_path / "fine" / "old.py").write_text(PYTHON_2)
    done = check(tmp_path)
    assert done.returncode == 1
    assert f"{tmp_path}/fine/node:3: " in done.stderr and f"{tmp_path}/fine/old.py:2: " in done.stderr


def test_files_that_come_with_the_workspace_are_well_formed():
    import yaml

    files = list((ROOT / "rosinstall").glob("*.rosinstall"))
    assert files
    for file in files:
        for entry in yaml.safe_load(file.read_text()):
            assert set(entry["git"]) == {"local-name", "uri", "version"}, file
