# SPDX-License-Identifier: BSD-3-Clause
"""The command language, and conversions."""
import math
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from geometry_msgs.msg import Pose
from moveit_msgs.msg import (
    ExecuteTrajectoryResult,
    MoveGroupResult,
    MoveItErrorCodes,
    PickupResult,
    PlaceResult,
    RobotState,
)
from sensor_msgs.msg import JointState

from moveit_commander import (
    MoveGroupCommandInterpreter,
    MoveGroupInfoLevel,
    MoveItCommanderException,
    PlanningSceneInterface,
    RobotCommander,
    conversions,
)


@pytest.fixture
def shell(connection, success):
    connection.results.update({"move_group": (MoveGroupResult(error_code=success), ""),
                               "execute_trajectory": (ExecuteTrajectoryResult(error_code=success), ""),
                               "pickup": (PickupResult(error_code=success), ""),
                               "place": (PlaceResult(error_code=MoveItErrorCodes(99999)), "")})
    connection.answers["apply_planning_scene"] = SimpleNamespace(success=True)
    return MoveGroupCommandInterpreter(RobotCommander(), PlanningSceneInterface())


def run(shell, *commands):
    for command in commands:
        level, answer = shell.execute(command)
        assert level != MoveGroupInfoLevel.FAIL, "%s: %s" % (command, answer)
    return answer


def goal_of(connection):
    constraints, = connection.sent[-1][1].request.goal_constraints
    return [one.position for one in constraints.joint_constraints]


def test_a_group_has_to_be_used_first(shell):
    assert shell.get_active_group() is None
    assert shell.execute("go ready") == (MoveGroupInfoLevel.FAIL, "no group in use; use one of arm, hand, all")
    assert run(shell, "use arm", "which") == "arm"
    assert run(shell, "use hand", "use arm", "groups") == "arm\nhand"
    assert run(shell, "use previous", "id") == "hand" and run(shell, "use previous", "id") == "arm"
    assert shell.get_loaded_groups() == ["arm", "hand"] and shell.get_active_group().get_name() == "arm"


def test_going(shell, connection):
    run(shell, "use arm", "go ready")
    assert goal_of(connection) == [0.5, 1.0]
    run(shell, "go rand")
    assert len(goal_of(connection)) == 2
    for direction, axis, sign in (("up", "z", 1), ("down", "z", -1), ("left", "y", 1), ("right", "y", -1),
                                  ("forward", "x", 1), ("backward", "x", -1), ("back", "x", -1), ("x", "x", 1),
                                  ("y", "y", 1), ("z", "z", 1)):
        before = shell.get_active_group().get_current_pose().pose.position
        run(shell, "go %s 0.05" % direction)
        place = connection.sent[-1][1].request.goal_constraints[0].position_constraints[0]
        there = place.constraint_region.primitive_poses[0].position
        assert getattr(there, axis) - getattr(before, axis) == pytest.approx(0.05 * sign)
    run(shell, "rotate 0 0 1.5")
    assert connection.sent[-1][1].request.goal_constraints[0].orientation_constraints


def test_going_to_a_pose(shell, connection, success):
    run(shell, "use arm", "go 0.1 0.2 0.3 0 0 1.5")
    place, = connection.sent[-1][1].request.goal_constraints[0].position_constraints
    there = place.constraint_region.primitive_poses[0].position
    assert (place.link_name, there.x, there.y, there.z) == ("tool", 0.1, 0.2, 0.3)
    connection.answers["compute_ik"] = SimpleNamespace(error_code=success, solution=RobotState(
        joint_state=JointState(name=["elbow", "shoulder"], position=[0.6, 0.2])))
    run(shell, "go 0.1 0.2 0.3 0 0 1.5 approx")
    assert goal_of(connection) == [0.2, 0.6]


def test_planning_and_executing(shell, connection):
    run(shell, "use arm", "plan ready", "execute")
    assert [name for name, _ in connection.sent] == ["move_group", "execute_trajectory"]
    assert run(shell, "plan") == "no plan" and "joint_trajectory" in run(shell, "plan ready", "plan")
    run(shell, "execute")
    assert shell.execute("execute")[1].startswith("there is no plan")
    connection.results["move_group"] = MoveGroupResult(error_code=MoveItErrorCodes(-1)), "in the way"
    assert shell.execute("plan ready") == (MoveGroupInfoLevel.FAIL, "no plan")
    assert shell.execute("go ready")[0] == MoveGroupInfoLevel.FAIL


