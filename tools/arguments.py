#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Refuse words that a mode of baxter.sh cannot use before set-up, which takes minutes, and not after it.

    arguments.py ROOT MODE WORD…

The options come from the source of the mode's program, which is read and not run: what it imports may not be installed
yet. What cannot be judged so is left to the program. Exit code 0: nothing is wrong that can be seen here; 2: something
is, in one sentence on standard error.
"""
from __future__ import annotations

import argparse
import ast
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

ROOT = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
# Packages that need nothing but Python.
sys.path[:0] = [str(ROOT / place) for place in ("tools", "src/base/command_line/src", "src/base/disk_cache/src",
                                                "src/base/processes/src", "src/lab/lab_web/src")]

try:
    from command_line import options as types
    from command_line.options import did_you_mean
except (ImportError, SyntaxError):  # a workspace without them, a Python that is too old: the program judges
    sys.exit(0)

# The files that declare the options of a mode.
DECLARED = {
    "test": "tools/run_tests.py",
    "notebook": "tools/notebook.py",
    "web": "src/lab/lab_web/src/lab_web/node.py",
    "check": "src/courses/rf_checks/src/rf_checks/command.py",
    "grade": "src/classroom/rf_grading/src/rf_grading/command.py",
    "labs": "src/classroom/lab_class/src/lab_class/command.py",
    "learn": "src/lab/robot_learning/src/robot_learning/command.py",
    "batch": "src/lab/lab_batch/src/lab_batch/command.py",
    "batch-node": "src/lab/lab_batch/src/lab_batch/ray_node.py",
    "bench": "tests/bench/run.py",
    "sysid": "src/baxter/baxter_sysid/scripts/sysid",
    "conformance": "src/baxter/baxter_conformance/scripts/conformance",
}
EXERCISES = "src/courses/rf_checks/src/rf_checks/exercises.py"
EXPERTS = "src/lab/demonstrations/src/demonstrations/experts.py"
JOBS = "src/lab/lab_batch/src/lab_batch/shipped.py"
# What argparse needs to tell words apart and to refuse them; `type` and `choices` only where the source has them.
KEPT, OPTIONAL = ("action", "nargs", "const", "dest", "required", "metavar"), ("type", "choices")


class Unreadable(Exception):
    """Why a source says nothing about words, to a reader that runs none of it."""


class Parser(types.Parser):
    """A parser whose errors are one sentence, without a usage text in front."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, "baxter.sh %s: %s%s\n" % (self.prog, message, self.meant(message)))


def source_of(path: str) -> ast.Module:
    try:
        return ast.parse((ROOT / path).read_text(encoding="utf-8"))
    except (OSError, ValueError, SyntaxError) as error:
        raise Unreadable(str(error)) from error


