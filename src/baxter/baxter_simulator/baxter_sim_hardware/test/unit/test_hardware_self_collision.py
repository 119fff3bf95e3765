# SPDX-License-Identifier: BSD-3-Clause
"""The arms collide with each other and with the body, and have no contact when they are folded."""
import numpy as np
import pytest

from baxter_model import JOINTS

HEARD = ()
POSITION = 1
SIDES = ("left", "right")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)


def touching(lab):
    """Pairs of Baxter's own bodies that overlap or press on each other."""
    return {tuple(sorted((contact.link_a, contact.link_b))) for contact in lab.world.contacts(lab.model)
            if contact.model_a == contact.model_b and (contact.distance <= 0.0 or contact.force > 0.0)}


@pytest.mark.parametrize("pose", ["start", "neutral", "tucked", "untucked"])
def test_named_poses_are_free_of_contact(make_lab, pose):
    lab = make_lab(pose=pose, meshes=True, parameters={"enable": True})
    lab.run(0.2)
    assert touching(lab) == set()


@pytest.mark.parametrize("angle", [1.3, 1.6])
def test_arms_that_cross_stop_each_other(make_lab, angle):
    """Both arms stretched forward swing inwards: they meet in the middle and press there instead of passing."""
    angles = np.zeros(14)
    lab = make_lab(angles=angles, meshes=True, parameters={"enable": True})
    goal = dict.fromkeys(NAMES, 0.0)
    goal["left_s0"], goal["right_s0"] = -angle, angle
    lab.command(POSITION, list(goal.values()))
    lab.run(2.5)
    pairs = touching(lab)
    assert pairs and all(a.startswith("l") and b.startswith("r") for a, b in pairs)
    assert abs(lab.position[0]) < angle - 0.05


def test_a_hand_does_not_enter_the_body(make_lab):
    """The forearm folds back onto the chest."""
    lab = make_lab(pose="neutral", meshes=True, parameters={"enable": True})
    lab.command(POSITION, [-1.7, -0.3, 2.6], names=["left_s0", "left_s1", "left_e1"])
    lab.run(3.0)
    assert any("base" in pair for pair in touching(lab))
    assert min(contact.distance for contact in lab.world.contacts(lab.model)) > -0.005
