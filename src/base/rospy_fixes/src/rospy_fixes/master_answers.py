# SPDX-License-Identifier: BSD-3-Clause
"""A question to the ROS master has a deadline.

A master that is stopped, not ended, still accepts connections, and ``rosgraph.Master`` waits for its answer for ever:
in services of nodes, in buttons of a page, in rosnode and rostopic. Here each call raises TimeoutError after ANSWER_S,
an OSError as the error of a master that is not there; rosnode and rostopic say then that they cannot reach it.
"""
from __future__ import annotations

from typing import Any

import master_calls

#: Longest wait for an answer [s, wall]. The master's longest work, all parameters of a large robot, takes a second.
ANSWER_S = 20.0


def amend(module: Any) -> None:
    """Give the calls of rosgraph.masterapi's Master a deadline."""
    module.ServerProxy = lambda uri: master_calls.proxy(uri, ANSWER_S)
