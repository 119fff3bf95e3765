# SPDX-License-Identifier: BSD-3-Clause
"""Which controllers move which joints, and when a trajectory may start."""
import math

import pytest

from moveit_ros_move_group.controllers import (
    NoControllers,
    allowed_duration,
    choose,
    read_list,
    start_deviation,
)


def entry(name, joints, **others):
    return {"name": name, "action_ns": "follow_joint_trajectory", "type": "FollowJointTrajectory", "joints": joints,
            **others}


ARMS = [entry("/left", ["l0", "l1"], default=True), entry("/right", ["r0", "r1"], default=True),
        entry("/both", ["l0", "l1", "r0", "r1"])]


def names(controllers):
    return sorted(controller.name for controller in controllers)


def test_entries_become_controllers():
    controllers, complaints = read_list([entry("", ["a"], default=True), entry("x/y", ["b"], goal_time_tolerance=1.0)])
    assert [controller.action for controller in controllers] == ["follow_joint_trajectory",
                                                                "x/y/follow_joint_trajectory"]
    assert controllers[0].default and not controllers[1].default and not complaints
    assert controllers[1].options == {"goal_time_tolerance": 1.0}


@pytest.mark.parametrize("wrong, sentence", [
    ({"name": "a", "type": "FollowJointTrajectory", "joints": []}, "no action_ns"),
    ({"name": "a", "action_ns": "b", "type": "Warp", "joints": []}, "of type 'Warp'"),
    ({"name": "a", "action_ns": "b", "type": "FollowJointTrajectory", "joints": "j"}, "expected a list of names"),
    ("a", "no name, action_ns, type, joints"),
])
def test_wrong_entries_are_named_and_left_out(wrong, sentence):
    controllers, complaints = read_list([wrong, entry("good", ["j"])])
    assert names(controllers) == ["good"] and sentence in complaints[0]


def test_a_list_that_is_none_is_named():
    assert "expected a list" in read_list("controllers")[1][0]
    assert read_list(None)[0] == []


def test_fake_controllers_need_no_action():
    entries = [{"name": "f", "joints": ["a"]}, {"name": "g", "joints": ["b"], "type": "warp"}]
    controllers, complaints = read_list(entries, fake=True)
    assert [controller.options["type"] for controller in controllers] == ["interpolate", "interpolate"]
    assert "of type 'warp'" in complaints[0]


def test_the_fewest_controllers_are_chosen():
    controllers, _ = read_list(ARMS)
    assert names(choose(controllers, ["l0", "l1"])) == ["/left"]
    assert names(choose(controllers, ["l0", "r0"])) == ["/both"]
    assert names(choose(controllers, ["l0", "r0"], alive=lambda one: one.name != "/both")) == ["/left", "/right"]


def test_default_wins_among_equals():
    controllers, _ = read_list([entry("a", ["j"]), entry("b", ["j"], default=True)])
    assert names(choose(controllers, ["j"])) == ["b"]


def test_joints_without_a_controller_are_named():
    controllers, _ = read_list(ARMS)
    with pytest.raises(NoControllers) as refused:
        choose(controllers, ["l0", "head"])
    assert "Unable to identify any set of controllers" in str(refused.value)
    assert "No controller moves head" in str(refused.value) and "/left" in str(refused.value)
    with pytest.raises(NoControllers, match="controller_list is empty"):
        choose([], ["l0"])


def test_no_joints_need_no_controller():
    assert choose([], []) == []


def test_many_controllers_are_combined_too():
    controllers, _ = read_list([entry("c%d" % i, ["j%d" % i]) for i in range(30)])
    assert len(choose(controllers, ["j%d" % i for i in range(30)])) == 30


def test_starts_that_are_off_are_named():
    current = {"a": 0.0, "b": 1.0, "turn": 3.1}
    assert start_deviation(["a", "b"], [0.005, 1.0], current, 0.01) is None
    assert start_deviation(["a", "b"], [0.05, 1.2], current, 0.01) == ("b", pytest.approx(0.2))
    assert start_deviation(["a"], [5.0], current, 0.0) is None
    assert start_deviation(["a", "b"], [0.05, 1.2], current, {"a": 0.01}) == ("a", pytest.approx(0.05))
    assert start_deviation(["c"], [0.0], current, 0.01) == ("c", math.inf)
    assert start_deviation(["turn"], [-3.18], current, 0.01, {"turn"}) is None


def test_the_most_generous_controller_sets_the_time():
    controllers, _ = read_list([entry("a", ["j"]), entry("b", ["k"], allowed_execution_duration_scaling=2.0,
                                                         allowed_goal_duration_margin=1.0)])
    assert allowed_duration(10.0, controllers[:1], 1.1, 0.5) == pytest.approx(11.5)
    assert allowed_duration(10.0, controllers, 1.1, 0.5) == pytest.approx(21.0)
