# SPDX-License-Identifier: BSD-3-Clause
"""Finds the tests of the workspace, and selects those of a command line."""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

LINTERS = ("ruff", "catkin_lint")
# pytest options that take a value, which is not a test's name.
_OPTIONS_WITH_VALUE = set("-k -m -p -o -c -W -r --maxfail --deselect --ignore --tb --durations".split())


class SelectionError(Exception):
    """The command line names a test that does not exist."""


@dataclass(frozen=True)
class Rostest:
    """One .test file: its package, and whether it says `<!-- long -->` and `<!-- beside others -->`."""

    path: Path
    package: str
    is_long: bool
    is_beside_others: bool = False


@dataclass
class Inventory:
    """Every test of a workspace. unit_files: package name -> its test_*.py files."""

    unit_files: dict[str, list[Path]] = field(default_factory=dict)
    rostests: list[Rostest] = field(default_factory=list)
    packages: set[str] = field(default_factory=set)

    def all_unit_files(self) -> list[Path]:
        return [path for name in sorted(self.unit_files) for path in self.unit_files[name]]


@dataclass
class Selection:
    """The tests of one run. unit_targets are pytest's own arguments: files or node ids.

    left_out: long rostests that were selected and do not run.
    """

    linters: list[str]
    unit_targets: list[str]
    rostests: list[Rostest]
    pytest_arguments: list[str]
    is_whole_suite: bool
    left_out: list[Rostest] = field(default_factory=list)


def take_inventory(root: Path) -> Inventory:
    """Find all packages and tests below root/src and root/tests; links are not followed, CATKIN_IGNORE is honoured."""
    inventory = Inventory()
    for top in (root / "src", root / "tests"):
        for folder, subfolders, names in os.walk(top):
            if "CATKIN_IGNORE" in names:
                subfolders.clear()
                continue
            subfolders.sort()
            _add_folder(inventory, root, Path(folder), sorted(names))
    return inventory


def _add_folder(inventory, root, folder, names):
    if "package.xml" in names:
        inventory.packages.add(_package_name(folder / "package.xml"))
    in_tests = folder.parent == root / "tests" or folder.parent.name == "test"
    if folder.name == "unit" and in_tests:
        files = [folder / name for name in names if re.fullmatch(r"test_.*\.py", name)]
        if files:
            inventory.unit_files.setdefault(_package_of(folder, root), []).extend(files)
    elif folder.name == "rostest" and in_tests:
        for name in names:
            if name.endswith(".test"):
                path = folder / name
                text = path.read_text(encoding="utf-8")
                marks = (f"<!-- {mark} -->" in text for mark in ("long", "beside others"))
                inventory.rostests.append(Rostest(path, _package_of(folder, root), *marks))


def _package_of(folder, root):
    """Name of the package that a folder belongs to; of no package: the workspace itself."""
    while folder != root:
        if (folder / "package.xml").is_file():
            return _package_name(folder / "package.xml")
        folder = folder.parent
    return "workspace"


def _package_name(manifest):
    return ElementTree.parse(manifest).getroot().findtext("name").strip()


def select(inventory: Inventory, arguments: list[str], long: bool) -> Selection:
    """What to run for a command line; raises SelectionError for an unknown name.

    Names are packages, test files (with or without folder and suffix), pytest node ids, or a linter. Everything that
    starts with a dash goes to pytest. Without any name everything runs; with pytest arguments alone, the unit layer.
    """
    names, pytest_arguments = _split(arguments)
    rostests = [test for test in inventory.rostests if long or not test.is_long]
    if not names:
        unit_targets = [str(path) for path in inventory.all_unit_files()]
        if pytest_arguments:
            return Selection([], unit_targets, [], pytest_arguments, False)
        return Selection(list(LINTERS), unit_targets, rostests, [], True, _without(inventory.rostests, rostests))
    selection = Selection([], [], [], pytest_arguments, False)
    for name in names:
        _add_named(selection, inventory, long, name)
    # A package and one of its files may both have been named.
    selection.unit_targets = list(dict.fromkeys(selection.unit_targets))
    chosen = list(dict.fromkeys(selection.rostests))
    selection.rostests = chosen
    selection.left_out = _without(dict.fromkeys(selection.left_out), chosen)
    return selection


def _without(tests, others):
    return [test for test in tests if test not in others]


def _split(arguments):
    names, pytest_arguments = [], []
    rest = iter(arguments)
    for argument in rest:
        if argument in _OPTIONS_WITH_VALUE:
            pytest_arguments += [argument, *([value] if (value := next(rest, None)) is not None else [])]
        elif argument.startswith("-"):
            pytest_arguments.append(argument)
        else:
            names.append(argument)
    return names, pytest_arguments


def _add_named(selection, inventory, long, name):
    if name in LINTERS:
        selection.linters.append(name)
        return
    if name in inventory.packages | set(inventory.unit_files):
        selection.unit_targets += [str(path) for path in inventory.unit_files.get(name, [])]
        for test in inventory.rostests:
            if test.package == name:
                (selection.left_out if test.is_long and not long else selection.rostests).append(test)
        return
    file_name, _, test_id = name.partition("::")
    unit = [path for path in inventory.all_unit_files() if _means(file_name, path, ".py")]
    # A long rostest that is called by its own name runs without --long.
    ros = [test for test in inventory.rostests if _means(file_name, test.path, ".test")]
    if not unit and not ros:
        raise SelectionError(
            f"'{name}' is not a package, a test file or a pytest option. "
            f"Packages: {', '.join(sorted(inventory.packages))}"
        )
    selection.unit_targets += [f"{path}::{test_id}" if test_id else str(path) for path in unit]
    selection.rostests += ros


def _means(name, path, suffix):
    """Whether a name on the command line means this test file."""
    if "/" in name:
        return Path(name).resolve() == path.resolve()
    return name in (path.name, path.name.removesuffix(suffix))
