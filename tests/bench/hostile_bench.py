# SPDX-License-Identifier: BSD-3-Clause
"""A lab at real time while hostile descriptions are spawned: too large, endless, or with a false header. Measures the
longest pause of the joint states, the time to each answer, and the memory that is not freed."""
import concurrent.futures
import json

from labs import Lab, arrivals, memory_mb, plan_of

STATES = "/robot/joint_states"
SLICE_S, QUIET_SLICES = 3.0, 4
# Longest pause of the joint states [ms], and longest answer [s].
GAP_MS, ANSWER_S = 50.0, 5.0


def measure(report, quick, number):
    with Lab(gui="false", enable="true") as lab:
        lab.part("swing")
        quiet = max(gap(lab) for _ in range(1 if quick else QUIET_SLICES))
        pid = lab.process("/gazebo").pid
        # The first time loads the readers of such files, which stay in memory.
        once, before = spawn(lab), memory_mb(pid)
        again, after = spawn(lab), memory_mb(pid)
    report.add("longest gap between joint states, hostile descriptions spawned", max(once[0], again[0]), "ms",
               peer=("nothing spawned", quiet), most=GAP_MS)
    for what in again[1]:
        report.add("answer to %s" % what, max(once[1][what], again[1][what]), "s", most=ANSWER_S)
    report.add("memory of /gazebo: the second time adds", after - before, "MB")


def spawn(lab):
    """Return (longest gap between joint states during the spawning [ms], {description: time to its answer [s]})."""
    part, gaps = lab.part("hostile"), []
    with concurrent.futures.ThreadPoolExecutor(1) as executor:
        answer = executor.submit(part.stdout.readline)
        while not answer.done() or not gaps:
            gaps.append(gap(lab))
    return max(gaps), json.loads(answer.result())


def gap(lab):
    """Longest gap between joint states on one of five connections, over SLICE_S of wall time [ms]."""
    times, = arrivals(lab, plan_of(5), (STATES,), SLICE_S)
    return 1e3 * max(b - a for a, b in zip(times, times[1:], strict=False))
