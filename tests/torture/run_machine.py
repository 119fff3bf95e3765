# SPDX-License-Identifier: BSD-3-Clause
"""torture.py machine"""
import time

import hypothesis
from hypothesis.stateful import run_state_machine_as_test
from limits import arm_limits
from lockstep import LockStep
from machine import Machine
from robot import init_node
from watch import Watch

from lab import Lab

STILL_RAD = 0.001
# Of a round. The first example of hypothesis is always the simplest: the same step again and again.
EXAMPLES, STEPS = 20, 25


def run(options, journal):
    """Run rounds of examples, each with its own seed, up to the limit of steps or time."""
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            return {"also": machine(lab, watch, options, journal), "simulated_s": watch.simulated_s}


def machine(lab, watch, options, journal, examples=EXAMPLES, steps=STEPS):
    """The same with a running lab, and a Watch. A round has this many examples of at most this many steps."""
    lockstep = LockStep(watch)
    Machine.watch, Machine.lockstep = watch, lockstep
    Machine.journal_step = staticmethod(lambda text: journal.note(journal.sent, "step", "", text))
    relaunches, seed, begin = 0, options.seed, journal.sent
    while journal.sent - begin < options.messages and (options.until is None or time.monotonic() < options.until):
        first, Machine.first_error = journal.sent, None
        try:
            run_state_machine_as_test(hypothesis.seed(seed)(Machine),
                                      settings=settings(examples, min(steps, options.messages)))
        except Exception as error:  # any error is a result of the round
            error = Machine.first_error or error
            count = journal.sent - first
            last = "; ".join(journal.last(min(count, 12)))
            journal.fail("%s: %s\n  last steps: %s" % (type(error).__name__, error, last), seed, 0, count)
            watch.still.disarm()
            watch.stamps.announce_reset()
            relaunches += 1
            lab.relaunch()
            watch.take_found()
        seed += 1
    return {"rounds": seed - options.seed, "ticks_in_lock_step": lockstep.ticks, "labs_restarted": relaunches,
            "messages_read_and_checked": sum(watch.counts.values())}


def settings(examples, steps):
    """Hypothesis settings for this many examples of at most that many steps. There is no shrinking: it would repeat
    steps on a lab that is broken by then. The journal lists the steps."""
    return hypothesis.settings(
        max_examples=examples, stateful_step_count=steps, deadline=None, database=None,
        phases=[hypothesis.Phase.generate], suppress_health_check=list(hypothesis.HealthCheck))
