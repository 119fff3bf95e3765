# SPDX-License-Identifier: BSD-3-Clause
"""Diagnosis of a program from one run: the first fault that explains the others. Free of ROS."""
from __future__ import annotations

import ast
import io
import re
import tokenize
from typing import TYPE_CHECKING

import numpy as np

from baxter_model import SIDES
from baxter_model.readiness import UNFOLD
from command_line.options import counted
from rf_checks import mistakes
from rf_checks.measures import JUMP_RAD, has_moved, largest_jump, moving_rows, path_length
from rf_checks.recording import RECORD_S, RunFault

if TYPE_CHECKING:
    from pathlib import Path

    from rf_checks.exercises import Exercise
    from rf_checks.recording import ProgramRun
    from rf_checks.robot import JudgedRobot
    from rf_checks.tasks import ProgramCall

#: More joint commands than this in FLOOD_WINDOW_S [sim s] are a flood; the robot's own limit is some 800 a second.
FLOOD_COMMANDS = 1000
FLOOD_WINDOW_S = 1.0
# An arm that moves within this time before the end of a recording was still moving at the end [s].
_ON_ITS_WAY_S = 0.15

PYTHON2 = ("print statement", "Missing parentheses in call to 'print'",
           "multiple exception types must be parenthesized")
_THREAD = re.compile(r"^(?:Current thread|Thread) 0x", re.MULTILINE)
#: A resting arm moves by less than this during a run [rad].
STRAY_RAD = 0.05
_CODING = re.compile(rb"^[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)", re.MULTILINE | re.ASCII)
_FRAME = re.compile(r'File "([^"]+)", line (\d+)')
# What a program is stopped for, besides floods: how its run ended, and the RunFault, which has that key.
_EXCESSES = {fault.key: fault for fault in (
    RunFault("output",
             "the program printed megabytes and was stopped; print what is asked for, and not in a loop without "
             "a pause", 0.4),
    RunFault("processes", "the program started more and more processes and was stopped", 0.0),
    RunFault("threads", "the program started more and more threads and was stopped", 0.0),
    RunFault("sockets",
             "the program opened more and more connections and was stopped: make publishers, subscribers and "
             "service proxies once, before the loop", 0.0),
    RunFault("files", "the program made more and more files and was stopped", 0.0),
    RunFault("requests",
             "the program asked the lab's nodes, as the IK service, for more than a minute of computing and "
             "was stopped: ask for the poses that are needed, each once", 0.0),
    RunFault("memory", "the program took more than 2 GB of memory and was stopped: perhaps a list grows for ever",
             0.0))}


def check_syntax(source: bytes, name: str) -> RunFault | None:
    """A RunFault for a program (bytes, as Python itself reads it) that cannot be read or is empty, or None."""
    try:
        encoding = tokenize.detect_encoding(io.BytesIO(source).readline)[0]
        text = source.decode(encoding)
    # UnicodeError, and no kind of it, is what the encoding `undefined` raises.
    except (SyntaxError, UnicodeError, LookupError):
        named = _CODING.search(b"\n".join(source.splitlines()[:2]))
        which = "in the encoding `%s` that its first lines name" % named[1].decode() if named else (
            "which is not in UTF-8")
        return RunFault("syntax", "Python cannot read the file, %s: choose UTF-8 where your editor saves it%s"
                        % (which, ", and take the line with `coding` out" if named else ""), 0.0)
    try:
        compile(text, name, "exec", dont_inherit=True)
    except SyntaxError as error:
        hint = ""
        if any(word in str(error.msg) for word in PYTHON2):
            hint = ("; this is Python 2, as in the sheet's listings: in Python 3 print(...) has brackets, and it is "
                    "`except Error as e`")
        elif "'return' outside function" in str(error.msg):
            hint = "; the sheet's `generate_posemsg` has its `return` at the margin: indent the line"
        return RunFault("syntax", "line %s cannot be read by Python: %s%s" % (error.lineno or "?", error.msg, hint),
                        0.0)
    except ValueError as error:  # null bytes
        return RunFault("syntax", "the file is not a Python program: %s" % error, 0.0)
    except (RecursionError, MemoryError):
        return RunFault("syntax", "Python cannot read the file: an expression in it is nested too deeply", 0.0)
    if not ast.parse(text).body:
        return RunFault("empty", "the file is empty, or holds nothing but remarks: perhaps another one was saved", 0.0)
    return None


