# SPDX-License-Identifier: BSD-3-Clause
"""Diagnosis of a recorded run, without a robot: the first fault that explains the others; points and reports."""
import dataclasses
import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from baxter_model import joint_names
from rf_checks import diagnosis, report
from rf_checks.exercises import EXERCISES, UnknownExercise, choose, meant_instead
from rf_checks.judge import Result, RunResult, how_it_ended
from rf_checks.lab import WhichRobot
from rf_checks.recording import Criterion, GraphChanges, ProgramRun, RunFault, RunRecording
from rf_checks.tasks_printed import IkFrame, matrices

JOINTS = (*joint_names("left"), *joint_names("right"))
TRACEBACK = ('Traceback (most recent call last):\n  File "/x/me.py", line 12, in <module>\n    f()\n'
             'NameError: name "f"')
ROTATE = next(exercise for exercise in EXERCISES if exercise.name == "rotate_gripper")


def records(seconds=2.0, left=0.0, right=0.0, enabled=True, commands=0, names=JOINTS[:1], values=(0.1,), exited=None,
            placed=0):
    """A trace: `left`, `right`: motion of those arms' first joints [rad]; `commands`: number per record, left;
    `placed`: how often a service moved the joints. Moving arms follow a recorded command."""
    count = round(seconds / 0.01)
    result = []
    for k in range(count):
        q = np.zeros(14)
        q[0], q[7] = left * k / count, right * k / count
        result.append({"t": 0.01 * k, "q": q.tolist(), "enabled": enabled, "contacts": [], "held": {}, "ik": [],
                       "commands": [["left", 1, list(names), list(values), "/me", True]] if commands else [],
                       "counts": {"left": commands * k, "right": 0}, "placed": placed if k else 0,
                       "accepted": {"left": k if left else 0, "right": k if right else 0}})
    if exited is not None:
        result[-1]["exited"] = exited
    return RunRecording(JOINTS, result)


def pushed():
    """A trace in which an arm moves without a command."""
    trace = records(left=0.4)
    for record in trace.records:
        record["accepted"] = {"left": 0, "right": 0}
    return trace


def run(recording, **fields):
    return ProgramRun([], recording, program="me.py", **{"exit_code": 0, **fields})


@pytest.mark.parametrize(("case", "key", "words"), [
    (run(records(), ended="simulator gone"), "killed_simulator", ["rosnode kill"]),
    (run(records(), ended="paused"), "paused", ["pause_physics"]),
    (run(records(), changes=GraphChanges(missing_nodes=["/rosout"])), "killed_nodes", ["/rosout"]),
    (run(records(), changes=GraphChanges(intruders={"/clock": ["/me"]})), "intruder", ["/me", "/clock"]),
    (run(records(), changes=GraphChanges(withdrawn=["/IKService"])), "withdrawn", ["/IKService"]),
    (run(records(), changes=GraphChanges(parameters=["/a", "/b", "/c", "/d"])), "parameters",
     ["/a, /b, /c and 1 more"]),
    (run(records(seconds=0.05, left=3.0)), "teleport", ["set_model_configuration"]),
    (run(records(left=0.4, placed=60)), "teleport", ["set_model_configuration"]),
    (run(pushed()), "moved_otherwise", ["0.40 rad", "joint command"]),
])
def test_meddling_is_told(case, key, words):
    fault = diagnosis.meddling(case)
    assert fault.key == key
    assert fault.cap == 0.0
    assert all(word in fault.sentence for word in words)


def test_an_honest_run_meddles_with_nothing():
    assert diagnosis.meddling(run(records(left=1.0))) is None


def test_a_recording_knows_who_commanded_the_arms():
    recording = records(left=1.0, commands=1)
    assert recording.commanders() == [("/me", "left", 1)]
    assert recording.commands()[0] == ("left", 1, [JOINTS[0]], [0.1])
    assert (recording.accepted_count("left"), recording.accepted_count("right")) == (199, 0)
    for record in recording.records:
        record["commands"][0][5] = False  # refused
    assert recording.commanders() == []


