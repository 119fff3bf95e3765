# SPDX-License-Identifier: BSD-3-Clause
"""Set-up in a clone of this workspace with the real commands: without network, killed at each step, and out of disk.

The step that installs Debian packages has nothing to do here; docs/platforms.md says how that step was tested.
"""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from lab_testing.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(os.geteuid() != 0, reason="taking the network away and filling a disk need root"),
]
LIMIT_S = 1200
# Time until each step is killed [s]: in the middle of the long ones.
KILL_AFTER_S = {"venv": 1.0, "pip": 12.0, "meshes": 0.0, "overlay": 0.0, "build": 12.0, "urdf": 0.5, "kernels": 4.0}
# Free disk at the start [kB], too little for the step; baxter.urdf needs hardly more than the logs of set-up do.
FREE_KB = {"venv": 6000, "pip": 200000, "meshes": 6000, "overlay": 6000, "build": 12000, "urdf": 32, "kernels": 200}
# The same for the second half of the step "kernels", the spheres of robots.
SPHERES_FREE_KB = 100
# Size of the overlay's package; it is downloaded compressed, and then unpacked.
OVERLAY_BYTES = 10_000_000
TITLES = {
    "venv": "virtual environment", "pip": "Python packages", "meshes": "Baxter's meshes", "build": "catkin_make",
    "overlay": "other people's packages", "urdf": "baxter.urdf", "kernels": "compiled inner loops",
}
PORT = 23911


def clean_environment():
    """The environment of a fresh shell: nothing of the workspace that runs this test."""
    keep = ("HOME", "LANG", "TMPDIR", "PIP_CERT", "PIP_FIND_LINKS", "PIP_INDEX_URL", "SSL_CERT_FILE")
    return {**{name: os.environ[name] for name in keep if name in os.environ}, "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}


def clone(folder):
    subprocess.run(["git", "-c", f"safe.directory={ROOT}", "clone", "-q", ROOT, folder], check=True)
    return folder


def set_up(folder, *words, prefix=()):
    """(exit status, what set-up says)"""
    command = [*prefix, folder / "baxter.sh", "setup", *words]
    done = subprocess.run(command, cwd=folder, env=clean_environment(), stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LIMIT_S)
    return done.returncode, done.stdout


def assert_failed(said, folder, step, cause):
    assert f"failed in step '{TITLES[step]}'" in said, said
    assert f"cause:   {cause}" in said, said
    assert f"log:     {folder}/.baxter/logs/{step}.log" in said, said


def kill_in(folder, step, words):
    """Start set-up, and kill it with all its children during ``step``."""
    log = folder / ".baxter" / "logs" / f"{step}.log"
    log.unlink(missing_ok=True)
    process = subprocess.Popen([folder / "baxter.sh", "setup", *words], cwd=folder, env=clean_environment(),
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)

    def is_at_work():
        assert process.poll() is None, f"set-up ended before it began with {step}"
        return log.exists() and "\n$ " in log.read_text(errors="replace")

    wait_until(is_at_work, f"set-up to begin with {step}", LIMIT_S, 0.005)
    # The moment of the kill is what is tested.
    time.sleep(KILL_AFTER_S[step])
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert (folder / ".baxter" / "at_work").read_text().strip() == step, "killed too late"


def make_overlay(folder):
    """A rosinstall file that lists a git repository with one package."""
    package = folder / "theirs" / "robot_extras"
    package.mkdir(parents=True)
    (package / "package.xml").write_text(
        '<package format="3"><name>robot_extras</name><version>1.0.0</version><description>x</description>'
        '<maintainer email="a@example.org">A</maintainer><license>BSD</license>'
        "<buildtool_depend>catkin</buildtool_depend></package>")
    (package / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.0.2)\nproject(robot_extras)\n"
        "find_package(catkin REQUIRED)\ncatkin_package()\n")
    (package / "mesh.stl").write_bytes(os.urandom(OVERLAY_BYTES))
    git = ["git", "-C", folder / "theirs", "-c", "user.name=A", "-c", "user.email=a@example.org"]
    for command in (["init", "-q", "-b", "main"], ["add", "."], ["commit", "-q", "-m", "first"]):
        subprocess.run([*git, *command], check=True)
    listed = folder / "theirs.rosinstall"
    listed.write_text(f"- git: {{local-name: theirs, uri: '{folder}/theirs', version: main}}\n")
    return listed