def line_of(program: str, traceback: str) -> int | None:
    """The line of `program` that a traceback names last, or None."""
    lines = [int(number) for path, number in _FRAME.findall(traceback) if path.endswith(program)]
    return lines[-1] if lines else None


def line_of_dump(program: Path, dump: str) -> int | None:
    """Where `program` (Path) was when Python's fault handler wrote `dump`: the head of its outermost loop, or None.

    For a program outside of loops it is the innermost line.
    """
    for thread in _THREAD.split(dump):
        lines = [int(number) for path, number in _FRAME.findall(thread) if path.endswith(program.name)]
        if lines:
            # Innermost first. The line inside the loop at which a program is stopped is random.
            found = [loop for line in lines[::-1] for loop in _loops_around(program, line)]
            return found[0] if found else lines[0]
    return None


def _loops_around(program: Path, line: int) -> list[int]:
    """First lines of the loops that a line is in, the outermost first."""
    try:
        tree = ast.parse(program.read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    return sorted(node.lineno for node in ast.walk(tree)
                  if isinstance(node, (ast.While, ast.For)) and node.lineno <= line <= (node.end_lineno or 0))


def is_flood(counts: np.ndarray) -> bool:
    """Whether joint commands (n, 2), counted at each record, came faster than the robot reads them."""
    total = counts.sum(axis=1) if len(counts) else np.zeros(0)
    width = round(FLOOD_WINDOW_S / RECORD_S)
    if len(total) <= width:
        return len(total) > 0 and total[-1] > FLOOD_COMMANDS
    return bool((total[width:] - total[:-width]).max() > FLOOD_COMMANDS)


def meddling(run: ProgramRun) -> RunFault | None:
    """A RunFault for a program that changed the simulator or the ROS graph instead of moving the robot, or None."""
    changes = run.changes
    if run.ended == "simulator gone" or "/gazebo" in changes.missing_nodes:
        return RunFault("killed_simulator", "the simulator ended while the program ran: it was shut down or killed "
                        "(rosnode kill, os.kill, a second node named /gazebo, the robot deleted); a program must "
                        "leave it running", 0.0)
    if run.ended == "paused":
        return RunFault("paused",
                        "the simulation stood still: the program called /gazebo/pause_physics, and without time "
                        "nothing moves", 0.0)
    if changes.missing_nodes:
        return RunFault("killed_nodes",
                        "the program shut down, unregistered or replaced %s; leave the lab's nodes alone, "
                        "and give your own node a name of its own" % _few(changes.missing_nodes), 0.0)
    if changes.intruders:
        topic, nodes = next(iter(sorted(changes.intruders.items())))
        return RunFault("intruder", "%s publishes on %s, which belongs to the simulator; the check measures the robot "
                        "itself, so this gains nothing" % (" and ".join(sorted(nodes)), topic), 0.0)
    if changes.withdrawn:
        return RunFault("withdrawn",
                        "the program took %s of the lab's nodes off the ROS master's lists; leave what you "
                        "have not registered yourself" % _few(changes.withdrawn), 0.0)
    if changes.parameters:
        return RunFault("parameters", "the program changed or deleted the lab's parameter %s; the check does not go by "
                        "parameters, so this gains nothing" % _few(changes.parameters), 0.0)
    return _moved_otherwise(run)


def _few(names: list[str]) -> str:
    """Three names at most, in words."""
    return ", ".join(names[:3]) + (" and %d more" % (len(names) - 3) if len(names) > 3 else "")


def _moved_otherwise(run: ProgramRun) -> RunFault | None:
    """A RunFault for arms that were moved by something other than joint commands, or None. It uses recorded causes, not
    jumps."""
    recording = run.recording
    if not recording.records:
        return None
    jump = max(largest_jump(recording.arm(side)) for side in SIDES)
    if recording.placed_count() or jump > JUMP_RAD:
        return RunFault("teleport", "an arm was put elsewhere past its drives (/gazebo/set_model_configuration or a "
                        "reset), which no robot can; command its joints instead", 0.0)
    path = recording.path_without_cause()
    if path > STRAY_RAD:
        return RunFault("moved_otherwise", "an arm moved by %.2f rad although the robot had not obeyed a single joint "
                        "command: something else pushed it" % path, 0.0)
    return None


def behaviour(run: ProgramRun, sides: tuple[str, ...], limit_s: float) -> RunFault | None:
    """A RunFault of the program's behaviour that does not depend on the exercise, or None. sides: the arms that must
    move."""
    if run.ended in _EXCESSES:
        return _EXCESSES[run.ended]
    if run.ended == "flood" or is_flood(run.recording.command_counts()):
        return RunFault("flood", "joint commands came faster than %d a second: the robot reads some 100; end the loop "
                        "with rate.sleep() of a rospy.Rate(100)" % FLOOD_COMMANDS, 0.4)
    if run.ended == "busy":
        return RunFault("busy",
                        "the program computes without end%s: a loop that neither waits nor ends; give it a rate."
                        "sleep() and a condition such as `not rospy.is_shutdown()`" % _at_line(run), 0.4)
    crash = crashed(run)
    if crash:
        return crash
    return _about_motion(run, sides) or _about_end(run, sides, limit_s)


def crashed(run: ProgramRun) -> RunFault | None:
    """A RunFault for a program that ended with an exception, or None."""
    if run.exit_code in (None, 0) or "Traceback (most recent call last)" not in run.errors:
        return None
    last = [line for line in run.errors.strip().splitlines() if line and not line[0].isspace()]
    line = line_of(run.program, run.errors)
    where = " in line %d" % line if line else ""
    said = last[-1][:300] if last else "unknown"
    if "'Quaternion' object is not subscriptable" in said:
        said += "; " + mistakes.SHEET_QUERY
    return RunFault("crashed", "the program ended with an error%s: %s" % (where, said))


def _at_line(run: ProgramRun) -> str:
    return " at line %d" % run.stuck_at if run.stuck_at else ""


def _about_motion(run: ProgramRun, sides: tuple[str, ...]) -> RunFault | None:
    recording = run.recording
    if not sides or not recording.records:
        return None
    slip = mistakes.command_slip(recording.commands())
    if slip:
        return RunFault(*slip)
    moved = {side: has_moved(recording.arm(side)) for side in SIDES}
    counts = dict(zip(SIDES, recording.command_counts()[-1], strict=True))
    if not any(moved.values()):
        has_tried = any(counts.values()) or recording.ik_requests() or run.exit_code is not None
        if has_tried and not recording.was_enabled():
            return RunFault("not_enabled",
                            "the robot was never enabled, so no arm moved: baxter_interface.RobotEnable()."
                            "enable() before the first command")
        return None
    others = [side for side in SIDES if side not in sides and moved[side]]
    if others and not any(moved[side] for side in sides):
        return RunFault("wrong_arm", "the %s arm moved, and the %s arm is the one that was to move"
                        % (others[0], sides[0]))
    return None


def _about_end(run: ProgramRun, sides: tuple[str, ...], limit_s: float) -> RunFault | None:
    recording = run.recording
    if run.ended == "exited" and sides and recording.records:
        if not any(path_length(recording.arm(side)) > 0.02 for side in SIDES):
            return RunFault("early_exit", "the program ended (exit status %s) before any arm moved%s" % (
                run.exit_code, _last_words(run)))
    if run.ended == "sim time":
        return RunFault("no_end", "the program was still running after %.0f s of simulation%s, and was ended"
                        % (limit_s, _at_line(run)))
    if run.exit_code not in (None, 0):
        return RunFault("exit_status", "the program ended with exit status %s%s" % (run.exit_code, _last_words(run)))
    return None


def left_on_its_way(run: ProgramRun, sides: tuple[str, ...]) -> RunFault | None:
    """A RunFault for a program that ended while an arm was still moving to its target, or None."""
    recording = run.recording
    end = recording.records[-1].get("exited") if recording.records else None
    if run.ended != "exited" or end is None or not sides:
        return None
    for side in sides:
        counts = recording.command_counts()[:, SIDES.index(side)]
        if 0 < counts[-1] <= 3:
            return RunFault("early_exit",
                            "the program sent %s to the %s arm and ended without waiting for the arm: send "
                            "commands until it is there, as move_to_joint_positions does, and then go on"
                            % (counted(counts[-1], "joint command"), side))
        rows = moving_rows(recording.times, recording.arm(side))
        if rows and recording.times[rows[1]] > end + _ON_ITS_WAY_S:
            return RunFault("early_exit",
                            "the program ended while the %s arm was on its way: wait until the arm is there "
                            "(move_to_joint_positions does) before you leave" % side)
    return None


def held_back(run: ProgramRun, sides: tuple[str, ...]) -> RunFault | None:
    """A RunFault for an arm that collision avoidance held, and that has not moved on since, or None."""
    for side in sides:
        held = run.recording.held(side)
        if held and path_length(run.recording.arm(side)[held[0]:]) < STRAY_RAD:
            return RunFault("held", "collision avoidance held the %s arm at %.1f s: it came too near to %s. Take "
                            "another way, unfold folded arms (%s); move_to_joint_positions returns False there, and "
                            "its log says so" % (side, run.recording.times[held[0]], ", ".join(held[1]), UNFOLD))
    return None


def _last_words(run: ProgramRun) -> str:
    words = (run.errors.strip() or run.output.strip()).splitlines()
    return "; its last line was: %s" % words[-1][:200] if words else ""


def diagnose(run: ProgramRun, exercise: Exercise, call: ProgramCall, robot: JudgedRobot,
             share: float) -> RunFault | None:
    """The fault of one run, or None when all is well. share: the result of its criteria, 0 to 1."""
    fault = meddling(run) or behaviour_that_hides(run, exercise.sides, call.limit_s)
    if fault:
        return fault
    if share < 0.995:
        fault = (exercise.task.foremost(call, run)
                 or held_back(run, exercise.sides)
                 or left_on_its_way(run, exercise.sides)
                 or (exercise.task.slip(call, run, robot) if run.recording.records else None)
                 or behaviour(run, exercise.sides, call.limit_s))
    if fault is None and run.survivors:
        fault = RunFault("survivors",
                         "%s of the program went on after it had ended, and had to be killed: end what you "
                         "start" % counted(run.survivors, "process", "processes"), 0.9)
    return fault


def of_another(fault: RunFault | None, exercise: Exercise, other: Exercise, file_name: str) -> RunFault:
    """A RunFault for a program that does little of `exercise` and is for the Exercise `other`. fault: of its run."""
    sentence = ("this looks like a program for the exercise %s: ./baxter.sh check %s %s %s. It was checked as %s"
                % (other.name, other.lab, other.name, file_name, exercise.name))
    return RunFault("other_exercise", sentence + (": " + fault.sentence if fault else ""), fault.cap if fault else 1.0)


def behaviour_that_hides(run: ProgramRun, sides: tuple[str, ...], limit_s: float) -> RunFault | None:
    """Faults of behaviour that make every measurement meaningless: they come before the exercise's own."""
    fault = behaviour(run, sides, limit_s)
    first = (*_EXCESSES, "flood", "busy", "crashed", "not_enabled", "wrong_arm", "repeated_names", "lengths", "degrees")
    return fault if fault and fault.key in first else None
