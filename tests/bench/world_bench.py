# SPDX-License-Identifier: BSD-3-Clause
"""The whole stack as fast as possible, at 500 Hz with self-collision, compared with bare steps of the same model."""
import time

import numpy as np
import pybullet
from labs import Lab
from tick_bench import NAMES, NEUTRAL, BareWorld, Loop

from lab_testing.waiting import wait_until

SECONDS = 6.0
SETTLE_S = 5.0  # simulated
BARE_STEPS = 4000


def bare_factor(steps, arms_only=False):
    """Return simulated seconds per second of stepSimulation; only these calls are timed.

    The robot is set up as by the plugin, on the same floor: every joint driven, fingers coupled, arms swinging. With
    ``arms_only`` only the arms' motors are active, as in a world into which the robot has just been loaded.
    """
    with BareWorld() if arms_only else Loop() as loop:
        model, client = loop.model, loop.world._client
        index = model.index([name for names in NAMES.values() for name in names])
        middle = np.array(NEUTRAL * len(NAMES))
        spent = 0.0
        for tick in range(steps):
            model.drive_position(index, middle + 0.3 * np.sin(0.004 * tick), model.max_effort[index])
            begin = time.perf_counter()
            pybullet.stepSimulation(physicsClientId=client)
            spent += time.perf_counter() - begin
        return steps * loop.world.time_step_s / spent


def measure(report, quick, number):
    seconds = 1.0 if quick else SECONDS
    steps = BARE_STEPS // 10 if quick else BARE_STEPS
    full_speed = {"gui": "false", "real_time_factor": "0", "enable": "true"}

    def with_parts(*parts, **arguments):
        """Return the real-time factor of a lab with these parts, after the resting objects have fallen asleep."""
        with Lab(**full_speed, **arguments) as lab:
            for part in parts:
                lab.part(*part)
            settled = lab.now() + SETTLE_S
            wait_until(lambda: lab.now() >= settled, "the resting objects to fall asleep", 120.0, 0.1)
            return lab.factor(seconds)

    # Bare steps need a free core, so they run before the lab, not beside it.
    alone_bare, arms_bare = bare_factor(steps), bare_factor(steps, arms_only=True)
    alone = with_parts(("swing",))
    report.add("arms moving, as fast as possible: real-time factor", alone, "x", least=15.0)
    report.add("arms moving: time a tick, beside bare steps", 2.0 / alone, "ms", ("stepSimulation", 2.0 / alone_bare),
               ratio_most=1.6)
    report.add("arms moving: time a tick, beside bare steps, arms alone driven", 2.0 / alone, "ms",
               ("stepSimulation", 2.0 / arms_bare))
    physical = with_parts(("swing",), effects="all")
    report.add("arms moving, all effects of a physical robot: real-time factor", physical, "x", ("ideal drives", alone),
               least=8.5)
    clients = with_parts(("swing",), *[("client",)] * 3)
    report.add("three rospy clients: real-time factor", clients, "x", ("no clients", alone), least=5.0)
    contact = with_parts(("press",))
    report.add("hands pressing on the body: real-time factor", contact, "x", ("free space", alone), least=6.0)
    for count in (10, 100):
        some = with_parts(("swing",), ("boxes", count))
        report.add("%d resting objects: time a tick" % count, 2.0 / some, "ms", ("none", 2.0 / alone),
                   **({"ratio_most": 2.2} if count == 100 else {}))
