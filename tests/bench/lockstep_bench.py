# SPDX-License-Identifier: BSD-3-Clause
"""Two new labs in lock-step, through /gazebo and its service, with the same commands at the same ticks. Checks that the
joint states are identical, bit for bit. With ideal drives, and with all that a physical robot has."""
import json

from labs import Lab

TICKS = 5000


def measure(report, quick, number):
    for effects, what in (("none", ""), ("all", " with all effects")):
        first, second = (run(TICKS // 10 if quick else TICKS, effects) for _ in range(2))
        report.add("two fresh runs%s: joint states alike, bit for bit" % what, 100.0 * (first == second), "%",
                   samples=min(first["states"], second["states"]), pooled=True, least=100)


def run(ticks, effects, seed=0):
    """Return what lab_part.py prints for a run: a digest of the joint states, and their number."""
    # /gazebo starts paused, so its service is ready before the robot has settled.
    with Lab(ready="/gazebo/advance", gui="false", enable="true", paused="true", joint_state_rate="500",
             effects=effects, seed=str(seed)) as lab:
        return json.loads(lab.part("lockstep", ticks).stdout.readline())
