# SPDX-License-Identifier: BSD-3-Clause
"""Names that a module uses of another of this workspace exist; a linter checks only one file at a time."""
import ast
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from workspace_tree import is_python, own_files

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path for folder in ("src", "tests", "tools") for path in (ROOT / folder).rglob("*.py")
               if not path.is_symlink() and path.suffix == ".py")
#: Nodes and commands without an ending.
PROGRAMS = [ROOT / name for name in own_files() if not Path(name).suffix and is_python(name)]
# Made from message definitions.
GENERATED = ("msg", "srv", "cfg")
# Another package takes its place when it is imported.
REPLACED = ("xacro",)
# Every module has these.
OF_ALL = {"__file__", "__name__", "__doc__", "__dict__", "__path__"}


@cache
def module_paths():
    """(package, module) to the module's file."""
    return {(path.parent.name, path.stem): path for path in FILES}


@cache
def package_folders():
    """Python package of this workspace to its folder."""
    return {path.parent.name: path.parent for path in FILES
            if path.name == "__init__.py" and path.parent.parent.name == "src" and path.parent.name not in REPLACED}


class Facts(NamedTuple):
    """The definitions and uses of one file. Trees are not kept: millions of nodes would slow all later tests down."""

    names: frozenset  # that it defines or imports, at any depth: a superset of its attributes
    modules: dict  # of this workspace that it imports: {name here: file}
    taken: frozenset  # names that it assigns
    attributes: list  # that it uses: (line, name, attribute)
    imports: list  # from packages of this workspace: (line, module, name)


def facts_in(path, text):
    names, modules, taken, attributes, imports = set(OF_ALL), {}, set(), [], []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute):
            if isinstance(node.value, ast.Name):
                attributes.append((node.lineno, node.value.id, node.attr))
        elif isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                names.add(node.id)
                taken.add(node.id)
        elif isinstance(node, ast.arg):
            taken.add(node.arg)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names.update((alias.asname or alias.name).split(".")[0] for alias in node.names)
            if isinstance(node, ast.ImportFrom):
                package = (node.module or "").split(".")[-1] or path.parent.name
                if not node.level and node.module.split(".")[0] in package_folders():
                    imports.extend((node.lineno, node.module, alias.name) for alias in node.names)
                modules.update((alias.asname or alias.name, module_paths()[package, alias.name])
                               for alias in node.names if (package, alias.name) in module_paths())
    return Facts(frozenset(names), modules, frozenset(taken), attributes, imports)


@cache
def facts_of(path):
    return facts_in(path, path.read_text(encoding="utf-8"))


def unknown(facts):
    """["line: module.name"] of used attributes that the module does not have."""
    return ["%d: %s.%s" % (line, name, attribute) for line, name, attribute in facts.attributes
            if name in facts.modules and name not in facts.taken
            and attribute not in facts_of(facts.modules[name]).names]


def missing(facts):
    """["line: module.name"] of imported names that neither stand in the module nor are one in the package."""
    return ["%d: %s.%s" % (line, module, name) for line, module, name in facts.imports if not has(module, name)]


@cache
def has(module, name):
    package, *parts = module.split(".")
    if parts and parts[0] in GENERATED or name in GENERATED or name == "*":
        return True
    place = package_folders()[package].joinpath(*parts)
    own = place.with_suffix(".py") if parts and place.with_suffix(".py").is_file() else place / "__init__.py"
    return own.is_file() and name in facts_of(own).names or (place / (name + ".py")).is_file() \
        or (place / name / "__init__.py").is_file()


@cache
def by_folder():
    found = defaultdict(list)
    for path in [*FILES, *PROGRAMS]:
        found[path.relative_to(ROOT).parts[:3]].append(path)
    return found


@pytest.mark.parametrize("folder", sorted(by_folder()), ids="/".join)
def test_modules_have_what_others_ask_of_them(folder):
    found = ["%s:%s" % (path.relative_to(ROOT), problem) for path in by_folder()[folder]
             for problem in unknown(facts_of(path)) + missing(facts_of(path))]
    assert not found, "\n".join(found)


def test_what_is_not_there_is_found():
    path = module_paths()["rospy_fixes", "first_clock"]
    text = "from rospy_fixes import first_clock\nfirst_clock.ClockWait\nfirst_clock.nothing_of_it\n" \
        "from rf_checks import no_module\nfrom rf_checks.command import main, no_name\n"
    facts = facts_in(path, text)
    assert unknown(facts) == ["3: first_clock.nothing_of_it"]
    assert missing(facts) == ["4: rf_checks.no_module", "5: rf_checks.command.no_name"]
