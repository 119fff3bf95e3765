# SPDX-License-Identifier: BSD-3-Clause
"""The page's server under clients that come and go, and some that misbehave: does it grow, does a witness notice?"""
import contextlib
import itertools
import json
import os
import statistics
import threading
import time
from collections import deque
from pathlib import Path

from labs import START_LIMIT_S, Lab
from web_bench import JOINTS, TIMEOUT_S, VIEW_MS, Web
from websocket import ABNF, WebSocketException, create_connection

from lab_testing.waiting import wait_until

MINUTES, ALL_MINUTES, QUICK_MINUTES = 5.0, 60.0, 0.5
OUT = Path(__file__).resolve().parents[2] / ".baxter/bench"
#: Clients at a time, and the time between two that come [s].
VISITORS, EVERY_S = 50, 0.1
SAMPLE_S = 1.0
#: How often the simulator is restarted meanwhile, at even distances.
RESTARTS, CALM_S = 3, 30.0
#: How long a reader stops [s], and the pause between two clients that misbehave.
STOPPED_S, PAUSE_S = 60.0, 2.0
SUBSCRIBED = {"op": "subscribe", "topic": JOINTS[0], "type": JOINTS[1]}


def measure(report, quick, number):
    minutes = QUICK_MINUTES if quick else ALL_MINUTES if os.environ.get("BENCH_ALL") else MINUTES
    with Lab(gui="false") as lab:
        web, ended = Web(lab), threading.Event()
        times_s = []
        witness = web.listen(*JOINTS, lambda _message, time_s: times_s.append(time_s), throttle_rate=VIEW_MS)
        wait_until(lambda: len(times_s) > 10, "joint states", TIMEOUT_S)
        counts = {"visits": 0, "rough": 0}
        crowds = [threading.Thread(target=crowd, args=(web.rosbridge, ended, counts)) for crowd in (visits, rough)]
        times_s.clear()
        for thread in crowds:
            thread.start()
        samples, restarts = [], []
        begin = time.monotonic()
        crowds.append(threading.Thread(target=restart, args=(
            lab, 60.0 * minutes / (RESTARTS + 1), ended, times_s, restarts)))
        crowds[-1].start()
        try:
            with kept() as keep:
                while (time_s := time.monotonic() - begin) < 60.0 * minutes:
                    samples.append((time_s, *sizes(web.process.pid)))
                    keep(samples[-1])
                    time.sleep(SAMPLE_S)
        finally:
            ended.set()
            for thread in crowds:
                thread.join(TIMEOUT_S)
            witness.close()
    # Without a simulator, and for some seconds after, the server has fewer connections.
    samples = [sample for sample in samples
               if not any(a_s < begin + sample[0] < b_s + CALM_S for a_s, b_s in restarts)]
    # The least: a client's thousand subscriptions have a thousand descriptors until the server has ended them, some
    # seconds after the client has gone. What is never given back raises the least, too.
    fifth = len(samples) // 5
    early, late = ([min(row) for row in list(zip(*some, strict=True))[1:]]
                   for some in (samples[fifth : 2 * fifth], samples[-fifth:]))
    title = "%g minutes, %d clients at a time" % (minutes, VISITORS)
    report.add(title + ": visits", counts["visits"], "")
    report.add(title + ": clients that misbehaved", counts["rough"], "")
    for k, (what, unit, most) in enumerate((("memory", "MB", 10.0), ("threads", "", 2.0), ("descriptors", "", 10.0))):
        report.add("%s: %s, least of the last fifth" % (title, what), late[k], unit)
        report.add("%s: %s, the same less that of the second" % (title, what), late[k] - early[k], unit, most=most)
    report.add(title + ": restarts of the simulator after which another client went on", len(restarts), "",
               least=RESTARTS)
    gaps = [1000.0 * (b - a) for a, b in itertools.pairwise(times_s)
            if not any(begin_s < b and a < end_s for begin_s, end_s in restarts)]
    report.add(title + ": joint states at another client, longest gap", max(gaps), "ms", samples=len(gaps))
    report.add(title + ": the same, 99 %", statistics.quantiles(gaps, n=100)[-1], "ms", samples=len(gaps))


