# SPDX-License-Identifier: BSD-3-Clause
"""Two fresh labs in lock-step, through /gazebo and its service, with the same commands at the same ticks: are the joint
states the same, bit for bit?"""
import json

from labs import Lab

TICKS = 5000


def measure(report, quick, number):
    first, second = run(TICKS // 10 if quick else TICKS), run(TICKS // 10 if quick else TICKS)
    report.add("two fresh runs: joint states alike, bit for bit", 100.0 * (first == second), "%",
               samples=min(first["states"], second["states"]), pooled=True, least=100)


def run(ticks):
    """What lab_part.py says of a run: a digest of the joint states, and how many there were."""
    # /gazebo stands still from its first moment on; what comes first is the service, not a robot that has settled.
    with Lab(ready="/gazebo/advance", gui="false", enable="true", paused="true", joint_state_rate="500") as lab:
        return json.loads(lab.part("lockstep", ticks).stdout.readline())
