# SPDX-License-Identifier: BSD-3-Clause
"""The command line of `./baxter.sh check`."""
from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import signal
import sys
from pathlib import Path
from typing import NoReturn

import rospkg

from command_line.options import MAX_SEED, Parser, did_you_mean, number, seconds
from command_line.user_files import kind_of
from disk_cache.files import draft_of
from lab_web import page_files
from processes import isolation
from processes.isolation import NotIsolated
from processes.work_folder import work_folder
from rf_checks import report, submission
from rf_checks.exercises import EXERCISES, LABS, UnknownExercise, choose, meant_instead
from rf_checks.graph import LabFailed
from rf_checks.judge import WALL_LIMIT_S, Judge
from rf_checks.lab import WhichRobot

PASSED, NOT_PASSED, WRONG_WORDS, JUDGE_FAILED, NOT_GRADED = 0, 1, 2, 3, 4


def _listing() -> str:
    lab_width = max(len(exercise.lab) for exercise in EXERCISES)
    width = max(len(exercise.name) for exercise in EXERCISES)
    lines = ["  %-*s  %-*s  %s\n  %s  runs as: %s" % (lab_width, exercise.lab, width, exercise.name, exercise.title,
                                                     " " * (lab_width + 2 + width), exercise.usage)
             for exercise in EXERCISES]
    return "\n".join(lines)


def _command_for(word: str) -> str:
    """The command that checks what a single word may mean, the name of an exercise or its program; or a list of all."""
    name = Path(word).stem
    for exercise in EXERCISES:
        if exercise.name == name:
            return "./baxter.sh check %s %s" % (exercise.lab, word if word.endswith(".py") else word + ".py")
    return "./baxter.sh check LAB %s, where LAB is %s" % (word, " or ".join(LABS))


class _Parser(Parser):
    """A parser whose errors have no usage text in front."""

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_WORDS, "check: %s%s\n" % (message, self.meant(message)))


def _parser():
    parser = _Parser(
        prog="./baxter.sh check", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Run your program in a separate lab and judge the result. A running lab "
                    "is not affected.",
        epilog="exercises:\n%s\n\nWithout EXERCISE the program's name or a line `# exercise: NAME` in it decides.\n"
               "Otherwise it is guessed from the program; the first line of the result names it.\n"
               "exit status: 0 passed, 1 not passed, 2 wrong arguments, 3 the check itself failed,\n"
               "             4 not graded: this machine is too slow" % _listing())
    parser.add_argument("lab", nargs="?", metavar="LAB", help=" or ".join(LABS))
    parser.add_argument("words", nargs="*", metavar="[EXERCISE] PROGRAM", help="a Python file")
    parser.add_argument("--list", action="store_true", help="list the exercises and end")
    parser.add_argument("--start", metavar="EXERCISE",
                        help="copy this exercise's skeleton into the current folder and end")
    parser.add_argument("--seed", type=number(int, 0, MAX_SEED), default=0,
                        help="seed of start postures and goals (default: %(default)s)")
    parser.add_argument("--profile", choices=("sim", "robot"), default="sim",
                        help="sim: ideal drives and sensors; robot: a physical robot's (default: %(default)s)")
    parser.add_argument("--serial", type=number(int, 0, MAX_SEED), default=0,
                        help="which robot: its mounts are its own; 0 is the drawing (default: %(default)s)")
    parser.add_argument("--wall-limit", type=seconds(), default=WALL_LIMIT_S, metavar="SECONDS",
                        help="give up ungraded after so long; a slow or busy machine needs more (default: %(default)g)")
    parser.add_argument("--trusted", action="store_true",
                        help="where this machine allows no sandbox, run the program without one: your own program, or "
                             "one whose author you trust as yourself")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result as JSON")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the result as JUnit XML")
    return parser