def constants(tree: ast.Module) -> dict[str, Any]:
    """The names of a module that are plain values, and those of command_line.options."""
    known = {**vars(types), "argparse": argparse, "int": int, "float": float, "str": str, "Path": Path}
    for node in tree.body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            try:
                known[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                known.pop(node.targets[0].id, None)
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            known.pop(node.name, None)
    return known


def value_of(node: ast.expr, known: dict[str, Any]) -> Any:
    """Raises Unreadable."""
    try:
        return eval(compile(ast.Expression(node), "options", "eval"), {"__builtins__": {}}, known)
    except Exception as error:  # noqa: BLE001  (an expression of any kind)
        raise Unreadable(str(error)) from error


def calls(tree: ast.Module, method: str) -> list[tuple[str, ast.Call]]:
    """(name of the object, call) of all calls of a method, in their order."""
    found = [(node.func.value.id, node) for node in ast.walk(tree) if isinstance(node, ast.Call)
             and isinstance(node.func, ast.Attribute) and node.func.attr == method
             and isinstance(node.func.value, ast.Name)]
    return sorted(found, key=lambda one: one[1].lineno)


def parser_of(mode: str, tree: ast.Module) -> Parser:
    """A parser with the options that a source declares for its variable `parser` or `made`. Raises Unreadable."""
    # The tests' program passes on what is pytest's, which an abbreviation would take for its own.
    known, parser = constants(tree), Parser(prog=mode, add_help=False, allow_abbrev=mode != "test")
    objects = {"parser": parser, "made": parser}
    for node in ast.walk(tree):
        if (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and isinstance(node.value, ast.Call)
                and isinstance(node.value.func, ast.Attribute)
                and node.value.func.attr == "add_mutually_exclusive_group"):
            objects[node.targets[0].id] = parser.add_mutually_exclusive_group(
                **{word.arg: value_of(word.value, known) for word in node.value.keywords if word.arg})
    for name, call in calls(tree, "add_argument"):
        if name in objects:
            given = {word.arg: word.value for word in call.keywords if word.arg}
            settings = {word: value_of(given[word], known) for word in KEPT if word in given}
            for word in OPTIONAL:
                try:
                    settings.update({word: value_of(given[word], known)} if word in given else {})
                except Unreadable:
                    continue
            objects[name].add_argument(*(value_of(word, known) for word in call.args), **settings)
    return parser


def named(tree: ast.Module, name: str) -> list[str]:
    """The keys of a table of a module. Raises Unreadable."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == name \
                and isinstance(node.value, ast.Dict):
            return [ast.literal_eval(key) for key in node.value.keys if key is not None]
    raise Unreadable("no table %s" % name)


def exercises() -> dict[str, list[str]]:
    """{lab: its exercises}. Raises Unreadable."""
    found: dict[str, list[str]] = {}
    for node in ast.walk(source_of(EXERCISES)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Exercise":
            found.setdefault(ast.literal_eval(node.args[0]), []).append(ast.literal_eval(node.args[1]))
    if not found:
        raise Unreadable("no exercises")
    return found


def tasks() -> list[str]:
    """The tasks that an expert shows: what its class names. Raises Unreadable."""
    found = []
    for kind in source_of(EXPERTS).body:
        for line in kind.body if isinstance(kind, ast.ClassDef) else []:
            if isinstance(line, ast.Assign):
                target, value = line.targets[0], line.value
                is_one = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
                pairs = zip(target.elts, value.elts, strict=False) if is_one else [(target, value)]
                found += [ast.literal_eval(what) for name, what in pairs if getattr(name, "id", "") == "TASK"]
    if not any(found):
        raise Unreadable("no tasks")
    return [name for name in found if name]


# --- what the programs themselves find wrong, by mode: sentences ------------------------------------------------------


def wrong_check(options: argparse.Namespace) -> Iterator[str]:
    known = exercises()
    names = [name for names in known.values() for name in names]
    if options.start and options.start not in names:
        yield "there is no exercise '%s'; there are: %s%s" % (
            options.start, ", ".join(names), did_you_mean(options.start, names))
    if options.list or options.start:
        return
    if not options.lab:
        yield "say which lab and which program: ./baxter.sh check lab2 my_node.py (--list shows them all)"
    elif options.lab not in known and (len(options.words) not in (1, 2) or options.lab.endswith(".py")):
        yield "expected LAB [EXERCISE] PROGRAM, as in ./baxter.sh check lab2 my_node.py, got: %s" % " ".join(
            [options.lab, *options.words])
    yield from wrong_lab(options.lab, options.words[:-1])
    if len(options.words) not in (1, 2):
        yield "give the path of your Python file: ./baxter.sh check %s my_node.py" % " ".join(
            [options.lab, *options.words])
    elif not Path(options.words[-1]).is_file():
        yield "%s is %s; give the path of your Python file" % (
            options.words[-1], "no file" if Path(options.words[-1]).exists() else "not there")


def wrong_lab(lab: str, names: list[str]) -> Iterator[str]:
    known = exercises()
    if lab not in known:
        owner = next((one for one, names in known.items() if lab in names), None)
        hint = "; '%s' is an exercise of %s" % (lab, owner) if owner else did_you_mean(lab, known)
        yield "there is no lab '%s'; labs are %s%s" % (lab, ", ".join(known), hint)
        return
    for name in names:
        if name not in known[lab]:
            yield "%s has no exercise '%s'; its exercises are %s%s" % (
                lab, name, ", ".join(known[lab]), did_you_mean(name, known[lab]))


def wrong_grade(options: argparse.Namespace) -> Iterator[str]:
    if options.version:
        return
    if options.folder is None:
        yield "say which folder has the submissions: ./baxter.sh grade FOLDER [LAB [EXERCISE ...]]"
    elif not Path(options.folder).exists():
        yield "there is no folder or archive %s" % options.folder
    if options.lab:
        yield from wrong_lab(options.lab, options.exercises)


def wrong_learn(options: argparse.Namespace) -> Iterator[str]:
    for path in (options.judge, options.evaluate, options.data):
        if path is not None and not Path(path).exists():
            yield "there is no %s" % path
    known = tasks()
    if not options.judge and not options.evaluate and options.task not in known:
        yield "TASK is one of %s; found %s%s" % (
            ", ".join(known), options.task or "none", did_you_mean(options.task or "", known))


def wrong_batch(options: argparse.Namespace) -> Iterator[str]:
    known = named(source_of(JOBS), "JOBS")
    if options.list:
        return
    if not options.job:
        yield "JOB and --seeds are needed, or --list"
    elif ":" not in options.job and options.job not in known:
        yield "there is no job '%s'; jobs are %s, or package.module:Class%s" % (
            options.job, ", ".join(known), did_you_mean(options.job, known))
    elif not options.seeds:
        yield "--seeds is needed, such as --seeds 0:100"


def wrong_bench(options: argparse.Namespace) -> Iterator[str]:
    known = named(source_of(DECLARED["bench"]), "SUITES")
    for name in options.names:
        if name not in known:
            yield "unknown suite: %s; the suites are %s%s" % (name, ", ".join(known), did_you_mean(name, known))
    if options.recording is not None and not Path(options.recording).is_file():
        yield "--recording: there is no file %s" % options.recording


def wrong_notebook(options: argparse.Namespace) -> Iterator[str]:
    import notebook
    try:
        if options.name and not options.list:
            notebook.find(options.name)
    except notebook.NotebookError as error:
        yield str(error)


def wrong_sysid(options: argparse.Namespace) -> Iterator[str]:
    if options.recording is None and options.arm in (None, "both"):
        yield "without RECORDING the robot moves, one arm at a time: --arm left or --arm right; or name a recording"
    for path in (options.recording, options.start):
        if path is not None and not Path(path).exists():
            yield "there is no file %s" % path


def wrong_labs(options: argparse.Namespace) -> Iterator[str]:
    """The commands are parsers of their own; the first word tells them apart."""
    known = [verb for _, call in calls(source_of(DECLARED["labs"]), "add_subparsers") for word in call.keywords
             if word.arg == "metavar" for verb in ast.literal_eval(word.value).split("|")]
    if not known:
        raise Unreadable("no commands")
    if not options.rest:
        yield "say what to do: %s" % ", ".join(known)
    elif options.rest[0] not in known:
        yield "there is no '%s'; it is one of %s%s" % (
            options.rest[0], ", ".join(known), did_you_mean(options.rest[0], known))
    elif options.rest[0] == "up" and len(options.rest) > 1 and not options.rest[1].startswith("-"):
        who = options.rest[1]
        if not who.isdecimal() and not Path(who).exists():
            yield "%s is neither a number of students nor a file with their names" % who


def wrong_test(options: argparse.Namespace) -> Iterator[str]:
    from lab_tests import discovery
    os.chdir(ROOT)  # as the program does
    try:
        if options.changed is None:
            discovery.select(discovery.take_inventory(ROOT), options.rest, ROOT)
    except discovery.SelectionError as error:
        yield str(error)


WRONG = {"test": wrong_test, "notebook": wrong_notebook, "check": wrong_check, "grade": wrong_grade, "labs": wrong_labs,
         "learn": wrong_learn, "batch": wrong_batch, "bench": wrong_bench, "sysid": wrong_sysid}


def wrong_words(mode: str, words: list[str]) -> str | None:
    """The first thing that is wrong, or None. Raises Unreadable, and SystemExit where argparse refuses."""
    parser = parser_of(mode, source_of(DECLARED[mode]))
    if mode in ("web", "conformance"):
        words = [word for word in words if ":=" not in word]  # a node's own
    if mode == "conformance" and words and not words[0].startswith("-"):
        words = words[1:]  # the robot, which baxter.sh looks up
    if mode == "test":
        words = [word for word in words if word != "--busy"]  # what follows may be a number, or a name
    if mode in ("test", "labs"):
        options, options.rest = parser.parse_known_args(words)
    else:
        options = parser.parse_intermixed_args(words)
    return next(WRONG[mode](options), None) if mode in WRONG else None


def main(words: list[str]) -> int:
    try:
        sentence = wrong_words(words[1], words[2:])
    except Exception:  # noqa: BLE001  (the program will say what it thinks of its words)
        return 0
    if sentence is not None:
        print("baxter.sh %s: %s" % (words[1], sentence), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