def sizes(pid):
    """(allocated memory [MB], swapped or not, threads, descriptors) of a process; files it reads do not count."""
    fields = dict(line.split(":", 1) for line in Path("/proc/%d/status" % pid).read_text().splitlines())
    memory_kb = sum(int(fields[name].split()[0]) for name in ("RssAnon", "VmSwap"))
    return memory_kb / 1024.0, int(fields["Threads"]), len(os.listdir("/proc/%d/fd" % pid))


@contextlib.contextmanager
def kept():
    """Yield a function that keeps a sample in .baxter/bench: the figures of two fifths do not show what is between."""
    OUT.mkdir(parents=True, exist_ok=True)
    with (OUT / "web_soak.csv").open("w", buffering=1) as file:
        file.write("time [s],memory [MB],threads,descriptors\n")
        yield lambda sample: file.write("%.1f,%.1f,%d,%d\n" % sample)


def visits(address, ended, counts):
    """Clients that come, listen for as long as it takes the others to come, and go."""
    here = deque()
    while not ended.wait(EVERY_S):
        here.append(connected(address, dict(SUBSCRIBED, throttle_rate=1000 * EVERY_S)))
        counts["visits"] += 1
        if len(here) > VISITORS:
            gone(here.popleft())
    for socket in here:
        gone(socket)


def restart(lab, every_s, ended, times_s, restarts):
    """Restart the simulator RESTARTS times: (begin, end) [s] of each, until a client that stayed hears it."""
    while len(restarts) < RESTARTS and not ended.wait(every_s):
        begin_s = time.monotonic()
        lab.restart()
        before = len(times_s)
        wait_until(lambda before=before: len(times_s) > before + 10, "joint states after a restart",
                   START_LIMIT_S)
        restarts.append((begin_s, time.monotonic()))


def rough(address, ended, counts):
    """Clients that misbehave, one kind after the other, and one at a time that does not read."""
    kinds, stopped, stops_s = itertools.cycle(KINDS), None, 0.0
    while not ended.wait(PAUSE_S):
        if time.monotonic() > stops_s:
            gone(stopped)
            stopped, stops_s = connected(address, SUBSCRIBED), time.monotonic() + STOPPED_S
        socket = connected(address)
        # The server may end the connection; that is an answer.
        with contextlib.suppress(OSError, WebSocketException):
            next(kinds)(socket)
        gone(socket)
        counts["rough"] += 1
    gone(stopped)


def connected(address, *operations):
    socket = create_connection(address, timeout=TIMEOUT_S)
    for operation in operations:
        socket.send(json.dumps(operation))
    return socket


def gone(socket):
    """Without a farewell, as a laptop that is closed."""
    if socket is not None:
        socket.shutdown()


# -- how a client misbehaves ----------------------------------------------------------------------------------------

def large(socket):
    socket.send(json.dumps({"op": "advertise", "topic": "/bench_blob", "type": "std_msgs/String"}))
    socket.send(json.dumps({"op": "publish", "topic": "/bench_blob", "msg": {"data": "x" * 10_000_000}}))


def half(socket):
    socket.send('{"op": "fragment", "id": "f", "data": "{", "num": 0, "total": 2}')
    socket.send('{"op": "publish", "topic"')
    socket.recv()


def broken(socket):
    socket.send(b'{"op": "\xff\xfe"}', ABNF.OPCODE_TEXT)
    socket.recv()


def numbers(socket):
    socket.send('{"op": "advertise", "topic": "/bench_number", "type": "std_msgs/Int64"}')
    for value in ("NaN", str((1 << 53) + 1), str(1 << 80), '"9"'):
        socket.send('{"op": "publish", "topic": "/bench_number", "msg": {"data": %s}}' % value)
    socket.recv()


def flood(socket):
    for number in range(3000):
        socket.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": str(number)}))


def subscriptions(socket):
    for number in range(1000):
        socket.send(json.dumps({"op": "subscribe", "topic": "/bench_topic_%d" % number, "type": "std_msgs/String"}))


KINDS = (large, half, broken, numbers, flood, subscriptions)
