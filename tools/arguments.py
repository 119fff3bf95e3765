#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Refuse words that a mode of baxter.sh cannot use before set-up, which takes minutes, and not after it.

    arguments.py ROOT MODE WORD…

The mode's program judges: its function `parse` gets the words. Modules that set-up would install have stand-ins here,
which take part in any expression; where that is not enough, the program judges when it runs. Exit code 0: nothing is
wrong that can be seen here; 2: something is, in one sentence on standard error.
"""
from __future__ import annotations

import argparse
import importlib
import importlib.machinery
import sys
from collections.abc import Iterator
from importlib.abc import Loader, MetaPathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

#: The files with the function `parse` of each mode.
PROGRAMS = {
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


class WordsRefused(Exception):
    """A program refuses its words; the text says why."""


class _Anything(type):
    """Its classes are the result of all that is done with them."""

    def __getattr__(cls, name: str) -> _Anything:
        if name.startswith("__"):
            raise AttributeError(name)
        return _Anything(name, (StandIn,), {})  # another class each time: two may be bases of one

    def _itself(cls, *_: object, **__: object) -> _Anything:
        return cls

    def __call__(cls, *_: object, **__: object) -> Any:
        return cls

    def __or__(cls, _: object) -> Any:
        return cls

    def __ror__(cls, _: object) -> Any:
        return cls

    def __setitem__(cls, key: object, value: object) -> None:
        pass

    def __iter__(cls) -> Iterator[object]:
        return iter(())

    __getitem__ = __neg__ = __add__ = __radd__ = __sub__ = __rsub__ = _itself
    __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = __matmul__ = _itself


class StandIn(Exception, metaclass=_Anything):
    """For classes, functions and errors of what is not installed yet."""


class StandIns(MetaPathFinder, Loader):
    """Finds every module that is not there, but for Python's own."""

    def find_spec(self, fullname: str, path: object, target: object = None) -> importlib.machinery.ModuleSpec | None:
        if fullname.partition(".")[0] in sys.stdlib_module_names:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        module = ModuleType(spec.name)
        module.__getattr__ = lambda name: getattr(StandIn, name)
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: it is empty."""


def program(root: Path, mode: str) -> Any:
    """The module of a mode's program."""
    folders = sorted(path for depth in ("*/*", "*/*/*") for path in root.glob(f"src/{depth}/src")
                     if path.parent.name != "xacro")  # which looks for the installed one
    sys.path[:0] = map(str, (root / "tools", root / "tests/bench", *folders))
    sys.meta_path.append(StandIns())
    sys.dont_write_bytecode = True
    path = root / PROGRAMS[mode]
    if path.parent.parent.name == "src":
        return importlib.import_module(f"{path.parent.name}.{path.stem}")
    loader = importlib.machinery.SourceFileLoader(path.stem, str(path))
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[path.stem] = module
    loader.exec_module(module)
    return module


def own_words(mode: str, words: list[str]) -> list[str]:
    """The words that a mode's program gets from baxter.sh."""
    if mode in ("web", "conformance"):
        words = [word for word in words if ":=" not in word]  # a node's own
    if mode == "conformance" and words and not words[0].startswith("-"):
        return words[1:]  # the robot, which baxter.sh looks up
    return words


def _refuse(self: argparse.ArgumentParser, status: int = 0, message: str | None = None) -> NoReturn:
    if status == 0:
        sys.exit()
    raise WordsRefused((message or "").strip().removeprefix("check: "))


def _error(self: argparse.ArgumentParser, message: str) -> NoReturn:
    """The error of any parser also asks for what was meant."""
    meant = importlib.import_module("command_line.options").Parser.meant(self, message)
    raise WordsRefused(message if message.endswith(meant) else message + meant)


def main(root: str, mode: str, *words: str) -> int:
    argparse.ArgumentParser.exit = _refuse
    argparse.ArgumentParser.error = _error
    try:
        program(Path(root), mode).parse(own_words(mode, list(words)))
    except WordsRefused as refused:
        print(f"baxter.sh {mode}: {refused}", file=sys.stderr)
        return 2
    except Exception:  # noqa: BLE001  (the program will say what it thinks of its words)
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
