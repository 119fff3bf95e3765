# SPDX-License-Identifier: BSD-3-Clause
"""A first command does not wait for the compiler: where nothing is in its cache, that takes half a minute on a busy
machine, in which the arm would stand."""
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from motion_planning.scene import WorldObject
from moveit_servo.servo import ServoCommand
from moveit_servo.warming import warm_up
from urdf_model import Box, Cylinder, Sphere

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import Driven, planar_model  # noqa: E402


def at(x, y):
    place = np.eye(4)
    place[:2, 3] = x, y
    return place


@pytest.mark.parametrize("command", [
    ServoCommand(twist=np.array((-0.2, 0.1, 0.0, 0.0, 0.0, 0.3))),
    ServoCommand(twist=np.array((0.0, 0.3, 0.0, 0.0, 0.0, 0.0))),
    ServoCommand(joints=np.full(3, 0.2)), ServoCommand(pose=at(0.6, 0.5))], ids=["twist", "shift", "joints", "pose"])
def test_all_that_a_step_calls_was_called_before(monkeypatch, command):
    things = [WorldObject(name, np.eye(4), ((shape, at(0.8, y)),)) for name, shape, y in (
        ("box", Box((0.2, 0.2, 0.2)), 0.9), ("can", Cylinder(0.05, 0.3), 0.7), ("ball", Sphere(0.1), -0.4))]
    driven = Driven(planar_model(), "arm", {"turn0": 0.3, "turn1": -0.8, "turn2": 0.9}, things)
    warm_up()

    def never(function, *_, **__):
        raise AssertionError("%s is called with other arguments than before" % function.py_func.__qualname__)

    monkeypatch.setattr(CPUDispatcher, "_compile_for_args", never)
    assert len(driven.go(command, 1.0)) == 125
