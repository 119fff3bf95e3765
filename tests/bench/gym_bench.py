# SPDX-License-Identifier: BSD-3-Clause
"""Actions a second of gym_baxter's environments, by processor time, with random actions of full size.

TwoArmLift runs beside robosuite's, in the same round; both with operational-space control at 20 Hz, and state
observations. robosuite has a Python of its own in .baxter/bench/gym, made here at the first run (300 MB); without a
network the comparison is left out.
"""
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from gym_baxter.core import Choices, Core
from gym_baxter.tasks import TASKS

HERE = Path(__file__).resolve().parent
PEER = HERE.parents[1] / ".baxter/bench/gym"
# MuJoCo 4 names joints otherwise than this robosuite expects.
PINS = ("robosuite==1.5.2", "mujoco==3.3.7")
ACTIONS, LIMIT_S = 300, 900


def measure(report, quick, number):
    """One round."""
    count = ACTIONS // 10 if quick else ACTIONS
    peer = peer_rate(count, number)
    for task in TASKS:
        rate = own_rate(Core(task, Choices("osc_pose")), count, number)
        beside = peer if task == "TwoArmLift" else None
        report.add("%s, state" % task, rate, "actions/s", peer=None if beside is None else ("robosuite 1.5.2", beside),
                   samples=count, **({"least": 400.0} if task == "Reach" else
                                     {"ratio_least": 4.0} if task == "TwoArmLift" else {}))
    core = Core("PickPlace", Choices("osc_pose", obs_type="pixels"))
    core.reset(np.random.default_rng(0))
    core.step(np.zeros(core.action_size))  # the first picture prepares what is drawn
    report.add("PickPlace, three pictures of 84 x 84", own_rate(core, count // 3, number), "actions/s",
               samples=count // 3, least=60.0)


def own_rate(core, count, seed):
    """Actions a second of processor time of this thread, after an episode's start."""
    core.reset(np.random.default_rng(seed))
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, core.action_size))
    begin = time.process_time()
    for action in actions:
        core.step(action)
    spent = time.process_time() - begin
    core.close()
    return count / spent


def peer_rate(count, seed):
    """robosuite's, or None where it cannot be installed."""
    python = PEER / "bin/python"
    stamp = PEER / "installed.txt"
    if not stamp.exists() or stamp.read_text() != "\n".join(PINS):
        made = [[sys.executable, "-m", "venv", "--clear", str(PEER)],
                [str(python), "-m", "pip", "install", "--quiet", *PINS]]
        if any(subprocess.run(command, check=False).returncode for command in made):
            print("robosuite could not be installed; the comparison with it is left out")
            return None
        stamp.write_text("\n".join(PINS))
    plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run([str(python), str(HERE / "gym_peer.py"), str(count), str(seed)], env=plain,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, timeout=LIMIT_S, check=True)
    return count / sum(json.loads(done.stdout.splitlines()[-1]))
