# SPDX-License-Identifier: BSD-3-Clause
"""An install space stands on its own: moved to another folder, it runs the lab without access to its original place."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.long
# Root can hide the workspace from a command: an empty file system in its place, in a private mount namespace.
WITHOUT_SOURCES = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs tmpfs "$0" && exec "$@"', str(ROOT)]


def installed(place, command, shell="bash"):
    """A command in a clean environment with only the install space; for root the workspace is hidden."""
    script = f'place=$1; shift; . "$place/setup.{shell}" && exec "$@"'
    environment = {key: os.environ[key] for key in ("HOME", "LANG", "TMPDIR") if key in os.environ}
    environment |= {"PATH": "/usr/bin:/bin", "ROS_MASTER_URI": "http://localhost:23511"}
    hidden = WITHOUT_SOURCES if os.geteuid() == 0 else []
    return [*hidden, "env", "-i", *(f"{key}={value}" for key, value in environment.items()),
            shell, "-c", script, "installed", str(place), *command]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("install")
    made, moved = folder / "here", folder / "moved"
    build = ["catkin_make", "-C", str(ROOT), "install", f"-DCMAKE_INSTALL_PREFIX={made}",
             "--build", str(folder / "build"), f"-DCATKIN_DEVEL_PREFIX={folder / 'devel'}"]
    # A space that is built with this workspace sourced would be an overlay of it.
    environment = {key: value for key, value in os.environ.items() if key != "CMAKE_PREFIX_PATH"}
    done = subprocess.run(build, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    made.rename(moved)
    return moved


@pytest.mark.parametrize("shell", ["bash", "sh"])
def test_its_environment_names_the_new_place_only(place, shell):
    show = ["python3", "-c", "import os, sys; print(*os.environ.values(), *sys.path, sys.prefix, sep=':')"]
    done = subprocess.run(installed(place, show, shell), cwd=place, capture_output=True, text=True, check=True)
    words = done.stdout.strip().split(":")
    assert any(word.startswith(str(place)) for word in words)
    old_places = tuple(str(ROOT / name) for name in ("src", "devel", "install", ".venv"))
    assert [word for word in words if word.startswith(old_places)] == []


def test_the_lab_runs(place, tmp_path):
    with (tmp_path / "launch.txt").open("w") as output:
        lab = subprocess.Popen(
            installed(place, ["roslaunch", "-p", "23511", "baxter_gazebo", "baxter_world.launch", "gui:=false"]),
            cwd=place, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            for program in (["baxter_tools", "enable_robot.py", "-e"], ["rf_lab2", "move_baxter.py"]):
                command = installed(place, ["rosrun", *program])
                done = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=90)
                assert done.returncode == 0, done.stdout + done.stderr + (tmp_path / "launch.txt").read_text()
        finally:
            os.killpg(lab.pid, signal.SIGINT)
            assert lab.wait(60) == 0