@pytest.mark.parametrize(("case", "key", "words"), [
    (run(records(), ended="output"), "output", ["megabytes"]),
    (run(records(), ended="processes"), "processes", []),
    (run(records(), ended="threads"), "threads", []),
    (run(records(), ended="sockets"), "sockets", ["once, before the loop"]),
    (run(records(), ended="files"), "files", ["more files"]),
    (run(records(), ended="requests"), "requests", ["IK service"]),
    (run(records(), ended="memory"), "memory", ["2 GB"]),
    (run(records(left=1.0, commands=20)), "flood", ["rospy.Rate"]),
    (run(records(), ended="busy", stuck_at=9, exit_code=None), "busy", ["line 9"]),
    (run(records(), exit_code=1, errors=TRACEBACK), "crashed", ["line 12", "NameError"]),
    (run(records(enabled=False, commands=1)), "not_enabled", ["RobotEnable"]),
    (run(records(right=1.0)), "wrong_arm", ["right arm moved", "left arm"]),
    (run(records(left=1.0, commands=1, values=(57.0,))), "degrees", ["57.0"]),
    (run(records(left=1.0, commands=1, names=("left_s0", "left_s0"), values=(0.1, 0.1))), "repeated_names",
     ["left_s0"]),
    (run(records()), "early_exit", ["before any arm moved"]),
    (run(records(left=1.0), ended="sim time", exit_code=None), "no_end", ["45 s"]),
    (run(records(left=1.0), exit_code=3, errors="no angles"), "exit_status", ["3", "no angles"]),
])
def test_behaviour_is_told(case, key, words):
    fault = diagnosis.behaviour(case, ("left",), 45.0)
    assert fault.key == key
    assert all(word in fault.sentence for word in words), fault.sentence


def test_nothing_is_wrong_with_what_is_right():
    case = run(records(left=1.0, commands=1))
    assert diagnosis.behaviour(case, ("left",), 45.0) is None
    # Ten messages a record are 1000 a second, which is not more than that.
    assert not diagnosis.is_flood(records(commands=10).command_counts())


def test_an_arm_that_collision_avoidance_held_is_told():
    def held_in(rows, seconds=2.0, left=0.0):
        trace = records(seconds, left)
        for row in rows:
            trace.records[row]["held"] = {"left": ["collision_head_link_1"], "right": []}
        return run(trace)
    fault = diagnosis.held_back(held_in(range(100, 150)), ("left",))
    assert fault.key == "held" and "left arm at 1.5 s" in fault.sentence and "tuck_arms.py -u" in fault.sentence
    assert "too near to collision_head_link_1" in fault.sentence
    assert diagnosis.held_back(held_in([]), ("left",)) is None
    assert diagnosis.held_back(held_in([100]), ("right",)) is None
    assert diagnosis.held_back(held_in(range(10, 20), left=1.0), ("left",)) is None, "it got away"


def test_an_arm_left_on_its_way_is_told():
    early = run(records(left=1.0, commands=1, exited=0.5))
    assert diagnosis.left_on_its_way(early, ("left",)).key == "early_exit"
    single = records(exited=1.99)
    for record in single.records[100:]:
        record["counts"] = {"left": 1, "right": 0}
    assert "1 joint command " in diagnosis.left_on_its_way(run(single), ("left",)).sentence
    assert diagnosis.left_on_its_way(run(records(left=1.0, commands=1, exited=1.99)), ("left",)) is None


