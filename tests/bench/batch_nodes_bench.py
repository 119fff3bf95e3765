# SPDX-License-Identifier: BSD-3-Clause
"""Batches by Ray: two nodes of one core each beside one, each in a network namespace and on a processor of its own.

It needs root and two processors. The time of an episode is that between the first and the last outcome by their number,
so the start of workers and compilation do not count. Both must give the same results as a bare loop.
"""
import contextlib
import json
import os
import signal
import subprocess
import sys

from batch_bench import JOB, QUICK, RUN_S, batch_of, run

from lab_batch.ray_node import FIXED, PORT
from lab_testing.waiting import wait_until

# So many that the second node's worker, which compiles while the first one works, does not count.
EPISODES = 300
START_S, STOP_S = 300.0, 30.0
ADDRESSES, CABLE = ("10.99.17.1", "10.99.17.2"), "cable"
# In another process, because Ray changes signal handlers. A line for each outcome: time [s], seed, result, error.
DRIVER = """
import json, sys, time
from lab_batch import Spec, ray_engine
from lab_batch.processes import BatchLimits
job, count, workers, address = json.loads(sys.argv[1])
for one in ray_engine.map_seeds(Spec(*job), range(count), BatchLimits(workers), address=address):
    print(json.dumps([time.monotonic(), one.seed, one.result, one.error]), flush=True)
"""


def measure(report, quick, number):
    if os.getuid() != 0 or os.cpu_count() < 2:
        raise RuntimeError("two Ray nodes need root, for their networks, and two processors")
    count = QUICK if quick else EPISODES
    bare = run("bare", count)
    one, two = (run_on_nodes(nodes, count) for nodes in (1, 2))
    report.add("an episode by two Ray nodes of one core", 1e3 * two.seconds, "ms", ("by one node", 1e3 * one.seconds),
               samples=count, ratio_most=0.55)
    same = sum(one.results.get(seed) == two.results.get(seed) == result for seed, result in bare.results.items())
    report.add("episodes with the same results, bit for bit", 100.0 * same / count, "%", samples=count, pooled=True,
               least=100.0)


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
        inside = [["ip", "netns", "exec", name, "taskset", "-c", str(k)] for k, name in enumerate(names)]
        start(inside[0], ["--head"], ADDRESSES[0], ending)
        if nodes > 1:
            start(inside[1], ["--address", head], ADDRESSES[1], ending)
        # The driver waits most of the time; it is on the head's processor.
        words = [*inside[0], sys.executable, "-c", DRIVER, json.dumps([JOB, count, nodes, head])]
        done = subprocess.run(words, stdout=subprocess.PIPE, text=True, timeout=RUN_S, check=True)
        return batch_of(done.stdout, count)


def start(inside, role, address, ending):
    """Start a node of one core, and return when it takes work; ``ending`` (contextlib.ExitStack) stops it."""
    words = [*inside, sys.executable, "-m", "lab_batch.ray_node", *role, "--listen", address, "--cpus", "1"]
    node = subprocess.Popen(words, stdout=subprocess.DEVNULL, start_new_session=True)
    ending.callback(stop, node)
    wait_until(lambda: is_open(inside, address, node), "Ray's node listens", START_S, 0.5)


def is_open(inside, address, node):
    """Whether the node's manager listens: that of a head starts last. Raises RuntimeError when it has ended."""
    if node.poll() is not None:
        raise RuntimeError("Ray's node ended with exit code %s" % node.returncode)
    probe = "import socket; socket.create_connection((%r, %d), 2.0)" % (address, FIXED["--node-manager-port"])
    return subprocess.run([*inside, sys.executable, "-c", probe], stderr=subprocess.DEVNULL).returncode == 0


def stop(node):
    """End a node and its processes."""
    if node.poll() is None:
        os.killpg(node.pid, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            node.wait(STOP_S)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(node.pid, signal.SIGKILL)
    node.wait()


def ip(*words):
    subprocess.run(["ip", *words], check=True)
