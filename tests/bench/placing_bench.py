# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place by friction: pick_and_place_bench.py with twenty seeds per round, different ones in each round."""
import pick_and_place_bench as trials

SEEDS = 20


def measure(report, quick, number):
    count = SEEDS // 10 if quick else SEEDS
    outcome = trials.run_seeds(range(number * SEEDS, number * SEEDS + count))
    report.add("blocks picked and placed", 100.0 * outcome.succeeded / count, "%", samples=count, pooled=True,
               least=100.0 * trials.NEEDED)
    report.add("farthest block from its target", 1e3 * max(outcome.misses_m, default=float("nan")), "mm",
               samples=outcome.succeeded, most=1e3 * trials.MISS_M)
    report.add("speed by processor time", outcome.simulated_s / outcome.cpu_s, "times real time", samples=count)
