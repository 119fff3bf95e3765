# SPDX-License-Identifier: BSD-3-Clause
"""torture.py faults: every node killed (SIGKILL) and stopped (SIGSTOP, SIGCONT) at random moments."""
import contextlib
import os
import random
import signal
import statistics
import time

from limits import arm_limits
from robot import LabError, Robot, init_node
from watch import Watch

from lab import Lab
from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until

STILL_RAD = 0.001
BACK_S, END_S = 120.0, 60.0
# When this node ends, the whole lab ends: all others depend on it.
ENDS_THE_LAB = "/gazebo"
STOPPED_S = (0.2, 3.0)


def run(options, journal):
    """Kill and stop nodes until the time or the number of rounds (--messages) is reached; without either, one round."""
    rounds = options.messages if options.messages_given else 1 if options.until is None else 10**9
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            faults = Faults(lab, watch, Robot(watch), journal)
            for number in range(options.first, options.first + rounds):
                if options.until is not None and time.monotonic() > options.until:
                    break
                faults.round(options.seed, number)
            return {"simulated_s": watch.simulated_s, "also": {
                "back_after_s": {node: summary(times) for node, times in sorted(faults.back_s.items())},
                "lab_gone_after_the_death_of_gazebo_s": summary(faults.gone_s),
                "lab_started_again_in_s": summary(faults.started_s),
                "stops_survived": faults.stops, "kills": faults.kills}}


class Faults:
    """Kills and stops nodes and measures their recovery time."""

    def __init__(self, lab, watch, robot, journal):
        self._lab, self._watch, self._robot, self._journal = lab, watch, robot, journal
        self.back_s, self.gone_s, self.started_s = {}, [], []
        self.stops = self.kills = 0

    def round(self, seed, number):
        """Kill every node once and stop every node once, in an order that depends on the seed."""
        choose = random.Random("%d/%d" % (seed, number))
        harm = [(node, kind) for node in self._lab.nodes() for kind in ("kill", "stop")]
        choose.shuffle(harm)
        for node, kind in harm:
            moment = choose.uniform(0.0, 2.0)
            self._journal.note(number, node, kind, "%.2f s" % moment)
            time.sleep(moment)  # a random delay is wanted here, not a condition
            try:
                self._robot.enable()
                if kind == "kill":
                    self._kill(node)
                else:
                    self._stop(node, choose.uniform(*STOPPED_S))
                self._robot.follow()
                problems = self._watch.take_found()
            except (LabError, AssertionError, OSError) as error:
                problems = [*self._watch.take_found(), "%s: %s" % (type(error).__name__, error)]
            if problems:
                self._journal.fail("after %s of %s: %s" % (kind, node, "; ".join(problems[:5])), seed, number, 1)
                self._mend()

    def _kill(self, node):
        pid = self._lab.pid(node)
        if pid is None:
            return
        had = self._registered(node)
        self.kills += 1
        begin = time.monotonic()
        os.kill(pid, signal.SIGKILL)
        if node == ENDS_THE_LAB:
            wait_until(lambda: self._lab.launched.poll() is not None, "roslaunch to end after %s" % node, END_S, 0.05)
            self.gone_s.append(time.monotonic() - begin)
            self._start_again()
            return

        def is_back():
            now = self._lab.pid(node) if node in self._lab.nodes() else None
            return now not in (None, pid) and had <= self._registered(node)

        wait_until(is_back, "%s to be back with all of its topics and services" % node, BACK_S, 0.05)
        self.back_s.setdefault(node, []).append(time.monotonic() - begin)

    def _stop(self, node, seconds):
        pid = self._lab.pid(node)
        if pid is None:
            return
        self.stops += 1
        before = self._watch.simulated_s
        os.kill(pid, signal.SIGSTOP)
        try:
            time.sleep(seconds)  # the time that it stays stopped
            if node != ENDS_THE_LAB:
                wait_until(lambda: self._watch.simulated_s > before, "time to pass while %s is stopped" % node, END_S)
        finally:
            os.kill(pid, signal.SIGCONT)
        wait_until(lambda: self._lab.pid(node) == pid, "%s to answer again" % node, BACK_S, 0.05)

    def _registered(self, node):
        """Names of a node's topics, subscriptions and services."""
        state = self._lab.master.getSystemState("/torture")[2]
        return {(kind, name) for kind, rows in enumerate(state) for name, nodes in rows if node in nodes
                # Action topics come and go with connections; only subscriptions and services count.
                and "/torture" not in name}

    def _start_again(self):
        self._watch.stamps.announce_reset()
        self.started_s.append(self._lab.relaunch())
        self._watch.stamps.announce_reset()

    def _mend(self):
        pids = self._lab.processes()
        with contextlib.suppress(LabError):
            if all(is_alive(pid) for pid in pids.values()) and ENDS_THE_LAB in pids:
                self._robot.follow()
                return
        self._start_again()
        self._watch.take_found()


def summary(times):
    """Return median, longest and number of durations [s]."""
    return {} if not times else {
        "median": round(statistics.median(times), 1), "longest": round(max(times), 1), "times": len(times)}
