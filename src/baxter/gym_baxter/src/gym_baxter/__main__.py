# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m gym_baxter``: a few steps of every environment, and how fast they are here."""
import time

import numpy as np

from .core import Core
from .tasks import TASKS

_ACTIONS = 100

for name in TASKS:
    core = Core(name)
    core.reset(np.random.default_rng(0))
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (_ACTIONS, core.action_size))
    begin = time.perf_counter()
    for action in actions:
        core.step(action)
    print("%-15s %4.0f steps/s" % (name, _ACTIONS / (time.perf_counter() - begin)))
    core.close()
