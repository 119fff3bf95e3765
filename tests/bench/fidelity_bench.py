# SPDX-License-Identifier: BSD-3-Clause
"""Replays a recording of a physical Baxter through joint_command, with modelled actuators and with ideal drives.

`./baxter.sh bench fidelity [--recording FILE]` prints a line for each joint, and draws commanded, recorded and
simulated curves. FILE: a CSV file with the columns of recordings/baxter_tracking_100hz.csv.
"""
import os
import sys
import tempfile
from pathlib import Path

import numpy as np
from labs import HERE, Lab
from pictures import curves
from recording import JOINT_NAMES, Recording, delay_s, overshoots, rest, step_overshoot

RECORDING = HERE / "recordings" / "baxter_tracking_100hz.csv"
# Each joint's root mean square of simulated minus recorded position [rad].
RMSE_RAD = 0.012
# Largest difference of the overshoots of a step, in percent of the step.
OVERSHOOT_POINTS = 3.0
QUICK_S = 4.0


def measure(report, quick, number):
    path = Path(os.environ.get("BENCH_RECORDING") or RECORDING)
    recording = Recording.read(path, QUICK_S if quick else None)
    simulated = {effects: replay(path, len(recording.time_s), effects) for effects in ("all", "lag", "none")}
    steps = [step_overshoot(recording.commanded, values, recording.period_s)
             for values in (recording.sensed, simulated["all"])]
    lines = ["%-9s %8s %8s %8s  %17s  %17s  %17s  %17s" % (
        "joint", "RMSE", "largest", "ideal", "delay [s]", "beyond [rad]", "of a step [%]", "at rest [mrad]")]
    for j, name in enumerate(JOINT_NAMES):
        error = simulated["all"][:, j] - recording.sensed[:, j]
        ideal = simulated["none"][:, j] - recording.sensed[:, j]
        commanded, pair = recording.commanded[:, j], (recording.sensed[:, j], simulated["all"][:, j])
        lines.append("%-9s %8.4f %8.4f %8.4f  %8.3f %8.3f  %8.4f %8.4f  %8.1f %8.1f  %8.2f %8.2f" % (
            name, rms(error), np.abs(error).max(), rms(ideal),
            *(delay_s(commanded, values, recording.period_s) for values in pair),
            *(overshoots(commanded, values) for values in pair),
            *(overshoot[j] for overshoot in steps),
            *(1e3 * rest(commanded, values) for values in pair)))
        report.add("replay of a recording, %s: RMSE" % name, rms(error), "rad", ("ideal drives", rms(ideal)),
                   samples=len(error), **({} if quick else {"most": RMSE_RAD}))
        report.add("replay of a recording, %s: largest error" % name, float(np.abs(error).max()), "rad",
                   ("ideal drives", float(np.abs(ideal).max())), samples=len(error))
        report.add("replay of a recording, %s: overshoot of a step, off by" % name,
                   float(abs(steps[1][j] - steps[0][j])), "points", samples=len(error),
                   **({} if quick else {"most": OVERSHOOT_POINTS}))
    print("simulated against recorded; pairs: recorded, simulated", *lines, sep="\n", flush=True)
    if number == 0:
        folder = HERE.parents[1] / ".baxter/bench"
        folder.mkdir(parents=True, exist_ok=True)
        curves(recording.time_s, {name: {"commanded": recording.commanded[:, j], "recorded": recording.sensed[:, j],
                                         "simulated": simulated["lag"][:, j]}
                                  for j, name in enumerate(JOINT_NAMES)}, folder / "fidelity.png")


def rms(values):
    return float(np.sqrt(np.mean(values ** 2)))


def replay(path, count, effects):
    """Return the positions (count, 14) [rad] from the joint states, at the times of the recording's rows."""
    with tempfile.TemporaryDirectory() as folder, Lab(
            ready="/gazebo/advance", gui="false", enable="true", paused="true", joint_state_rate="500", effects=effects,
            left_electric_gripper="false", right_electric_gripper="false") as lab:
        found = Path(folder) / "positions.npy"
        process = lab.part("replay", path, count, found)
        process.wait()
        if process.returncode or not found.exists():
            sys.exit("lab_part.py replay failed with exit code %d" % process.returncode)
        return np.load(found)
