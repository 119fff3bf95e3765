# SPDX-License-Identifier: BSD-3-Clause
"""How evenly trajActionServer commands and how closely the arm follows: traj_bench.py in a lab of its own."""
import re
import subprocess
import sys

from labs import HERE, Lab

# A move takes some ten simulated seconds; a busy machine takes its time.
LIMIT_S = 180.0


def measure(report, quick, number):
    with Lab(gui="false", enable="true") as lab:
        lab.start("rosrun", "baxter_traj_streamer", "traj_interpolator_as")
        done = subprocess.run([sys.executable, str(HERE / "traj_bench.py")], env=lab.environment, capture_output=True,
                              text=True, timeout=LIMIT_S)
    if done.returncode:
        raise SystemExit("traj_bench.py failed:\n" + done.stderr[-2000:])
    for clock in ("simulated", "wall"):
        period, deviation, longest = map(float, re.search(
            r"period, %s +mean +([\d.]+) ms +standard deviation +([\d.]+) ms +longest +([\d.]+) ms" % clock,
            done.stdout).groups())
        report.add("command period, %s time: sd" % clock, deviation, "ms", ("its mean", period))
        report.add("command period, %s time: longest" % clock, longest, "ms", ("its mean", period))
    for what in ("moving", "at rest"):
        greatest, = re.search(r"tracking error, %s +greatest ([\d.]+) rad" % what, done.stdout).groups()
        report.add("tracking error, %s: greatest" % what, float(greatest), "rad")
