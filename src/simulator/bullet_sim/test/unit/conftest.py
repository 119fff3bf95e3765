# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of most tests of the world."""

import pytest

from bullet_sim import World


@pytest.fixture
def world():
    """An empty world, closed at the end."""
    world = World()
    yield world
    world.close()
