# SPDX-License-Identifier: BSD-3-Clause
"""Labs of a class, as ./baxter.sh labs up starts them: 6 with a program each that moves both arms, then 16 of which 12
stay paused. Their clients wake the others. Real-time factor through the front door, processors and memory of all
processes of the class, over two minutes.

The environment variable BENCH_CLASS names other classes: "6,16:4" is 6 labs, then 16 of which 4 go on.
"""
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rospkg
import websocket

from lab_class import control
from lab_class.store import Store
from lab_testing.waiting import wait_until
from processes.family import children_of
from processes.ports import free_port
from rf_checks.pacing import cpu_time_s

CLASSES, QUICK_CLASSES = "6,16:4", "2,3:1"
# A lab makes up for up to 1 s in which it got no processor: where that comes at an end of 30 s, it is 3 % of them.
SECONDS, QUICK_SECONDS = 120.0, 6.0
SETTLE_S = 5.0  # simulated, from the first moment at which all labs run
START_S, ANSWER_S, DOWN_S = 900.0, 60.0, 120.0
GB = 1e9
# Ends the class when this program ends, killed or not: a supervisor runs on by itself. Arguments: the class's folder.
GUARD = """
import shutil, sys, time
from lab_class.command import main
sys.stdin.read()
deadline = time.monotonic() + %r
while main(["--folder", sys.argv[1], "down"]) != 0 and time.monotonic() < deadline:
    time.sleep(1.0)
shutil.rmtree(sys.argv[2], ignore_errors=True)
""" % DOWN_S
LAUNCH = Path(rospkg.RosPack().get_path("lab_class")) / "test/bench/both_arms.launch"


class Class:
    """A class in a folder that is deleted; a context manager. ``start_s``: time until all labs had started [s]."""

    def __init__(self, count):
        self._count, self._port = count, free_port()

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            folder = Path(tempfile.mkdtemp(prefix="class-bench-"))
            self._store = Store(folder / "class")
            guard = subprocess.Popen([sys.executable, "-P", "-c", GUARD, str(self._store.folder), str(folder)],
                                     stdin=subprocess.PIPE, start_new_session=True)
            stack.callback(guard.wait, 2.0 * DOWN_S)
            stack.callback(guard.stdin.close)
            begun = time.monotonic()
            self.call("up", str(self._count), "--port", str(self._port), "--launch", str(LAUNCH))
            self.start_s = time.monotonic() - begun
            self.names = [student.name for student in self._store.read().students]
            self._tokens = self._store.read().tokens
            self._supervisor = self._store.running()["pid"]
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def call(self, *words):
        """Run a command on the class."""
        done = subprocess.run([sys.executable, "-P", "-m", "lab_class", "--folder", str(self._store.folder), *words],
                              capture_output=True, text=True, timeout=START_S)
        if done.returncode != 0:
            raise SystemExit("labs %s: %s" % (words[0], done.stdout + done.stderr))

    def overview(self):
        """{name: what the supervisor says about this lab}."""
        return {lab["name"]: lab for lab in control.call(self._store, "GET", "/labs")["labs"]}

    def now(self, name):
        """(simulation time of a lab, wall time) [s], from one message of /clock through the front door."""
        address = "ws://127.0.0.1:%d/%s/rosbridge?token=%s" % (self._port, name, self._tokens[name].view)
        with contextlib.closing(websocket.create_connection(address, timeout=ANSWER_S)) as connection:
            connection.send(json.dumps({"op": "subscribe", "topic": "/clock", "type": "rosgraph_msgs/Clock"}))
            while True:
                message = json.loads(connection.recv())
                if message["op"] == "publish":
                    clock = message["msg"]["clock"]
                    return clock["secs"] + 1e-9 * clock["nsecs"], time.monotonic()

    def cpu_s(self):
        """Of the supervisor and of all labs, since their start [s]."""
        return cpu_time_s(children_of([self._supervisor]))


def measure(report, quick, number):
    classes = os.environ.get("BENCH_CLASS") or (QUICK_CLASSES if quick else CLASSES)
    for text in classes.split(","):
        count, _, going_on = text.partition(":")
        one_class(report, int(count), int(going_on or count), QUICK_SECONDS if quick else SECONDS)


def one_class(report, count, going_on, seconds):
    title = "%d labs" % count + (", %d of them paused" % (count - going_on) if going_on < count else "")
    with Class(count) as labs:
        running, idle = labs.names[:going_on], labs.names[going_on:]
        asked = time.monotonic()
        labs.now(running[0])
        wake_s = time.monotonic() - asked
        settled = [labs.now(name)[0] + SETTLE_S for name in running]
        wait_until(lambda: all(labs.now(name)[0] >= time_s for name, time_s in zip(running, settled, strict=True)),
                   "the arms to swing", START_S, 1.0)
        states = [lab["state"] for lab in labs.overview().values()]
        if states != ["running"] * len(running) + ["paused"] * len(idle):
            raise SystemExit("%s: the states are %s" % (title, ", ".join(states)))
        cpu, begun = labs.cpu_s(), time.monotonic()
        first = [labs.now(name) for name in running]
        time.sleep(seconds)
        last = [labs.now(name) for name in running]
        cores = (labs.cpu_s() - cpu) / (time.monotonic() - begun)
        factors = [(b - a) / (wall_b - wall_a) for (a, wall_a), (b, wall_b) in zip(first, last, strict=True)]
        wait_until(lambda: all(lab["memory_bytes"] for lab in labs.overview().values()), "figures of memory", 60.0, 1.0)
        memory = {name: lab["memory_bytes"] / GB for name, lab in labs.overview().items()}
    report.add("%s: start, each" % title, labs.start_s / count, "s")
    report.add("%s: first message of a paused one" % title, wake_s, "s")
    report.add("%s: slowest factor" % title, min(factors), "x", least=0.99)
    report.add("%s: processors" % title, cores, "cores")
    report.add("%s: each that goes on" % title, 100.0 * cores / going_on, "% of a core")
    report.add("%s: labs per core that they use" % title, count / cores, "")
    report.add("%s: memory of a lab" % title, 1000.0 * sum(memory.values()) / count, "MB")
    report.add("%s: labs per GB" % title, count / sum(memory.values()), "")
