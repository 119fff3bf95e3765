# SPDX-License-Identifier: BSD-3-Clause
"""Jobs for the tests of the engines."""
import contextlib
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

from lab_batch import Job


class Square(Job):
    """The square of a seed, and of a random number of it."""

    def __init__(self, factor=1.0, folder=""):
        self._factor, self._folder = factor, folder

    def start(self):
        if self._folder:
            Path(self._folder, "started-%d" % os.getpid()).touch()

    def run(self, seed):
        import numpy as np

        print("this is no result")
        return {"square": self._factor * seed * seed, "drawn": float(np.random.default_rng(seed).random()),
                "threads": os.environ.get("OMP_NUM_THREADS", "")}

    def end(self):
        if self._folder:
            Path(self._folder, "ended-%d" % os.getpid()).touch()


class Trouble(Job):
    """Raises, dies, hangs or returns nonsense, by the seed."""

    def __init__(self, folder="", raises=(), dies=(), dies_once=(), hangs=(), nonsense=(), unwritable=()):
        self._folder = Path(folder)
        self._by_kind = {"raises": raises, "dies": dies, "dies_once": dies_once, "hangs": hangs, "nonsense": nonsense,
                         "unwritable": unwritable}

    def run(self, seed):
        kind = next((kind for kind, seeds in self._by_kind.items() if seed in seeds), "")
        if kind == "raises":
            raise ValueError("seed %d is bad" % seed)
        if kind == "dies" or (kind == "dies_once" and not (self._folder / str(seed)).exists()):
            (self._folder / str(seed)).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if kind == "hangs":
            child = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"])
            (self._folder / "child").write_text(str(child.pid))
            signal.pause()
        if kind == "nonsense":
            return seed
        if kind == "unwritable":
            return {"value": float("nan")}
        return {"good": True, "drawn": random.Random(seed).random()}


class Hog(Job):
    """Takes 600 MB of memory, by the seed: at once, by itself for ever, or by three programs."""

    def __init__(self, folder="", at_once=(), keeps=(), programs=()):
        self._folder, self._kept = Path(folder), []
        self._at_once, self._keeps, self._programs = at_once, keeps, programs

    def run(self, seed):
        import numpy as np

        if seed in self._at_once:
            return {"last": float(np.ones(75_000_000)[-1])}
        if seed in self._keeps:
            self._keep_all()
        if seed in self._programs:
            words = [sys.executable, "-c", "import signal; kept = bytes(range(200)) * 1_000_000; signal.pause()"]
            started = [subprocess.Popen(words, start_new_session=True) for _ in range(3)]
            (self._folder / "programs").write_text(" ".join(str(one.pid) for one in started))
            signal.pause()
        return {"good": True}

    def _keep_all(self):
        """To the last kilobyte."""
        for size in (1_000_000, 1_000):
            with contextlib.suppress(MemoryError):
                while True:
                    self._kept.append(bytes(size))
        self._kept.append(bytes(1_000_000))


class Leaves(Job):
    """Leaves a process that has a session of its own and whose parent has ended."""

    def __init__(self, folder="", hangs=()):
        self._folder, self._hangs = Path(folder), hangs

    def run(self, seed):
        forking = "setsid sleep 600 > /dev/null 2>&1 & echo $!"
        done = subprocess.run(["sh", "-c", forking], stdout=subprocess.PIPE, text=True, check=True)
        (self._folder / ("left-%d" % seed)).write_text(done.stdout)
        if seed in self._hangs:
            signal.pause()
        return {}


class Mute(Exception):
    """Has no text."""

    def __str__(self):
        raise RuntimeError("no text")


class OddErrors(Job):
    """Raises what programs seldom raise."""

    def run(self, seed):
        raise (SystemExit(3), SystemExit(0), Mute(), ValueError("half a character: \ud800"))[seed]


class ExitsAtStart(Job):
    """Ends its program."""

    def start(self):
        sys.exit("wrong option")


class CannotStart(Job):
    """Says so."""

    def start(self):
        raise OSError("no such robot")


class HogAtStart(Job):
    """Takes 600 MB."""

    def start(self):
        self._kept = bytes(600_000_000)


class DiesAtStart(Job):
    """Takes its process with it."""

    def start(self):
        os.kill(os.getpid(), signal.SIGKILL)


class NoJob:
    """Does not derive from Job."""
