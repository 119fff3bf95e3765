# SPDX-License-Identifier: BSD-3-Clause
"""The jobs that come with the workspace."""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from baxter_sim_kinematics import reach_commands
from lab_batch import JobError, Spec, load
from lab_batch.processes import BatchLimits, map_seeds
from lab_batch.shipped import JOBS, Command


def test_a_program_gets_its_seed_and_a_separate_master():
    program = ("import os, json; print('noise'); "
               "print(json.dumps({'uri': os.environ['ROS_MASTER_URI'], 'seed': {seed}}))")
    job = Command(command="%s -c %s" % (sys.executable, json.dumps(program)))
    job.start()
    found = job.run(7)
    assert (found["exit_code"], found["seed"]) == (0, 7)
    assert found["uri"] != job.run(8)["uri"]


def test_a_program_that_fails_says_how():
    job = Command(command="%s -c \"raise SystemExit('no robot')\"" % sys.executable)
    job.start()
    with pytest.raises(RuntimeError, match="exit code 1; the end of its output: no robot"):
        job.run(1)


_LAUNCH = """import sys
print("\\x1b[1mprocess[trial-2]: started with pid [7]\\x1b[0m")
print({0!r})
print("\\x1b[31m" + 80 * "=" + "REQUIRED process [trial-2] has died!\\n{1}\\nlog file: x.log\\nInitiating shutdown!")
print("[trial-2] killing on exit\\n\\x1b[1mdone\\x1b[0m")
"""


def test_results_of_a_launch_file_stand_before_the_words_of_roslaunch(tmp_path):
    """With what roslaunch 1.15 prints when a required node ends; roslaunch ends with 0 in either case."""
    (tmp_path / "good.py").write_text(_LAUNCH.format('{"placed": true}', "process has finished cleanly"))
    (tmp_path / "bad.py").write_text(_LAUNCH.format(
        "no cube found", "process has died [pid 7, exit code 3, cmd trial.py __name:=trial]."))
    good, bad = (Command(command="%s %s" % (sys.executable, tmp_path / name)) for name in ("good.py", "bad.py"))
    assert good.run(1) == {"exit_code": 0, "placed": True}
    with pytest.raises(RuntimeError, match=r"required node trial-2 ended with exit code 3; .*\nno cube found$"):
        bad.run(1)


def test_inverse_kinematics_solves_reachable_poses():
    found, = map_seeds(Spec("lab_batch.shipped:InverseKinematics", {"poses": 20}), [5], BatchLimits(1))
    assert found.result["all_solved"], found
    assert found.result["farthest_off_m"] < 1e-4


def one(name, seed, **parameters):
    """The result of one episode of a shipped job, in this process."""
    job = load(Spec(JOBS[name][0], parameters))
    try:
        return job.run(seed)
    finally:
        job.end()


def test_parts_of_a_map_are_those_of_reach(tmp_path):
    """Computed by a batch, then put together by the command, which finds all of them there."""
    words = ["--cell", "0.6", "--orientations", "3", "--out", str(tmp_path)]
    job = load(Spec(JOBS["reach"][0], {"out": str(tmp_path), "cell": 0.6, "orientations": 3, "self_collision": False}))
    found = job.run(0)
    assert found["parts"] == 1 and 0 < found["reached_poses"] < 3 * found["cells"]
    with pytest.raises(ValueError, match="1 parts, 0 to 0"):
        job.run(1)
    written = (tmp_path / "parts" / "0000000.npz").stat().st_mtime_ns
    script = Path(reach_commands.__file__).parents[2] / "scripts" / "reach"
    done = subprocess.run([sys.executable, str(script), *words], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "parts" / "0000000.npz").stat().st_mtime_ns == written
    assert np.load(tmp_path / "reach.npz")["share"].sum() * 3 == pytest.approx(found["reached_poses"])


def test_plans_among_boxes_depend_on_the_seed_alone():
    found = [one("planning", seed, boxes=3) for seed in (1, 2, 1)]
    assert found[0] == found[2] != found[1]
    for result in found:
        if result["planned"]:
            assert result["length_rad"] >= result["straight_rad"] - 1e-6


def test_gains_are_drawn_and_their_step_is_simulated():
    """With much of the good and with hardly any gain; gains in between are drawn by the seed."""
    good = one("tuning", 0, joint="joint_6", p=(60.0, 60.0), i=(1.0, 1.0), d=(3.0, 3.0))
    weak = one("tuning", 0, p=(1e-3, 1e-3), i=(1e-3, 1e-3), d=(1e-3, 1e-3))
    assert good["itae"] < weak["itae"] and not weak["settles"]
    first, again, other = (one("tuning", seed, seconds=0.1) for seed in (3, 3, 4))
    assert first == again and first["p"] != other["p"]
    with pytest.raises(JobError, match="bounds of p"):
        one("tuning", 0, p=(0.0, 1.0))


def test_robot_zero_is_the_drawing_and_others_are_not():
    drawing, own = (one("serials", serial, postures=20) for serial in (0, 5))
    assert max(drawing[name] for name in drawing if name.endswith("mm")) < 1e-6
    assert all(0.5 < own[side + "_hand_off_most_mm"] < 60.0 for side in ("left", "right"))