def _program_and_exercise(parser: argparse.ArgumentParser, options: argparse.Namespace):
    words = options.words
    if not options.lab:
        parser.error("say which lab and which program: ./baxter.sh check lab2 my_node.py (--list shows them all)")
    if not words and options.lab not in LABS:
        parser.error("there is no lab '%s'; did you mean %s?" % (options.lab, _command_for(options.lab)))
    if options.lab.endswith(".py") or len(words) not in (1, 2):
        parser.error("expected LAB [EXERCISE] PROGRAM, as in ./baxter.sh check lab2 my_node.py, got: %s"
                     % " ".join([options.lab, *words]))
    name, program = ("", words[0]) if len(words) == 1 else words
    path = Path(program)
    try:
        if name or options.lab not in LABS:
            choose(options.lab, name, path.name, "")
    except UnknownExercise as error:
        parser.error(str(error))
    if not path.is_file():
        where = "is %s" % (kind_of(path.stat().st_mode) if path.exists() else "not there")
        parser.error("%s %s; give the path of your Python file" % (program, where))
    for report_file in (options.json, options.junit):
        if report_file is not None and not report_file.absolute().parent.is_dir():
            parser.error("there is no folder %s to write %s into" % (report_file.absolute().parent, report_file.name))
        link = _link_in(report_file) if report_file is not None else None
        if link is not None:
            parser.error("%s is a link, to %s; give the report a file of its own" % (link, os.readlink(link)))
    try:
        text = submission.texts(path)[path.name]
        exercise = choose(options.lab, name, path.name, text)
        return path, exercise, meant_instead(exercise, path.name, text)
    except (UnknownExercise, submission.BadSubmission) as error:
        parser.error(str(error))


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The options; ``path``, ``exercise`` and ``other`` of a program, see :func:`_program_and_exercise`."""
    parser = _parser()
    options = parser.parse_intermixed_args(argv)
    names = [exercise.name for exercise in EXERCISES]
    if options.start and options.start not in names:
        parser.error("there is no exercise '%s'; there are: %s%s" % (
            options.start, ", ".join(names), did_you_mean(options.start, names)))
    if not options.list and not options.start:
        options.path, options.exercise, options.other = _program_and_exercise(parser, options)
    return options


def _link_in(path: Path):
    """The first part of a path, as given, that is a link; or None."""
    return next((part for part in [*reversed(path.parents), path] if part.is_symlink()), None)


def start(name: str) -> int:
    """Copy an exercise's skeleton into the current folder; returns the exit status."""
    folder = Path(rospkg.RosPack().get_path("rf_checks")) / "exercises" / "skeletons"
    source, target = folder / (name + ".py"), Path(name + ".py")
    if os.path.lexists(target):
        print("%s is there already; it stays as it is" % target, file=sys.stderr)
        return WRONG_WORDS
    shutil.copy(source, target)
    target.chmod(0o755)
    lab = next(exercise.lab for exercise in EXERCISES if exercise.name == name)
    print("%s is yours now. When it runs: ./baxter.sh check %s %s" % (target, lab, target))
    return PASSED


def write_report(path: Path, text: str) -> None:
    """Replace a file by one with `text`, atomically. A link of that name is replaced, not followed."""
    with draft_of(path) as draft:
        draft.write_text(text, encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Returns the exit status."""
    options = parse(argv)
    if options.list:
        print(_listing())
        return PASSED
    if options.start:
        return start(options.start)
    program, exercise, other = options.path, options.exercise, options.other
    for one in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(one, lambda *_: sys.exit(130))
    print("Checking %s as %s %s; this takes up to a minute." % (program, exercise.lab, exercise.name), flush=True)
    if other:
        print("It looks like a program for another exercise: ./baxter.sh check %s %s %s" % (
            other.lab, other.name, program), flush=True)
    try:
        which = WhichRobot(options.profile, options.serial)
        # In the lab of a class no second sandbox can be made; what the program may do there, its author may do, too.
        trusted = options.trusted or isolation.WALLED in os.environ
        with work_folder("lab-check-"), Judge(options.wall_limit, trusted, which) as judge:
            result = judge.check(exercise, program, options.seed)
    except NotIsolated as refusal:
        print("the program was not run: it is checked in a sandbox, and this machine allows none: %s" % refusal,
              file=sys.stderr)
        return JUDGE_FAILED
    except submission.BadSubmission as refusal:
        print("check: %s" % refusal, file=sys.stderr)
        return WRONG_WORDS
    except (LabFailed, OSError) as error:
        print("the check itself failed, which is not your program's fault: %s" % error, file=sys.stderr)
        return JUDGE_FAILED
    except KeyboardInterrupt:
        return 130
    print(report.text(result))
    # The lab's page shows it beside the robot; the check does not depend on that.
    with contextlib.suppress(OSError):
        page_files.write_result(report.as_json(result))
    for path, write in ((options.json, report.as_json), (options.junit, report.as_junit)):
        if path is not None:
            write_report(path, write(result) + "\n")
    if result.not_graded:
        return NOT_GRADED
    return PASSED if report.has_passed(result) else NOT_PASSED
