# SPDX-License-Identifier: BSD-3-Clause
"""The panel with a client and a view that remember."""
import numpy as np
import pytest

from motion_planning.errors import PlanningError
from motion_planning_rviz import interaction
from motion_planning_rviz.client import ActionOutcome, BodyTouch, NoAnswer
from motion_planning_rviz.interaction import InteractionError

TOUCH = BodyTouch("left_hand", "crate", ("left_hand",), (), (0.0, 0.0, 0.0), "base")


def command(panel, *words):
    """The command of the menu's entry whose titles, from the top down, end in ``words``."""
    entries = {entry.number: entry for entry in panel.view.entries}

    def path(entry):
        above = path(entries[entry.parent]) if entry.parent else ()
        return (*above, entry.title.removeprefix("[x] ").removeprefix("[  ] "))

    (found,) = [entry for entry in entries.values() if path(entry) == words]
    return found.command


def chosen(panel):
    return {entry.title for entry in panel.view.entries if entry.title.startswith("[x]")}


def moved(pose, *offset):
    pose = np.array(pose)
    pose[:3, 3] += offset
    return pose


# -- goal and start ---------------------------------------------------------------------------------------------

def test_the_goal_begins_where_the_robot_is(twins, panel_of):
    panel = panel_of(twins)
    panel.client.robot = {"left_turn": 0.4, "left_reach": 0.2, "wheel": 3.0}
    panel.begin("left_arm", 0.5)
    goal = panel.view.ghosts["goal"][0]
    assert (goal.positions["left_turn"], goal.positions["left_reach"]) == (0.4, 0.2)
    np.testing.assert_allclose(panel.view.poses[("goal", "left_tip")], twins.frame_of(goal.q, "left_tip"))
    assert set(panel.view.ghosts) == {"goal"} and panel.view.lines == []


def test_a_goal_waits_until_the_joints_were_heard_of(twins, panel_of):
    panel = panel_of(twins)
    panel.client.robot, panel.client.is_measured = {"left_turn": 0.0}, False
    with pytest.raises(PlanningError, match="it has not heard where the joints are"):
        panel.begin("left_arm", 0.5, measured=True)
    panel.begin("left_arm", 0.5)
    panel.client.robot, panel.client.is_measured = {"left_turn": 0.4}, True
    panel.begin("left_arm", 0.5, measured=True)
    assert panel.view.ghosts["goal"][0].positions["left_turn"] == 0.4


def test_joints_follow_a_handle_that_is_dragged(probot, panel_of):
    panel = panel_of(probot)
    (handle,) = panel.handles
    panel.named("goal", "home")
    wanted = moved(panel.view.poses[("goal", "tool0")], 0.02, 0.01, -0.03)
    panel.view.poses.clear()
    panel.drag("goal", handle, wanted, released=False)
    np.testing.assert_allclose(probot.frame_of(panel.query.goal.q, "tool0"), wanted, atol=1e-5)
    assert panel.view.poses == {}, "a handle is moved while the mouse holds it"
    panel.drag("goal", handle, wanted)
    np.testing.assert_allclose(panel.view.poses[("goal", "tool0")], wanted, atol=1e-5)


def test_out_of_reach_the_ghost_stays_and_the_reason_is_said(probot, panel_of):
    panel = panel_of(probot)
    (handle,) = panel.handles
    before = panel.query.goal
    far = moved(panel.view.poses[("goal", "tool0")], 3.0, 0.0, 0.0)
    panel.view.poses.clear()
    panel.drag("goal", handle, far)
    assert panel.view.poses == {}, "the handle is taken away from where it was dragged"
    state, _, _, unreached = panel.view.ghosts["goal"]
    assert state is before and unreached[0] == handle and unreached[1] is far
    assert panel.view.lines[0].startswith("link 'tool0' cannot be put there: out of reach: ")
    panel.drag("goal", handle, probot.frame_of(before.q, "tool0"))
    assert panel.view.lines == [] and panel.view.ghosts["goal"][3] is None


def test_one_arm_of_two_follows_its_own_handle(twins, panel_of):
    panel = panel_of(twins, "both_arms")
    right, left = panel.handles
    panel.client.posture = lambda handle, pose, state, avoid: {"left_turn": 0.5, "right_turn": 0.25, "left_grip": 0.01}
    panel.drag("goal", left, np.eye(4))
    assert panel.query.goal.positions["left_turn"] == 0.5
    assert panel.query.goal.positions["right_turn"] == panel.query.goal.positions["left_grip"] == 0.0


def test_links_that_touch_are_named(twins, panel_of):
    panel = panel_of(twins)
    panel.client.touching = [TOUCH, TOUCH]
    panel.named("goal", "out")
    assert panel.view.lines == ["left_hand touches crate"]
    assert panel.view.ghosts["goal"][1] == [TOUCH, TOUCH]


def test_joints_beyond_their_limits_are_named(twins, panel_of):
    panel = panel_of(twins)
    panel.set_state("goal", {"left_turn": 2.5})
    assert panel.view.lines == ["joint 'left_turn' is at 2.5, beyond -2 to 2"]


def test_the_start_gets_a_marker_where_it_is_wished(twins, panel_of):
    panel = panel_of(twins)
    assert "[x] Where the robot is" in chosen(panel)
    panel.copy("start")
    assert panel.query.start is panel.query.goal and ("start", "left_tip") in panel.view.poses
    assert "[x] Another, with a marker" in chosen(panel)
    panel.named("goal", "out")
    panel.copy("goal")
    assert panel.query.goal is panel.query.start
    panel.current("start")
    assert panel.query.start is None and set(panel.view.ghosts) == {"goal"}
    assert ("start", "left_tip") not in panel.view.poses


