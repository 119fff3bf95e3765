# SPDX-License-Identifier: BSD-3-Clause
"""Replays a recording of a physical Baxter through joint_command, with modelled actuators and with ideal drives.

`./baxter.sh bench fidelity [--recording FILE] [--from S]` prints a line for each joint, what the model does in its
worst second, and draws commanded, recorded and simulated curves. FILE: a CSV file with the columns of
recordings/baxter_tracking_100hz.csv; S: the second of it to begin at, which may be in motion.
"""
import os
from pathlib import Path

import numpy as np
from labs import HERE
from pictures import curves
from recording import JOINT_NAMES, Recording, delay_s, overshoots, rest, step_overshoot
from replaying import Start, bare_robot, replay

from baxter_sysid.replay import ReplayedMotion
from baxter_sysid.sheet import worst_seconds

RECORDING = HERE / "recordings" / "baxter_tracking_100hz.csv"
# Each joint's root mean square of simulated minus recorded position [rad].
RMSE_RAD = 0.012
# Largest difference of the overshoots of a step, in percent of the step.
OVERSHOOT_POINTS = 3.0
QUICK_S = 4.0


def measure(report, quick, number):
    path = Path(os.environ.get("BENCH_RECORDING") or RECORDING)
    whole = Recording.read(path, QUICK_S if quick else None, float(os.environ.get("BENCH_FROM") or 0.0))
    robot, start = bare_robot(), Start.of(whole)
    replayed = {effects: replay(whole, effects, robot, meshes=True) for effects in ("all", "none")}
    judged = whole.time_s >= whole.time_s[0] + start.judged_from_s
    recording = Recording(*(values[judged] for values in whole))
    simulated = {effects: done.motion.position[judged] for effects, done in replayed.items()}
    print("%s: %s" % (path.name, start.sentence()), flush=True)
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
    motion, events = replayed["all"]
    print("the worst second of each joint", *worst_seconds(
        recording.time_s, simulated["all"] - recording.sensed, ReplayedMotion(*(values[judged] for values in motion)),
        list(JOINT_NAMES), events), sep="\n", flush=True)
    if number == 0:
        folder = HERE.parents[1] / ".baxter/bench"
        folder.mkdir(parents=True, exist_ok=True)
        curves(recording.time_s, {name: {"commanded": recording.commanded[:, j], "recorded": recording.sensed[:, j],
                                         "simulated": simulated["all"][:, j]}
                                  for j, name in enumerate(JOINT_NAMES)}, folder / "fidelity.png")


def rms(values):
    return float(np.sqrt(np.mean(values ** 2)))