def leave_free(disk, folder, free_kb):
    """Make the file system ``disk`` so small that ``free_kb`` [kB] are left."""
    # Set-up overwrites each log: those of steps that had much to say would make room for the step that is meant.
    for log in (folder / ".baxter" / "logs").glob("*.log"):
        log.write_text("")
    used = subprocess.run(["df", "-k", "--output=used", disk], capture_output=True, text=True, check=True)
    used_kb = int(used.stdout.split()[1])
    subprocess.run(["mount", "-o", f"remount,size={used_kb + free_kb}k", disk], check=True)


def assert_lab_works(folder):
    environment = {**clean_environment(), "ROS_MASTER_URI": f"http://localhost:{PORT}"}
    launch = ["roslaunch", "-p", str(PORT), "baxter_gazebo", "baxter_world.launch", "gui:=false", "enable:=true"]
    lab = subprocess.Popen([folder / "baxter.sh", "sim", *launch], env=environment, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        for program in (["baxter_tools", "enable_robot.py", "-e"], ["rf_lab2", "move_baxter.py"]):
            done = subprocess.run([folder / "baxter.sh", "sim", "rosrun", *program], env=environment, timeout=180,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            assert done.returncode == 0, done.stdout
        assert "0.0 mm" in done.stdout
    finally:
        os.killpg(lab.pid, signal.SIGINT)
        assert lab.wait(60) == 0


def test_without_network_and_killed_at_every_step(tmp_path):
    folder = clone(tmp_path / "ws")
    status, said = set_up(folder, prefix=["unshare", "-n"])
    assert status != 0
    assert_failed(said, folder, "pip", "the network cannot be reached")
    overlay = ["--with", str(make_overlay(tmp_path))]
    shutil.rmtree(folder / ".venv")
    for step in KILL_AFTER_S:
        kill_in(folder, step, overlay)
    status, said = set_up(folder, *overlay)
    assert status == 0 and "cut off in step 'compiled inner loops'" in said, said
    assert (folder / "src_overlay" / "theirs" / "robot_extras" / "package.xml").exists()
    assert_lab_works(folder)


def test_out_of_disk_at_every_step(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4G", "tmpfs", disk], check=True)
    try:
        folder = clone(disk / "ws")
        overlay = ["--with", str(make_overlay(tmp_path))]
        # A set-up from the beginning would refuse to start with so little.
        (folder / ".venv").mkdir()
        steps = ["apt", "venv", "pip", "meshes", "overlay", "build", "urdf", "kernels"]
        for step, free_kb in FREE_KB.items():
            words = overlay if step == "overlay" else []
            leave_free(disk, folder, free_kb)
            status, said = set_up(folder, *words)
            assert status != 0, f"{free_kb} kB were enough for {step}: {said}"
            assert_failed(said, folder, step, "the disk is full")
            subprocess.run(["mount", "-o", "remount,size=4G", disk], check=True)
            status, said = set_up(folder, *words, *steps[:steps.index(step) + 1])
            assert status == 0, said
        assert (folder / "src_overlay/theirs/robot_extras/mesh.stl").stat().st_size == OVERLAY_BYTES
        # Compiled code is there: what is missing now are the spheres.
        for spheres in folder.glob("src/**/__pycache__/motion_planning_spheres-*"):
            shutil.rmtree(spheres)
        leave_free(disk, folder, SPHERES_FREE_KB)
        status, said = set_up(folder)
        assert status != 0, said
        assert_failed(said, folder, "kernels", "the disk is full")
        subprocess.run(["mount", "-o", "remount,size=4G", disk], check=True)
        status, said = set_up(folder)
        assert status == 0, said
        assert_lab_works(folder)
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)
