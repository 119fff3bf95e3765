# SPDX-License-Identifier: BSD-3-Clause
"""What most tests of the world begin with."""

import pytest

from bullet_sim import World


@pytest.fixture
def world():
    """An empty world, closed at the end."""
    world = World()
    yield world
    world.close()
