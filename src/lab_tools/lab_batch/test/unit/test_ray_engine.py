# SPDX-License-Identifier: BSD-3-Clause
"""The engine Ray, with two workers on this machine: the same results as processes; nothing is left behind."""
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lab_batch import Spec
from lab_batch.processes import Limits, map_seeds

HERE = Path(__file__).parent
ROOT = HERE.parents[4]
# In a separate process: Ray changes signal handlers and starts threads. It prints how each seed ended.
PROGRAM = """
import json, sys
from lab_batch import Spec, ray_engine
from lab_batch.processes import Limits
spec = Spec(sys.argv[1], json.loads(sys.argv[2]))
for one in ray_engine.map_seeds(spec, range(int(sys.argv[3])), Limits(2)):
    print(json.dumps([one.seed, one.result, one.error]), flush=True)
import ray, psutil
print(json.dumps([child.name() for child in psutil.Process().children(recursive=True)]))
"""
# It installs 250 MB, once, and starts in 10 s on a quiet machine, in minutes on a busy one.
pytestmark = pytest.mark.long


def run(name, count, **parameters):
    """{seed: [result, error]}, and the names of the processes that the engine left running."""
    environment = {**os.environ, "LAB_ROOT": str(ROOT),
                   "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([sys.executable, "-c", PROGRAM, name, json.dumps(parameters), str(count)], env=environment,
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    *lines, left = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    return {seed: [result, error] for seed, result, error in lines}, left


def test_ray_gives_what_processes_give_and_a_killed_worker_costs_its_episode_only(tmp_path, monkeypatch):
    """One start of Ray for all of it: it takes 10 s and more."""
    found, left = run("small_jobs:Trouble", 8, dies_once=[2], dies=[5], raises=[3], folder=str(tmp_path))
    assert sorted(found) == list(range(8))
    assert "died twice" in found[5][1]
    assert "ValueError: seed 3 is bad" in found[3][1]
    assert not left
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")]))
    spec = Spec("small_jobs:Trouble", {"raises": [3], "folder": str(tmp_path)})
    plain = {one.seed: one.result for one in map_seeds(spec, range(8), Limits(2))}
    assert {seed: result for seed, (result, _) in found.items() if seed != 5} == {
        seed: result for seed, result in plain.items() if seed != 5}
