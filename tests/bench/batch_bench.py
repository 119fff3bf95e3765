# SPDX-License-Identifier: BSD-3-Clause
"""Batches: an episode in a worker process beside one in a bare loop of the same job.

The time of an episode is that between the first and the last outcome by their number, so the start of workers and
compilation do not count. Both must give the same results.
"""
import json
import os
import subprocess
import sys
from typing import NamedTuple

# Episodes of a quarter of a second.
JOB = ("lab_batch.shipped:InverseKinematics", {"poses": 2000})
EPISODES, QUICK = 60, 8
RUN_S = 900.0
# Each in another process. A line for each outcome: time [s], seed, result, error.
DRIVER = """
import json, sys, time
from lab_batch import Spec, load, processes
from lab_batch.job import run_episode
def bare(spec, seeds, limits):
    job = load(spec)
    yield from (run_episode(job, seed) for seed in seeds)
engine, job, count = json.loads(sys.argv[1])
run = {"bare": bare, "processes": processes.map_seeds}[engine]
for one in run(Spec(*job), range(count), processes.BatchLimits(1)):
    print(json.dumps([time.monotonic(), one.seed, one.result, one.error]), flush=True)
"""


class Batch(NamedTuple):
    """seconds: of one episode; results: {seed: result}."""

    seconds: float
    results: dict


def measure(report, quick, number):
    count = QUICK if quick else EPISODES
    bare, engine = (run(name, count) for name in ("bare", "processes"))
    report.add("an episode in a worker process", 1e3 * engine.seconds, "ms", ("a bare loop", 1e3 * bare.seconds),
               samples=count, ratio_most=1.03)
    same = sum(engine.results.get(seed) == result for seed, result in bare.results.items())
    report.add("episodes with the same results, bit for bit", 100.0 * same / count, "%", samples=count, pooled=True,
               least=100.0)


def run(engine, count):
    """Run a batch in another process; return the Batch."""
    words = [sys.executable, "-c", DRIVER, json.dumps([engine, JOB, count])]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, timeout=RUN_S, check=True,
                          env={**os.environ, **threads})
    return batch_of(done.stdout, count)


def batch_of(output, count):
    """The Batch of a driver's output. Raises RuntimeError unless all its ``count`` episodes ended well."""
    rows = [json.loads(line) for line in output.splitlines() if line.startswith("[")]
    if len(rows) != count or any(row[3] for row in rows):
        raise RuntimeError("%d of %d episodes ended well" % (sum(not row[3] for row in rows), count))
    return Batch((rows[-1][0] - rows[0][0]) / (count - 1), {row[1]: row[2] for row in rows})
