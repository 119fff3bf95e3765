# SPDX-License-Identifier: BSD-3-Clause
"""The page's message when the simulation cannot be asked."""
import errno
import os

import pytest

from lab_web import simulation
from lab_web.lab import RobotError


class TaskQueue:
    def do(self, client, what, function, *arguments):
        return function(*arguments)


def test_a_master_that_has_gone_is_named(monkeypatch):
    def refuse(*_, **__):
        raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))

    monkeypatch.setattr(simulation, "call", refuse)
    asked = simulation.SimulationControls(TaskQueue(), dict, None, None)
    with pytest.raises(RobotError, match="the ROS master does not answer .*: start the lab again"):
        asked._do("step")
