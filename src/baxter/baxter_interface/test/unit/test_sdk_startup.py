# SPDX-License-Identifier: BSD-3-Clause
"""Wait until a publisher has its expected subscribers."""
import itertools
import math

import pytest

from baxter_interface import startup


class Publisher:
    """Has one connection more each time it is looked at."""

    resolved_name = "/robot/set_super_stop"

    def __init__(self):
        self.looks = 0
        self._connections = itertools.count()

    def get_num_connections(self):
        self.looks += 1
        return next(self._connections)


@pytest.mark.parametrize("listed, enough, looks", [
    ([], None, 1), ([], 1, 1), (["/robot"], 1, 2), (["/robot", "/recorder"], None, 3), (["/robot", "/recorder"], 1, 2)])
def test_subscribers_are_waited_for_until_there_are_enough(monkeypatch, listed, enough, looks):
    monkeypatch.setattr(startup, "_nodes_of", lambda topic, subscribers: listed)
    publisher = Publisher()
    startup.wait_for_subscribers(publisher, timeout=math.inf, enough=enough)
    assert publisher.looks == looks
