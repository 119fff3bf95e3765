# SPDX-License-Identifier: BSD-3-Clause
"""Diagnoses of poses that have no solution for a known cause, 510 per round: the share of correct ones, and their
time."""
import time

import numpy as np
from arms import arms, checker_of
from bad_poses import KINDS, Builder

from arm_kinematics import warm_up

# Share of the diagnoses that must name the cause [%].
RIGHT = 95.0


def measure(report, quick, number):
    judged, times = {kind: [] for kind in KINDS}, []
    for k, arm in enumerate(arms()):
        warm_up(arm.chain)
        checker = checker_of(arm)
        builder = Builder(arm.robot, arm.chain, checker, np.random.default_rng((number, k)))
        for kind, count in KINDS.items():
            for case in builder.build(kind, max(1, count // 10) if quick else count):
                start = time.perf_counter()
                failure = builder.ask(case)
                times.append(1e3 * (time.perf_counter() - start))
                judged[kind].append(builder.right(case, failure))
        checker.close()
    for kind, right in judged.items():
        report.add("right: %s" % kind, 100.0 * np.mean(right), "%", samples=len(right), pooled=True, least=RIGHT)
    every = [right for some in judged.values() for right in some]
    report.add("right: all", 100.0 * np.mean(every), "%", samples=len(every), pooled=True,
               least=RIGHT)
    report.add("time for a verdict: mean", np.mean(times), "ms", samples=len(times))
    report.add("time for a verdict: p99", np.percentile(times, 99), "ms", samples=len(times))
