# SPDX-License-Identifier: BSD-3-Clause
"""torture.py fuzz"""
from fuzz import BATCH, Fuzz
from limits import arm_limits
from robot import init_node
from watch import Watch

from lab import Lab

# Greatest motion of an arm on messages that it must refuse [rad].
STILL_RAD = 0.001


def run(options, journal):
    """Fuzz a lab; return figures for the result."""
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            return {"also": fuzz(lab, watch, options, journal), "simulated_s": watch.simulated_s}


def fuzz(lab, watch, options, journal):
    """The same with a running lab, and a Watch."""
    run_of_it = Fuzz(lab, watch, journal, options.seed)
    run_of_it.run(options.first, options.messages, options.until)
    return {
        "receivers": len(run_of_it.counts), "messages_received": sum(run_of_it.counts.values()), "batches_of": BATCH,
        "farthest_an_arm_moved_when_it_must_not_rad": round(watch.still.farthest, 6),
        "messages_read_and_checked": sum(watch.counts.values()), "topics_read": len(watch.watched_topics),
        "times_that_a_subscriber_cut_us_off": run_of_it.hub.cut_off,
        "deaths_of_nodes_of_debian": run_of_it.foreign_deaths, "labs_restarted": run_of_it.relaunches}
