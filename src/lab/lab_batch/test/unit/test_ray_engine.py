# SPDX-License-Identifier: BSD-3-Clause
"""The engine Ray, with two workers on this machine: the same results as processes; nothing is left behind, and nothing
listens on a network."""
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from lab_batch import Spec, ray_engine
from lab_batch.job import Outcome
from lab_batch.processes import BatchLimits, map_seeds
from lab_testing.waiting import wait_until

HERE = Path(__file__).parent
ROOT = HERE.parents[4]
# In a separate process: Ray changes signal handlers and starts threads. It prints how each seed ended, then the
# addresses that Ray's processes listened on meanwhile, and those processes that are left. Each is written at once, on a
# separate line: Ray prints messages of its own.
PROGRAM = """
import contextlib, json, os, psutil, sys
from lab_batch import Spec, ray_engine
from lab_batch.job import Outcome
from lab_batch.processes import BatchLimits
def say(value):
    os.write(1, b"\\n%s\\n" % json.dumps(value).encode())
spec, addresses = Spec(sys.argv[1], json.loads(sys.argv[2])), set()
for one in ray_engine.map_seeds(spec, range(int(sys.argv[3])), BatchLimits(2)):
    say([one.seed, one.result, one.error])
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            addresses |= {one.laddr.ip for one in child.net_connections("inet") if one.status == psutil.CONN_LISTEN}
say(sorted(addresses))
say([child.name() for child in psutil.Process().children(recursive=True)])
"""


class LateRay:
    """The engine's part of Ray, at its worst: an actor with the seed ``deadly`` dies before any of its outcomes has
    arrived, and one at the seed ``hanging`` never ends it. ``first``: the place of what is reported first among all
    that is ready. ``start_s``: how long the start of a job takes, which does not count as an episode."""

    class exceptions:  # noqa: N801  Ray's own name
        class RayActorError(Exception):
            """An actor has died, before or at this seed."""

        class OutOfMemoryError(Exception):
            """The actor was ended because its machine's memory runs out."""

        class RayTaskError(Exception):
            """The actor's method has raised."""

    def __init__(self, deadly=None, first=0, hanging=None, start_s=0.0, death="RayActorError"):
        self._deadly, self._first, self._hanging, self._start_s = deadly, first, hanging, start_s
        self._death = getattr(self.exceptions, death)
        self._of, self._began, self.killed = {}, {}, []

    def remote(self, **_):
        return lambda kind: SimpleNamespace(remote=self._actor)

    def _actor(self, _spec, _memory_bytes):
        given = []

        def give(seed):
            given.append(seed)
            # Several actors may get the same seed, one after the other.
            self._of[seed, len(self._of)] = given
            return seed, len(self._of) - 1

        self._began[id(given)] = time.monotonic()
        return SimpleNamespace(run=SimpleNamespace(remote=give), started=SimpleNamespace(remote=lambda: give("start")))

    def kill(self, handle):
        self.killed.append(handle)

    def _is_ready(self, reference):
        given = self._of[reference]
        if self._hanging in given[:given.index(reference[0]) + 1]:
            return False
        return time.monotonic() - self._began[id(given)] >= self._start_s

    def wait(self, references, num_returns, timeout):
        def ready():
            return [one for one in references if self._is_ready(one)]

        try:
            done = wait_until(ready, "an outcome", 60.0 if timeout is None else timeout, 0.005)[self._first]
        except AssertionError:
            return [], references
        return [done], [one for one in references if one != done]

    def get(self, reference):
        if self._deadly in self._of[reference]:
            raise self._death("gone")
        return Outcome(reference[0], {}, "", 0.0)


HOLDS = """import signal, sys, tempfile
from processes.work_folder import claimed_folder
tempfile.tempdir = sys.argv[1]
with claimed_folder("ray-") as folder:
    print(folder, flush=True)
    signal.pause()
"""
SLEEP = "import signal; print(flush=True); signal.pause()"


def run(name, count, **parameters):
    """{seed: [result, error]}, the addresses listened on, and the names of the processes that the engine left."""
    environment = {**os.environ, "LAB_ROOT": str(ROOT),
                   "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([sys.executable, "-c", PROGRAM, name, json.dumps(parameters), str(count)], env=environment,
                          capture_output=True, text=True, timeout=600)
    if "pip could not install ray" in done.stderr:
        pytest.skip("Ray could not be installed from PyPI")
    assert done.returncode == 0, done.stderr
    *lines, addresses, left = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    return {seed: [result, error] for seed, result, error in lines}, addresses, left


