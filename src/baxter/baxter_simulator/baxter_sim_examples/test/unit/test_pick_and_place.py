# SPDX-License-Identifier: BSD-3-Clause
"""The order of steps, and the scene of a seed; no physics."""
import math
import subprocess
import sys

import numpy as np
import pytest

from baxter_sim_examples import BLOCK_SIZE_M, BlockLost, Spot, Trial, block_urdf, pick_and_place, tool_down
from baxter_sim_examples.pick_and_place import HOVER_M, aside_angles, grip_yaw, start_angles
from urdf_model import parse_urdf
from urdf_model.transforms import matrix_from_quaternion

SOURCE, TARGET = Spot(0.6, 0.2, -0.13, 0.3), Spot(0.7, 0.0, -0.13, 2.0)


class FakeArm:
    """Records its calls; `slips_at` is the number of the call of holds(), from 1, that returns False."""

    def __init__(self, name="left", slips_at=None):
        self.name, self.did, self._asked, self._slips_at = name, [], 0, slips_at

    def ik(self, position, orientation, seed):
        assert seed == self.did[-1] or not isinstance(self.did[-1], dict)
        return {"position": position, "orientation": orientation}

    def move_to(self, angles):
        self.did.append(angles)
        return angles

    def open(self):
        self.did.append("open")

    def close(self):
        self.did.append("close")

    def holds(self):
        self._asked += 1
        return self._asked != self._slips_at


@pytest.mark.parametrize("limb", ["left", "right"])
def test_fingers_open_and_close_on_the_spots_and_nowhere_else(limb):
    arm = FakeArm(limb)
    pick_and_place(arm, SOURCE, TARGET)
    assert arm.did[:2] == ["open", start_angles(limb)]
    closing, opening = arm.did.index("close"), len(arm.did) - 1 - arm.did[::-1].index("open")
    assert arm.did[closing - 1]["position"] == (SOURCE.x, SOURCE.y, SOURCE.z)
    assert arm.did[opening - 1]["position"] == (TARGET.x, TARGET.y, TARGET.z)
    carried = [step["position"] for step in arm.did[closing + 1:opening]]
    sideways = [(a, b) for a, b in zip(carried, carried[1:], strict=False) if a[:2] != b[:2]]
    assert sideways == [((SOURCE.x, SOURCE.y, SOURCE.z + HOVER_M), (TARGET.x, TARGET.y, TARGET.z + HOVER_M))]
    assert arm.did[-1]["position"] == (TARGET.x, TARGET.y, TARGET.z + HOVER_M)


def test_between_the_fingers_the_tool_goes_in_short_steps():
    """A physical arm leaves the straight line by a part of a step, and there are 8 mm beside each finger."""
    arm = FakeArm()
    pick_and_place(arm, SOURCE, TARGET)
    places = [step["position"] for step in arm.did if "position" in step]
    near = [(a, b) for a, b in zip(places, places[1:], strict=False) if min(a[2], b[2]) < SOURCE.z + BLOCK_SIZE_M]
    assert len(near) > 8
    assert all(a[:2] == b[:2] and abs(a[2] - b[2]) < 0.013 for a, b in near)


@pytest.mark.parametrize("question, when", [(1, "after the fingers closed"), (2, "lifted"), (3, "on the way")])
def test_a_block_that_is_lost_is_noticed(question, when):
    arm = FakeArm(slips_at=question)
    with pytest.raises(BlockLost, match=when):
        pick_and_place(arm, SOURCE, TARGET)
    assert arm.did.count("open") == 1


def test_right_arm_begins_as_the_mirror_image():
    left, right = start_angles("left"), start_angles("right")
    assert right["right_s0"] == -left["left_s0"]
    assert right["right_s1"] == left["left_s1"]


@pytest.mark.parametrize(("limb", "outwards"), [("left", 1.0), ("right", -1.0)])
def test_aside_is_turned_outwards(limb, outwards):
    aside, start = aside_angles(limb), start_angles(limb)
    assert outwards * (aside[limb + "_s0"] - start[limb + "_s0"]) > 0.5


@pytest.mark.parametrize("yaw", np.linspace(-7.0, 7.0, 29))
def test_fingers_meet_two_faces_with_the_smallest_turn(yaw):
    assert abs(grip_yaw(yaw)) <= math.pi / 4.0 + 1e-12
    assert math.sin(2.0 * (grip_yaw(yaw) - yaw)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("yaw", [-2.0, 0.0, 0.7])
def test_tool_looks_down(yaw):
    rotation = matrix_from_quaternion(tool_down(yaw))
    np.testing.assert_allclose(rotation[:3, 2], (0.0, 0.0, -1.0), atol=1e-12)
    np.testing.assert_allclose(rotation[:3, 0], (math.cos(yaw), math.sin(yaw), 0.0), atol=1e-12)


def test_a_seed_decides_everything():
    assert Trial.from_seed(5) == Trial.from_seed(5)
    trials = [Trial.from_seed(seed) for seed in range(50)]
    for field in ("source", "target", "mass_kg", "friction"):
        assert len({getattr(trial, field) for trial in trials}) == 50
    for trial in trials:
        assert math.dist((trial.source.x, trial.source.y), (trial.target.x, trial.target.y)) >= 0.1
        assert 0.05 <= trial.mass_kg <= 0.3 and 0.4 <= trial.friction <= 1.0
    assert np.ptp([trial.start["left_s0"] for trial in trials]) > 0.3


def test_block_has_mass_size_and_friction():
    link = parse_urdf(block_urdf(0.2, 0.7), source="block").links["block"]
    assert link.inertial.mass == 0.2
    assert link.inertial.inertia[0, 0] == pytest.approx(0.2 * BLOCK_SIZE_M**2 / 6.0, rel=1e-4)
    assert link.collisions[0].geometry.size == (BLOCK_SIZE_M,) * 3
    assert link.surface.friction == 0.7


def test_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'gazebo_msgs', 'geometry_msgs'))); "
    subprocess.run([sys.executable, "-c", block + "import baxter_sim_examples"], check=True)
