# SPDX-License-Identifier: BSD-3-Clause
"""The servo in random streams of twists in physics, 20 s each of simulated time: Baxter's two arms, and PROBOT.

Every stream begins at a random posture among random things, and its twists change once a second; through
singularities, joint limits and obstacles (``servo_streams``). Times of steps are CPU times of one thread, those to the
first motion simulated. A round has 40 streams, with ``--all`` 200.
"""
import os

import numpy as np
from servo_streams import FORCE_N, STREAM_S, BaxterPhysics, ProbotPhysics, first_motion, run

from moveit_servo.warming import warm_up

STREAMS, STREAMS_OF_ALL, FIRST_MOTIONS, QUICK, QUICK_S = 40, 200, 20, 2, 4.0


def measure(report, quick, number):
    warm_up()
    streams = QUICK if quick else STREAMS_OF_ALL if os.environ.get("BENCH_ALL") else STREAMS
    for name, make in (("Baxter", BaxterPhysics), ("PROBOT", ProbotPhysics)):
        physics, count = make(), streams // 2
        first = number * STREAMS_OF_ALL
        found = [run(physics, first + k, QUICK_S if quick else STREAM_S) for k in range(count)]
        steps = 1e3 * np.concatenate([one.cpu_s for one in found])
        report.add("%s: a step of one arm, median" % name, np.median(steps), "ms", samples=len(steps))
        report.add("%s: a step of one arm, p99" % name, np.percentile(steps, 99), "ms", samples=len(steps), most=2.0)
        if len(physics.arms) > 1:
            both = 1e3 * np.concatenate([one.together_s for one in found])
            report.add("%s: a step of both, p99" % name, np.percentile(both, 99), "ms", samples=len(both), most=3.0)
        for what, unit, value, most in (
                ("greatest share of a limit", "%", max(100.0 * one.share for one in found), 100.01),
                ("greatest force of a contact", "N", max(one.force_n for one in found), FORCE_N),
                ("set-points off their way", "mm", max(1e3 * one.shift_m for one in found), 2.0),
                ("set-points off their way", "deg", max(np.degrees(one.turn_rad) for one in found), 0.5),
                ("the hand off its way", "mm", max(1e3 * one.hand_m for one in found), None),
                ("the hand off its way", "deg", max(np.degrees(one.hand_rad) for one in found), None)):
            report.add("%s: %s [%s]" % (name, what, unit), value, unit, samples=count,
                       **({} if most is None else {"most": most}))
        firsts = [1e3 * first_motion(physics, first + k) for k in range(min(count, FIRST_MOTIONS))]
        report.add("%s: from a twist to the first motion" % name, max(firsts), "ms", samples=len(firsts), most=20.0)
        every = {"samples": count, "pooled": True, "most": 0.0}
        for what, hits in (("a contact of more than %g N" % FORCE_N, [one.force_n > FORCE_N for one in found]),
                           ("a posture that exact geometry refuses", [one.touches for one in found]),
                           ("a dead end", [bool(one.dead_ends) for one in found])):
            report.add("%s: streams with %s" % (name, what), 100.0 * np.mean(hits), "%", **every)
