# SPDX-License-Identifier: BSD-3-Clause
"""Spheres that are made beforehand are those that planning asks for."""
import os
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2]
URDF = """<robot name="crank">
<link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
<link name="arm"><collision><geometry><cylinder radius="0.04" length="0.5"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def prepare(cache, *files, before=""):
    cache.mkdir(exist_ok=True)
    # Compiled code stays where it is: only the spheres go into a folder of the test.
    program = ("import sys; from motion_planning.spheres import sphere_model; from motion_planning import commands; "
               "sphere_model.folder = lambda *_: sys.argv[1]; " + before
               + "sys.exit(commands.prepare_robots(sys.argv[2:]))")
    return subprocess.run([sys.executable, "-c", program, str(cache), *map(str, files)], capture_output=True, text=True,
                          timeout=300)


def test_spheres_of_every_robot_are_kept(tmp_path):
    first, second = tmp_path / "first.urdf", tmp_path / "second.urdf"
    first.write_text(URDF)
    second.write_text(URDF.replace("0.04", "0.06"))
    done = prepare(tmp_path / "cache", first, second)
    assert (done.returncode, done.stderr) == (0, "")
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").glob("*.npy")}
    assert len(made) == 4  # the base is the same box; one is of the robot that is planned for to compile
    assert prepare(tmp_path / "cache", first, second).returncode == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").glob("*.npy")} == made


def test_what_is_no_robot_is_named_and_the_others_are_prepared(tmp_path):
    good, bad = tmp_path / "good.urdf", tmp_path / "bad.urdf"
    good.write_text(URDF)
    bad.write_text("<robot")
    done = prepare(tmp_path / "cache", bad, tmp_path / "none.urdf", good)
    assert done.returncode == 1
    assert [line.split(":")[:2] for line in done.stderr.splitlines()] == [
        ["prepare_robots", " " + str(bad)], ["prepare_robots", " " + str(tmp_path / "none.urdf")]]
    assert len(list((tmp_path / "cache").glob("*.npy"))) == 3


def test_spheres_that_find_no_room_are_named_and_nothing_half_written_stays(tmp_path):
    robot = tmp_path / "robot.urdf"
    robot.write_text(URDF)
    # As on a full disk: files can be made, but hold nothing.
    full = ("import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
            "resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)); ")
    done = prepare(tmp_path / "cache", robot, before=full)
    assert done.returncode == 1
    assert "%s: the spheres of 2 links cannot be kept on disk, 'base' is the first" % robot in done.stderr
    assert not list((tmp_path / "cache").iterdir())


def test_the_script_needs_a_file():
    done = subprocess.run([sys.executable, str(PACKAGE / "scripts/prepare_robots")], capture_output=True, text=True,
                          env={**os.environ, "COLUMNS": "120"}, timeout=300)
    assert done.returncode == 2 and "urdf" in done.stderr
