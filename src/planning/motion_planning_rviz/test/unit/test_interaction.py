# SPDX-License-Identifier: BSD-3-Clause
"""Which links can be dragged, and states."""
import numpy as np
import pytest

from motion_planning_rviz import interaction
from motion_planning_rviz.interaction import Handle, InteractionError


def test_ends_of_arms_are_no_groups_to_plan_for(twins, probot):
    assert interaction.plannable(twins) == ("left_arm", "right_arm", "both_arms")
    assert interaction.plannable(probot) == ("manipulator",)


def test_an_end_effectors_link_is_dragged_or_else_the_tip(twins, probot):
    left, right = Handle("left_tip", "left_arm"), Handle("right_hand", "right_arm")
    assert interaction.handles_of(twins, "left_arm") == (left,)
    assert interaction.handles_of(twins, "right_arm") == (right,)
    assert interaction.handles_of(twins, "both_arms") == (right, left)
    assert interaction.handles_of(twins, "left_gripper") == ()
    assert interaction.handles_of(probot, "manipulator") == (Handle("tool0", "manipulator"),)


def test_named_states_leave_other_joints_alone(twins):
    state = twins.state({"right_turn": 0.7})
    named = interaction.named_state(twins, state, "left_arm", "out")
    assert named.positions == {**state.positions, "left_turn": 1.0, "left_reach": 0.5}
    with pytest.raises(InteractionError, match="group 'right_arm' has no state 'out'; its states are none"):
        interaction.named_state(twins, state, "right_arm", "out")


def test_random_states_fill_the_limits_of_the_group_alone(twins):
    generator, state = np.random.default_rng(0), twins.state({"right_turn": 0.7})
    drawn = np.array([interaction.random_state(twins, state, "left_arm", generator).q for _ in range(300)])
    for name, (low, high) in {"left_turn": (-2.0, 2.0), "left_reach": (0.0, 1.0)}.items():
        column = drawn[:, twins.index[name]]
        assert low <= column.min() < low + 0.1 * (high - low) and high - 0.1 * (high - low) < column.max() <= high
    others = [k for name, k in twins.index.items() if not name.startswith("left_t") and name != "left_reach"]
    assert (drawn[:, others] == state.q[others]).all()


def test_values_that_mean_nothing_to_the_robot_are_left_out(twins):
    state = twins.default_state()
    assert interaction.with_known(state, {"wheel": 1.0, "left_turn": float("nan"), "right_turn": 0.3}).positions == {
        **state.positions, "right_turn": 0.3}


def test_the_reason_names_the_link(probot):
    pose, (handle,) = np.eye(4), interaction.handles_of(probot, "manipulator")
    pose[:3, 3] = (3.0, 0.0, 0.0)
    assert "tool0" in interaction.why_unreachable(probot, handle, pose, probot.default_state())
    reached = interaction.pose_of(probot, probot.default_state(), "tool0")
    assert interaction.why_unreachable(probot, handle, reached, probot.default_state()) is None


def test_the_way_out_of_the_arm(twins, probot):
    """PROBOT's tool frame points into the arm, which points down at home; the twins' reach is along x."""
    home = probot.default_state()
    np.testing.assert_allclose(interaction.outwards(probot, home, "tool0"), (0.0, 0.0, -1.0), atol=1e-4)
    turned = twins.state({"left_turn": 0.5 * np.pi, "left_reach": 0.3})
    np.testing.assert_allclose(interaction.outwards(twins, turned, "left_tip"), (0.0, 1.0, 0.0), atol=1e-9)


def test_what_is_held_may_touch_the_hand_and_its_fingers(twins):
    assert interaction.touch_links(twins, Handle("left_tip", "left_arm")) == ["left_finger", "left_hand", "left_tip"]
    assert interaction.touch_links(twins, Handle("right_hand", "right_arm")) == ["right_hand", "right_tip"]


def test_sameness_for_the_eye():
    other = np.eye(4)
    assert interaction.is_at(np.eye(4), other)
    other[0, 3] = 0.002
    assert not interaction.is_at(np.eye(4), other)