# Ray is downloaded for it, and gives its own processes half a minute to start, whatever else runs.
@pytest.mark.long
def test_ray_gives_what_processes_give_and_a_killed_worker_costs_its_episode_only(tmp_path, monkeypatch):
    """One start of Ray for all of it: it takes 10 s and more."""
    found, addresses, left = run("small_jobs:Trouble", 8, dies_once=[2], dies=[5], raises=[3], folder=str(tmp_path))
    assert sorted(found) == list(range(8))
    assert "died twice" in found[5][1]
    assert "ValueError: seed 3 is bad" in found[3][1]
    assert not left
    assert {address.removeprefix("::ffff:") for address in addresses} == {"127.0.0.1"}
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")]))
    spec = Spec("small_jobs:Trouble", {"raises": [3], "folder": str(tmp_path)})
    plain = {one.seed: one.result for one in map_seeds(spec, range(8), BatchLimits(2))}
    assert {seed: result for seed, (result, _) in found.items() if seed != 5} == {
        seed: result for seed, result in plain.items() if seed != 5}


@pytest.mark.parametrize("death", ["RayActorError", "OutOfMemoryError"])
@pytest.mark.parametrize("first", [0, -1])
def test_a_killed_worker_costs_its_own_episode_only_whatever_waited_with_it(first, death):
    outcomes = ray_engine._Actors(LateRay(5, first, death=death), Spec("any:Job"), range(8), BatchLimits(2)).outcomes()
    errors = {one.seed: one.error for one in outcomes}
    assert sorted(errors) == list(range(8))
    assert [seed for seed, error in errors.items() if error] == [5] and "died twice" in errors[5]


def test_a_start_is_no_part_of_an_episode_and_a_late_one_fails_alone():
    """Meanwhile other actors go on, so something always ends within the limit."""
    ray = LateRay(hanging=2, start_s=0.3)
    outcomes = list(ray_engine._Actors(ray, Spec("any:Job"), range(200), BatchLimits(2, episode_s=0.2)).outcomes())
    assert sorted(one.seed for one in outcomes) == list(range(200))
    assert [one.error for one in outcomes if one.error] == ["took more than the limit of 0.2 s"]
    assert len(ray.killed) == 1


def test_other_users_cannot_open_the_folder_of_a_ray():
    """Ray itself lets everybody in."""
    options = {}
    ray = SimpleNamespace(init=options.update, shutdown=lambda: None)
    with contextlib.ExitStack() as ending:
        ray_engine._start(ray, BatchLimits(1), None, ending)
        around = Path(options["_temp_dir"]).parent
        assert around.stat().st_mode & 0o077 == 0 and around.name.startswith("ray-")
    assert not around.exists()


def test_a_start_ends_and_removes_what_a_killed_batch_has_left(monkeypatch, tmp_path):
    """Neither a Ray whose batch lives, nor a folder that is no batch's."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "ray-of-others").mkdir()
    options, ray = {}, SimpleNamespace(init=lambda **_: None, shutdown=lambda: None)
    with contextlib.ExitStack() as ending:
        users = {}
        for kind in ("living", "left"):
            holder = subprocess.Popen([sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE, text=True)
            ending.callback(holder.communicate)
            ending.callback(holder.kill)
            folder = holder.stdout.readline().strip()
            words = [sys.executable, "-c", SLEEP, "--logs=%s/ray/logs" % folder]
            users[kind] = ending.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE))
            ending.callback(users[kind].kill)
            users[kind].stdout.readline()
            options[kind] = Path(folder)
        holder.kill()
        holder.wait()
        with contextlib.ExitStack() as own:
            ray_engine._start(ray, BatchLimits(1), None, own)
            assert len(list(tmp_path.iterdir())) == 3
        assert not options["left"].exists() and users["left"].poll() is not None
        assert options["living"].is_dir() and users["living"].poll() is None
        assert (tmp_path / "ray-of-others").is_dir()


def test_processes_of_a_start_that_failed_are_ended():
    with contextlib.ExitStack() as ending:
        started = {}
        for folder in ("/tmp/ray-failed", "/tmp/other"):
            words = [sys.executable, "-c", SLEEP, "--logs=%s/logs" % folder]
            started[folder] = ending.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE))
            ending.callback(started[folder].kill)
            started[folder].stdout.readline()
        ray_engine.end_processes("/tmp/ray-failed")
        assert [process.poll() is None for process in started.values()] == [False, True]