@pytest.mark.parametrize(("text", "words"), [
    ("import rospy\nprint 'hello'\n", ["line 2", "Python 2"]),
    ("try:\n    pass\nexcept OSError, e:\n    pass\n", ["line 3", "except Error as e"]),
    ("def f(:\n", ["line 1"]),
    ("x = '\0'", ["Python"]),
    ("# für Anna\n".encode("latin-1"), ["UTF-8", "editor"]),
    ("import rospy\n\n\nname = 'für'\n".encode("latin-1"), ["UTF-8", "editor"]),
    ("print(1)\n".encode("utf-16"), ["UTF-8", "editor"]),
    ("# coding: nothing\nprint(1)\n", ["`nothing`", "UTF-8"]),
    ("# -*- coding: undefined -*-\nprint(1)\n", ["`undefined`", "UTF-8"]),
    ("#!/usr/bin/python3\n# coding: rot13\nprint(1)\n", ["`rot13`", "UTF-8"]),
    ("x = " + "-" * 100_000 + "1", ["nested too deeply"]),
    ("x" + "()" * 100_000, ["nested too deeply"]),
])
def test_what_python_cannot_read_is_told(text, words):
    fault = diagnosis.check_syntax(text if isinstance(text, bytes) else text.encode(), "me.py")
    assert fault.key == "syntax"
    assert all(word in fault.sentence for word in words), fault.sentence


@pytest.mark.parametrize("source", [
    "# für Anna\r\nprint(1)\r\n".encode("utf-8-sig"), "# coding: latin-1\nprint('ü')\n".encode("latin-1")])
def test_files_as_editors_on_windows_save_them_are_read(source):
    assert diagnosis.check_syntax(source, "me.py") is None


@pytest.mark.parametrize("source", [b"", b"\n\n", b"# exercise: wave\n"])
def test_an_empty_file_is_told(source):
    fault = diagnosis.check_syntax(source, "me.py")
    assert (fault.key, fault.cap) == ("empty", 0.0) and "empty" in fault.sentence
    # The report sets the full stop.
    assert fault.sentence[-1].isalnum()


def test_the_sheets_quaternion_that_is_a_message_is_told():
    errors = TRACEBACK.replace('NameError: name "f"', "TypeError: 'Quaternion' object is not subscriptable")
    fault = diagnosis.crashed(run(records(), exit_code=1, errors=errors))
    assert "line 12" in fault.sentence and "[quat.x, quat.y, quat.z, quat.w]" in fault.sentence


def test_the_sheets_return_at_the_margin_is_told():
    fault = diagnosis.check_syntax(b"def generate_posemsg():\n    a = 1\nreturn a\n", "me.py")
    assert fault.key == "syntax"
    assert "line 3" in fault.sentence and "generate_posemsg" in fault.sentence


def test_the_line_of_the_program_is_found():
    assert diagnosis.line_of("me.py", TRACEBACK) == 12


@pytest.mark.parametrize(("inner", "expected"), [(1, 4), (2, 4), (6, 4), (7, 4)])
def test_the_loop_that_a_program_is_in_is_named_wherever_it_is_caught(tmp_path, inner, expected):
    program = tmp_path / "me.py"
    program.write_text("def f():\n    return 1\n\nwhile True:\n    for _ in range(9):\n        f()\n        f()\n")
    dump = ('Thread 0x1 (most recent call first):\n  File "/usr/lib/python3/threading.py", line 30 in wait\n\n'
            'Current thread 0x2 (most recent call first):\n  File "/usr/lib/x.py", line 1 in g\n'
            '  File "%s", line %d in f\n  File "%s", line 6 in <module>\n' % (program, inner, program))
    assert diagnosis.line_of_dump(program, dump) == expected
    assert diagnosis.line_of_dump(tmp_path / "other.py", dump) is None


def test_a_program_that_hangs_outside_of_a_loop_is_told_by_its_line(tmp_path):
    (tmp_path / "me.py").write_text("import signal\n\nsignal.pause()\n")
    dump = 'Current thread 0x2 (most recent call first):\n  File "/x/me.py", line 3 in <module>\n'
    assert diagnosis.line_of_dump(tmp_path / "me.py", dump) == 3