def test_random_goals_are_valid_or_refused(twins, panel_of):
    panel = panel_of(twins)
    panel.client.touching = lambda state: [] if state.positions["left_turn"] > 1.0 else [TOUCH]
    panel.random("goal")
    assert panel.query.goal.positions["left_turn"] > 1.0
    panel.client.touching = [TOUCH]
    with pytest.raises(InteractionError, match="none of 200 random states is valid"):
        panel.random("goal")


def test_another_group_has_other_handles(twins, panel_of):
    panel = panel_of(twins)
    panel.select_group("right_arm")
    assert set(panel.view.poses) == {("goal", "right_hand")}
    with pytest.raises(InteractionError, match="no group 'legs'.*left_arm, right_arm, both_arms"):
        panel.select_group("legs")


# -- motions ----------------------------------------------------------------------------------------------------

def test_a_plan_is_executed(twins, panel_of, planned):
    panel = panel_of(twins)
    panel.plan()
    kind, query, execute, done = panel.client.sent.pop()
    assert (kind, query, execute) == ("plan", panel.query, False) and panel.view.lines == ["planning ..."]
    with pytest.raises(InteractionError, match="still planning; stop that first"):
        panel.plan()
    done(planned(0.0, 1.5))
    assert panel.view.lines == ["planned: 1.50 s long, found in 0.012 s"]
    panel.execute()
    _, trajectory, done = panel.client.sent.pop()
    assert trajectory.joint_trajectory.points[-1].time_from_start.to_sec() == 1.5
    done(ActionOutcome(True, "SUCCESS"))
    assert panel.view.lines == ["executed"] and panel.view.seen[-1] == "no path"
    with pytest.raises(InteractionError, match="there is no plan"):
        panel.execute()


def test_the_reason_of_a_failure_is_said(twins, panel_of):
    panel = panel_of(twins)
    panel.plan_and_execute()
    assert panel.client.sent[-1][2] is True
    panel.client.sent.pop()[3](ActionOutcome(False, "GOAL_IN_COLLISION: left_hand and crate"))
    assert panel.view.lines == ["not executed: GOAL_IN_COLLISION: left_hand and crate"]
    panel.plan()
    panel.client.sent.pop()[3](ActionOutcome(False, "TIMED_OUT"))
    assert panel.view.lines == ["no plan: TIMED_OUT"] and panel.trajectory is None


def test_what_ends_after_a_stop_is_no_news(twins, panel_of, planned):
    panel = panel_of(twins)
    panel.plan()
    done = panel.client.sent.pop()[3]
    panel.stop()
    assert panel.client.stopped == 1 and panel.view.lines == ["stopped"]
    done(planned(0.0, 1.0))
    assert panel.view.lines == ["stopped"] and panel.trajectory is None
    panel.plan()
    assert panel.client.sent


def test_a_missing_move_group_does_not_leave_the_panel_busy(twins, panel_of):
    panel = panel_of(twins)
    panel.client.missing = True
    for _ in range(2):
        with pytest.raises(NoAnswer):
            panel.plan()


# -- settings and scene -----------------------------------------------------------------------------------------

def test_the_menu_says_what_is_set(twins, panel_of):
    panel = panel_of(twins)
    assert {"[x] left_arm", "[x] move_group's choice", "[x] 50 %"} <= chosen(panel)
    assert command(panel, "Goal", "out") == ("named", "goal", "out")
    assert command(panel, "Planner", "pilz", "PTP") == ("planner", "pilz", "PTP")
    panel.planner("pilz", "PTP")
    panel.speed(0.25)
    panel.toggle("avoid")
    panel.toggle("path")
    assert {"[x] PTP", "[x] 25 %", "[x] Keep clear while dragging"} <= chosen(panel)
    assert "[x] Show the planned path" not in chosen(panel) and panel.view.seen[-1] == ("path", False)
    assert (panel.query.pipeline, panel.query.planner, panel.query.speed) == ("pilz", "PTP", 0.25)
    panel.drag("goal", panel.handles[0], interaction.pose_of(twins, panel.query.goal, "left_tip"))
    assert panel.client.asked[-1][2] is True


def test_every_command_of_the_menu_is_one_of_the_panels(twins, panel_of):
    panel = panel_of(twins)
    panel.add_box(panel.handles[0], 0.1)
    panel.add_box(panel.handles[0], 0.1)
    panel.attach(panel.handles[0], "box_2")
    for entry in panel.view.entries:
        if entry.command:
            assert hasattr(panel, "select_group" if entry.command[0] == "group" else entry.command[0]), entry
    assert len({entry.number for entry in panel.view.entries}) == len(panel.view.entries)
    assert all(entry.parent < entry.number for entry in panel.view.entries)


def test_boxes_come_go_and_are_held(twins, panel_of):
    panel = panel_of(twins)
    panel.named("goal", "out")
    panel.add_box(panel.handles[0], 0.1)
    name, size, pose = panel.client.asked[-1]
    assert (name, size) == ("box_1", 0.1)
    tip = twins.frame_of(panel.query.goal.q, "left_tip")
    np.testing.assert_allclose(pose, moved(tip, *0.051 * tip[:3, 0]))
    assert command(panel, "Scene", "Attach", "box_1") == ("attach", "box_1")
    panel.attach(panel.handles[0], "box_1")
    assert panel.client.attached[0].touch_links == ["left_finger", "left_hand", "left_tip"]
    panel.add_box(panel.handles[0], 0.1)
    assert [one.id for one in panel.client.objects] == ["box_2"], "a name is given twice"
    assert len(panel.view.ghosts["goal"][2]) == 1
    panel.detach("box_1")
    panel.remove("box_2")
    assert command(panel, "Scene", "Remove", "box_1") == ("remove", "box_1")
