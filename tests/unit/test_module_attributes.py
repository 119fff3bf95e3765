# SPDX-License-Identifier: BSD-3-Clause
"""Attributes that a module uses of another module of this workspace exist; a linter checks only one file at a time."""
import ast
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path for folder in ("src", "tests", "tools") for path in (ROOT / folder).rglob("*.py")
               if not path.is_symlink() and path.suffix == ".py")
# Every module has these.
OF_ALL = {"__file__", "__name__", "__doc__", "__dict__", "__path__"}


@cache
def module_paths():
    """(package, module) to the module's file."""
    return {(path.parent.name, path.stem): path for path in FILES}


@cache
def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def names_of(path):
    """All names that a module defines or imports, at any depth: a superset of its attributes."""
    names = set(OF_ALL)
    for node in ast.walk(tree_of(path)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update((alias.asname or alias.name).split(".")[0] for alias in node.names)
    return names


def unknown(path, tree):
    """["line: module.name"] of used attributes that the module does not have."""
    modules, taken = {}, set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            package = (node.module or "").split(".")[-1] or path.parent.name
            for alias in node.names:
                found = module_paths().get((package, alias.name))
                if found is not None:
                    modules[alias.asname or alias.name] = found
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            taken.add(node.id)
        elif isinstance(node, ast.arg):
            taken.add(node.arg)
    return ["%d: %s.%s" % (node.lineno, node.value.id, node.attr) for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules
            and node.value.id not in taken and node.attr not in names_of(modules[node.value.id])]


@pytest.mark.parametrize("folder", sorted({path.relative_to(ROOT).parts[:3] for path in FILES}), ids="/".join)
def test_modules_have_what_others_ask_of_them(folder):
    found = ["%s:%s" % (path.relative_to(ROOT), problem) for path in FILES
             if path.relative_to(ROOT).parts[:3] == folder for problem in unknown(path, tree_of(path))]
    assert not found, "\n".join(found)


def test_what_is_not_there_is_found():
    path = module_paths()["lab_environment", "first_clock"]
    tree = ast.parse("from lab_environment import first_clock\nfirst_clock.ClockWait\nfirst_clock.nothing_of_it\n")
    assert unknown(path, tree) == ["3: first_clock.nothing_of_it"]
