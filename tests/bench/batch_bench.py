# SPDX-License-Identifier: BSD-3-Clause
"""Batches: the engine's overhead beside a bare loop of the same job, and two Ray nodes of one core each beside one.

Root is needed for the nodes: each is in its own network namespace, on its own processor. A rate is that of the outcomes
after the first one, so the start of workers and compilation do not count. All engines must give the same results.
"""
import contextlib
import json
import os
import signal
import subprocess
import sys
from typing import NamedTuple

from lab_batch.ray_node import FIXED, PORT
from lab_testing.waiting import wait_until

# Episodes of a quarter of a second.
JOB = ("lab_batch.shipped:InverseKinematics", {"poses": 2000})
EPISODES, QUICK = 60, 8
START_S, RUN_S, STOP_S = 300.0, 900.0, 30.0
ADDRESSES, CABLE = ("10.99.17.1", "10.99.17.2"), "cable"
# In another process, because Ray changes signal handlers. A line for each outcome: time [s], seed, result, error.
DRIVER = """
import json, sys, time
from lab_batch import Spec, load, processes, ray_engine
from lab_batch.job import run_episode
def bare(spec, seeds, limits):
    job = load(spec)
    yield from (run_episode(job, seed) for seed in seeds)
engine, job, count, workers, address = json.loads(sys.argv[1])
run = {"bare": bare, "processes": processes.map_seeds, "ray": ray_engine.map_seeds}[engine]
options = {"address": address} if address else {}
for one in run(Spec(*job), range(count), processes.Limits(workers), **options):
    print(json.dumps([time.monotonic(), one.seed, one.result, one.error]), flush=True)
"""


class Batch(NamedTuple):
    """seconds: of one episode; results: {seed: result}."""

    seconds: float
    results: dict


def measure(report, quick, number):
    count = QUICK if quick else EPISODES
    bare, engine = (run(name, count, 1) for name in ("bare", "processes"))
    report.add("an episode in a worker process", 1e3 * engine.seconds, "ms", ("a bare loop", 1e3 * bare.seconds),
               samples=count, ratio_most=1.03)
    found = [bare, engine]
    if os.getuid() == 0:
        one, two = (run_on_nodes(nodes, count) for nodes in (1, 2))
        report.add("an episode by two Ray nodes of one core", 1e3 * two.seconds, "ms",
                   ("by one node", 1e3 * one.seconds), samples=count, ratio_most=0.55)
        found += [one, two]
    same = sum(batch.results == bare.results for batch in found)
    report.add("engines with the same results, bit for bit", 100.0 * same / len(found), "%", samples=len(found),
               pooled=True, least=100.0)


def run(engine, count, workers, prefix=(), address=""):
    """Run a batch in another process, started by the words ``prefix``; return the Batch."""
    words = [*prefix, sys.executable, "-c", DRIVER, json.dumps([engine, JOB, count, workers, address])]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, timeout=RUN_S, check=True,
                          env={**os.environ, **threads})
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    if len(rows) != count or any(row[3] for row in rows):
        raise RuntimeError("%s: %d of %d episodes ended well" % (engine, sum(not row[3] for row in rows), count))
    return Batch((rows[-1][0] - rows[0][0]) / (count - 1), {row[1]: row[2] for row in rows})


def run_on_nodes(nodes, count):
    """Run a batch on a Ray cluster of ``nodes``, 1 or 2, of one core each; return the Batch."""
    names = ["lab-ray-%d-%d" % (os.getpid(), k) for k in range(2)]
    with contextlib.ExitStack() as ending:
        for name in names:
            ip("netns", "add", name)
            ending.callback(ip, "netns", "delete", name)
        ip("link", "add", CABLE, "netns", names[0], "type", "veth", "peer", "name", CABLE, "netns", names[1])
        for name, address in zip(names, ADDRESSES, strict=True):
            ip("-n", name, "address", "add", address + "/24", "dev", CABLE)
            for link in ("lo", CABLE):
                ip("-n", name, "link", "set", link, "up")
        head = "%s:%d" % (ADDRESSES[0], PORT)
        # The driver waits most of the time; it is on the head's processor.
        inside = [["ip", "netns", "exec", name, "taskset", "-c", str(k % os.cpu_count())]
                  for k, name in enumerate(names)]
        start(inside[0], ["--head"], ADDRESSES[0], ending)
        if nodes > 1:
            start(inside[1], ["--address", head], ADDRESSES[1], ending)
        return run("ray", count, nodes, inside[0], head)


def start(inside, role, address, ending):
    """Start a node of one core, and return when it takes work; ``ending`` (contextlib.ExitStack) stops it."""
    node = subprocess.Popen([*inside, sys.executable, "-m", "lab_batch.ray_node", *role, "--listen", address, "--cpus",
                             "1"], stdout=subprocess.DEVNULL, start_new_session=True)
    ending.callback(stop, node)
    wait_until(lambda: is_open(inside, address, node), "Ray's node listens", START_S, 0.5)


def is_open(inside, address, node):
    """Whether the node's manager listens: that of a head starts last. Raises RuntimeError when it has ended."""
    if node.poll() is not None:
        raise RuntimeError("Ray's node ended with exit code %s" % node.returncode)
    probe = "import socket; socket.create_connection((%r, %d), 2.0)" % (address, FIXED["--node-manager-port"])
    return subprocess.run([*inside, sys.executable, "-c", probe], stderr=subprocess.DEVNULL).returncode == 0


def stop(node):
    if node.poll() is not None:
        return
    os.killpg(node.pid, signal.SIGTERM)
    try:
        node.wait(STOP_S)
    except subprocess.TimeoutExpired:
        os.killpg(node.pid, signal.SIGKILL)
        node.wait()


def ip(*words):
    subprocess.run(["ip", *words], check=True)
