# SPDX-License-Identifier: BSD-3-Clause
"""torture.py slice: hostile messages, then a round of the state machine, on one lab."""
from limits import arm_limits
from robot import init_node
from run_fuzz import STILL_RAD, fuzz
from run_machine import machine
from watch import Watch

from lab import Lab

EXAMPLES, STEPS = 6, 15


def run(options, journal):
    """Run both; return figures for the result."""
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            fuzzed = fuzz(lab, watch, options, journal)
            options.messages, watch.checks_limits = STEPS, True
            stepped = machine(lab, watch, options, journal, EXAMPLES, STEPS)
            return {"also": {**fuzzed, **stepped}, "simulated_s": watch.simulated_s}