MATRIX = np.array([[0.0, -1.0, 0.0, 0.64], [1.0, 0.0, 0.0, -0.83], [0.0, 0.0, 1.0, 1e-3], [0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize("text", [
    str(MATRIX), repr(MATRIX), str(MATRIX.tolist()), "H =\n%s\ndone" % MATRIX,
    "[INFO] [17.5, 3.2]: Homogenous matrix: \n" + str(MATRIX), "[INFO] [17.5, 3.2]: " + str(MATRIX),
    "\n".join(" ".join(map(str, row)) for row in MATRIX), "Matrix(%s)" % MATRIX.tolist(),
], ids=["str", "repr", "list", "text around", "logged", "logged on the line", "plain", "sympy"])
def test_matrices_are_read_however_they_are_printed(text):
    found = matrices(text)
    assert len(found) == 1
    assert np.allclose(found[0], MATRIX)


@pytest.mark.parametrize("text", ["", "1 2 3", str(MATRIX[:3]), "[[nan 1", "seq: 4\nstamp: 1 2 3 4\n" * 5])
def test_what_is_no_matrix_is_none(text):
    assert matrices(text) == []


def test_answers_are_read():
    assert IkFrame.answers("x\nReference frame: /base\ncommanded frame = left_gripper\n") == ("base", "left_gripper")
    assert IkFrame.answers("nothing") == ("", "")


@pytest.mark.parametrize(("name", "file_name", "text", "expected"), [
    ("", "tf_listener.py", "", "tf_listener"), ("", "my_wave.py", "", "wave"), ("wave", "x.py", "", "wave"),
    ("", "x.py", "# exercise: ik_frame\n", "ik_frame"), ("wave", "tf_listener.py", "# exercise: ik_frame", "wave"),
    ("", "rotate_gripper_2.py", "", "rotate_gripper"), ("", "my_node.py", "y = 0.1 * math.sin(t)", "wave"),
    ("", "my_node.py", "buffer.lookup_transform(a, b)", "tf_listener"),
    ("", "my_node.py", "from baxter_kinematics_msgs.msg import IKReport\nlookup_transform", "unreachable"),
])
def test_the_exercise_is_found(name, file_name, text, expected):
    assert choose("lab2", name, file_name, text).name == expected


@pytest.mark.parametrize(("lab", "name", "file_name", "words"), [
    ("lab9", "", "x.py", ["lab9", "lab2", "cwru"]), ("wvae", "", "x.py", ["did you mean lab2 wave?"]),
    ("lab2", "", "my_node.py", ["./baxter.sh check lab2 wave my_node.py"]),
    ("lab2", "waves", "x.py", ["waves", "wave"]),
    ("cwru", "wave", "x.py", ["./baxter.sh check lab2 wave x.py"]), ("lab2", "", "wave_tf.py", ["which exercise"]),
])
def test_an_unknown_exercise_says_what_to_type(lab, name, file_name, words):
    with pytest.raises(UnknownExercise) as error:
        choose(lab, name, file_name, "")
    assert all(word in str(error.value) for word in words)


@pytest.mark.parametrize(("file_name", "text", "other"), [
    ("my.py", "# exercise: wave\n", "wave"), ("rotate_gripper.py", "# exercise: wave\n", "wave"),
    ("li_joint_command.py", "", "joint_command"), ("rotate_gripper.py", "", None), ("my.py", "math.sin(1)", None),
    ("wave.py", "# exercise: rotate_gripper\n", None),
])
def test_a_program_for_another_exercise_is_told_so(file_name, text, other):
    found = meant_instead(ROTATE, file_name, text)
    assert (found.name if found else None) == other
    if found:
        fault = diagnosis.of_another(RunFault("not_enabled", "it was not enabled", 0.9), ROTATE, found, file_name)
        assert "./baxter.sh check %s %s %s" % (found.lab, other, file_name) in fault.sentence and fault.cap == 0.9


def result(share, fault=None, which=WhichRobot()):  # noqa: B008 (a tuple)
    criteria = (Criterion("position", share, 60.0, "0.1 cm off"), Criterion("time", share, 40.0, "1 s <&> \x1b"))
    runs = (RunResult(("z", "90"), criteria, fault), RunResult(("x", "90"), criteria, None))
    return Result(ROTATE, "/x/me.py", 3, runs, "session", 1.5, which=which)


def test_points_are_the_mean_of_the_runs_and_a_fault_caps_them():
    assert result(1.0).points == pytest.approx(100.0)
    assert result(0.5).points == pytest.approx(50.0)
    assert result(1.0, RunFault("flood", "too fast", 0.4)).points == pytest.approx(70.0)


def test_reports_say_the_same_in_three_ways():
    bad = result(1.0, RunFault("flood", "too fast", 0.4))
    text = report.text(bad)
    assert "not passed: 70 of 100" in text
    assert text.splitlines()[-1] == "Hint: too fast."
    # Under the name that the student gave it.
    assert "  me.py z 90" in text.splitlines()
    data = json.loads(report.as_json(bad))
    assert (data["points"], data["passed"], data["fault"], data["hint"]) == (70.0, False, "flood", "too fast")
    suite = ElementTree.fromstring(report.as_junit(bad))
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert "too fast" in suite.find("testcase/failure").get("message")
    assert ElementTree.fromstring(report.as_junit(result(1.0))).get("failures") == "0"


def test_reports_name_a_robot_that_is_not_the_usual_one():
    assert "profile" not in report.text(result(1.0))
    assert json.loads(report.as_json(result(1.0)))["profile"] == "sim"
    on_a_robot = result(1.0, which=WhichRobot("robot", 3))
    assert "profile robot, serial 3, seed 3" in report.text(on_a_robot)
    data = json.loads(report.as_json(on_a_robot))
    assert (data["profile"], data["serial"]) == ("robot", 3)


@pytest.mark.parametrize(("fields", "how", "code", "number"), [
    ({"ended": "exited", "exit_code": 0}, "finished", 0, None),
    ({"ended": "exited", "exit_code": 3}, "exit code 3", 3, None),
    ({"ended": "exited", "exit_code": -11}, "killed by signal 11", None, 11),
    ({"ended": "exited", "exit_code": -9, "cpu_s": 119.9}, "cpu limit of 120 s", None, 9),
    ({"ended": "sim time", "exit_code": None}, "simulated time limit", None, None),
    ({"ended": "busy", "exit_code": None}, "computed without end", None, None),
])
def test_the_report_says_how_a_run_ended(fields, how, code, number):
    end = how_it_ended(run(records(seconds=2.0), wall_s=4.0, **fields))
    assert (end["how"], end["exit_code"], end["signal"]) == (how, code, number)
    assert (end["simulated_s"], end["real_time_factor"]) == (2.0, 0.5)


def test_what_is_not_graded_loses_no_points_and_blames_nobody():
    fault = RunFault("flood", "too fast", 0.4)
    slow = dataclasses.replace(result(1.0, fault), not_graded="the machine reached 0.2 of real time")
    assert slow.points is None
    text = report.text(slow)
    assert "not graded: the machine reached 0.2 of real time" in text
    assert "Hint" not in text
    assert "not passed" not in text
    data = json.loads(report.as_json(slow))
    assert (data["graded"], data["points"], data["passed"]) == (False, None, False)
    assert (data["fault"], data["hint"]) == (None, None)
    assert data["not_graded"] == "the machine reached 0.2 of real time"
    suite = ElementTree.fromstring(report.as_junit(slow))
    assert suite.get("errors") == "1"
    assert "0.2 of real time" in suite.find("testcase/error").get("message")


def test_the_core_loads_without_ros():
    block = ("import sys; sys.modules.update(dict.fromkeys(('rospy', 'rosgraph', 'tf2_ros', 'baxter_core_msgs', "
             "'geometry_msgs', 'gazebo_ros')))\nfrom rf_checks import diagnosis, exercises, measures, mistakes, "
             "observing, pacing, report, robot, run_clock, sandbox")
    subprocess.run([sys.executable, "-c", block], check=True)
