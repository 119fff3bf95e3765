# SPDX-License-Identifier: BSD-3-Clause
"""Jitter of trajActionServer's commands and tracking error of the arm: traj_bench.py in a separate lab."""
import re
import subprocess
import sys

from labs import HERE, Lab

# Streaming at 100 Hz: the greatest deviation of its period [ms], the greatest error in motion and at rest [rad].
JITTER_MS = 2.0
ERROR_RAD = {"moving": 0.02, "at rest": 0.003}
# A motion takes some ten simulated seconds, and much longer on a busy machine.
LIMIT_S = 180.0


def measure(report, quick, number):
    with Lab(gui="false", enable="true") as lab:
        lab.start("rosrun", "baxter_traj_streamer", "traj_interpolator_as")
        done = subprocess.run([sys.executable, str(HERE / "traj_bench.py")], env=lab.environment, capture_output=True,
                              text=True, timeout=LIMIT_S)
    if done.returncode:
        raise SystemExit("traj_bench.py failed:\n" + done.stderr[-2000:])
    commands = int(re.search(r"^(\d+) commands in ", done.stdout, re.MULTILINE).group(1))
    for clock in ("simulated", "wall"):
        period, deviation, longest = map(float, re.search(
            r"period, %s +mean +([\d.]+) ms +standard deviation +([\d.]+) ms +longest +([\d.]+) ms" % clock,
            done.stdout).groups())
        report.add("command period, %s time: sd" % clock, deviation, "ms", ("its mean", period), samples=commands,
                   **({"most": JITTER_MS} if clock == "simulated" else {}))
        report.add("command period, %s time: longest" % clock, longest, "ms", ("its mean", period), samples=commands)
    for what, bound in ERROR_RAD.items():
        greatest, states = re.search(r"tracking error, %s +greatest ([\d.]+) rad over (\d+) joint states" % what,
                                     done.stdout).groups()
        report.add("tracking error, %s: greatest" % what, float(greatest), "rad", samples=int(states), most=bound)