def test_values_under_names(shell, connection):
    run(shell, "use arm", "record here", "a = here", "a[0] = 0.25", "b = [0.1, 1.5]", "c = b", "go a")
    assert goal_of(connection) == [0.25, 1.0]
    assert run(shell, "show b") == "b = [0.1 1.5]" and run(shell, "show c") == "c = [0.1 1.5]"
    assert run(shell, "vars") == "ready\nhere\na\nb\nc" and run(shell, "b") == "[0.1 1.5]"
    assert run(shell, "rand d", "del d", "rec e", "del e", "vars") == "ready\nhere\na\nb\nc"
    run(shell, "delete c")
    assert "c" not in run(shell, "vars").split()
    for command in ("a[7] = 1", "d = [1]", "delete c", "d = gone", "go gone", "a[0] = much"):
        assert shell.execute(command)[0] == MoveGroupInfoLevel.FAIL, command


def test_a_state_for_the_srdf(shell):
    state = ElementTree.fromstring(run(shell, "use hand", "group_state"))
    assert (state.tag, state.get("group")) == ("group_state", "hand")
    values = {joint.get("name"): float(joint.get("value")) for joint in state}
    assert values == pytest.approx({"grip": 0.02, "oppose": 0.05})


def test_saving_and_loading(shell, tmp_path, monkeypatch):
    file = tmp_path / "states"
    run(shell, "use arm", "b = [0.1, 1.5]", "save %s" % file, "delete b", "load %s" % file)
    assert run(shell, "show b") == "b = [0.1 1.5]"
    monkeypatch.chdir(tmp_path)
    Path("cmd").mkdir()
    Path("cmd/moves").write_text("f = [0.3 1.2]  # values\n")
    assert run(shell, "load moves", "f") == "[0.3 1.2]"
    file.write_text("use arm\nfly\n")
    assert shell.execute("load %s" % file) == (
        MoveGroupInfoLevel.FAIL, "using group arm\nunknown command 'fly'; help lists them")
    assert shell.execute("load %s" % (tmp_path / "gone"))[0] == MoveGroupInfoLevel.FAIL


def test_settings_and_questions(shell):
    assert run(shell, "use arm", "tolerance 0.01") == "joints, position, orientation: [0.01 0.01 0.01]"
    assert run(shell, "time 2.5", "time") == "2.5 s"
    assert run(shell, "planner RRT", "eef") == "tool"
    assert run(shell, "joints") == "0 = shoulder\n1 = elbow"
    assert "joints = [0 1]" in run(shell, "current")
    for what, word in (("replanning", "replanning"), ("replan", "replanning"), ("look", "looking")):
        assert run(shell, "allow %s T" % what) == "%s is allowed" % word
    assert run(shell, "host").startswith("the master is http") and run(shell, "tol 0.01") == run(shell, "tolerance")
    assert run(shell, "constrain", "trace on", "wait 0", "stop", "database", "ground", "# nothing", "") == ""
    assert run(shell, "pick can") == "picked can up"
    assert shell.execute("place can") == (MoveGroupInfoLevel.FAIL, "did not place can (99999)")
    for command in ("allow cake true", "time soon", "wait", "rotate 1", "trace maybe", "use leg", "constrain upright"):
        assert shell.execute(command)[0] == MoveGroupInfoLevel.FAIL, command


def test_every_command_is_in_the_help(shell):
    words = set(shell.get_help().replace(",", " ").replace("|", " ").split())
    assert set(shell.get_keywords()) <= words
    run(shell, "use arm")
    assert "ready" in shell.get_keywords()["go"] and "up" in shell.get_keywords()["go"]


def test_messages_as_bytes_and_back():
    state, copy = RobotState(is_diff=True), RobotState()
    conversions.msg_from_string(copy, conversions.msg_to_string(state))
    assert copy == state


def test_messages_as_lists_and_back():
    values = [0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0]
    assert conversions.pose_to_list(conversions.list_to_pose(values)) == values
    assert conversions.transform_to_list(conversions.list_to_transform(values)) == values
    turned = conversions.pose_to_list(conversions.list_to_pose([0, 0, 0, 0, 0, math.pi / 2]))
    assert turned[3:] == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    stamped = conversions.list_to_pose_stamped(values, "base")
    assert stamped.header.frame_id == "base" and stamped.pose.position.x == 0.1
    assert conversions.matrix_of(Pose())[0, 0] == 1.0
    for wrong in ([], [1.0], [0.0] * 8):
        with pytest.raises(MoveItCommanderException, match="got %d value" % len(wrong)):
            conversions.list_to_pose(wrong)
