# SPDX-License-Identifier: BSD-3-Clause
"""Finds the tests of the workspace, and selects those of a command line."""

from __future__ import annotations

import functools
import os
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

# Tests that have a short name on the command line.
LINTERS = {name: f"tests/unit/test_lint.py::test_{name}" for name in ("ruff", "catkin_lint")}
# The package of files at the root, whose tests look at the whole tree.
WHOLE_TREE = "workspace_tests"
# Workers, more than cores, that run only the .test files that leave the processor to others.
WORKERS_BESIDE_CORES = 2
# pytest options that take a value, which is not a test's name.
_OPTIONS_WITH_VALUE = set("-k -m -p -o -c -W -r -n --dist --maxfail --deselect --ignore --tb --durations --junitxml"
                          " --shuffle".split())
_DEPENDENCIES = ("depend", "build_depend", "build_export_depend", "exec_depend", "test_depend")


class SelectionError(Exception):
    """The command line names a test that does not exist."""


@functools.cache
def _has_mark(path: Path, mark: str) -> bool:
    # A file that is no text fails by its name when it runs.
    return path.suffix == ".test" and f"<!-- {mark} -->" in path.read_text(encoding="utf-8", errors="replace")


def is_long(path: Path) -> bool:
    """Whether a .test file takes minutes."""
    return _has_mark(path, "long")


def mostly_waits(path: Path) -> bool:
    """Whether a .test file leaves the processor to others: no simulator, a small one, or one slowed on purpose."""
    return _has_mark(path, "beside others")


def shares_its_lab(path: Path) -> bool:
    """Whether a .test file leaves its lab as it was, so that others with the same one can use it."""
    return _has_mark(path, "shared lab")


def runs_in_real_time(path: Path) -> bool:
    """Whether the labs of a .test file run in real time; others run ahead (rostests.SPEED)."""
    return _has_mark(path, "real time")


def looks_at_the_whole_tree(path: Path) -> bool:
    """Whether a test file says that it reads files of all packages."""
    text = path.read_text(encoding="utf-8", errors="replace")
    return re.search(r"^pytestmark = .*\bpytest\.mark\.tree\b", text, re.M) is not None


@dataclass
class Inventory:
    """Every test of a workspace.

    files: package -> its test_*.py and .test files; folders: package -> its folder; needs: package -> the packages of
    the workspace that its manifest names.
    """

    files: dict[str, list[Path]] = field(default_factory=dict)
    folders: dict[str, Path] = field(default_factory=dict)
    needs: dict[str, set[str]] = field(default_factory=dict)

    def all_files(self) -> list[Path]:
        return [path for name in sorted(self.files) for path in self.files[name]]


def take_inventory(root: Path) -> Inventory:
    """Find all packages and tests below root/src and root/tests; links are not followed, CATKIN_IGNORE is honoured."""
    inventory = Inventory()
    named: dict[str, set[str]] = {}
    for top in (root / "src", root / "tests"):
        for folder, subfolders, names in os.walk(top):
            if "CATKIN_IGNORE" in names:
                subfolders.clear()
                continue
            subfolders.sort()
            here = Path(folder)
            if "package.xml" in names:
                manifest = ElementTree.parse(here / "package.xml").getroot()
                package = (manifest.findtext("name") or "").strip()
                inventory.folders[package] = here
                named[package] = {(one.text or "").strip() for kind in _DEPENDENCIES for one in manifest.iter(kind)}
            if here.parent == root / "tests" or here.parent.name == "test":
                pattern = {"unit": r"test_.*\.py", "rostest": r".*\.test"}.get(here.name)
                found = [here / name for name in sorted(names) if pattern and re.fullmatch(pattern, name)]
                if found:
                    inventory.files.setdefault(package_of(here, root), []).extend(found)
    inventory.needs = {package: needs & set(named) for package, needs in named.items()}
    return inventory


def package_of(path: Path, root: Path) -> str:
    """Name of the package that a file or folder belongs to; of no package: that of the whole tree's tests."""
    for folder in (path, *path.parents):
        if folder == root:
            break
        if (folder / "package.xml").is_file():
            return (ElementTree.parse(folder / "package.xml").getroot().findtext("name") or "").strip()
    return WHOLE_TREE


@dataclass
class Selection:
    """The choice of tests: files and node ids, and its own arguments. ``title`` says it in words."""

    targets: list[str]
    pytest_arguments: list[str]
    title: str = "everything"


def select(inventory: Inventory, arguments: list[str], root: Path, changed: list[Path] | None = None) -> Selection:
    """The :class:`Selection` of a command line; raises SelectionError for an unknown name.

    Names are packages, folders, test files (with or without folder and suffix), pytest node ids, or a linter.
    Everything that starts with a dash goes to pytest. ``changed``: files; the tests of their packages, and of all that
    depend on them, run besides those that were named.
    """
    names, pytest_arguments = names_and_options(arguments)
    title = ", ".join(names) if changed is None else "what has changed"
    if changed is not None:
        if not changed and not names:
            return Selection([], pytest_arguments, "nothing: no file has changed")
        title = ", ".join([title, *names])
        packages = touched(inventory, changed, root)
        if changed:
            names += sorted(packages) + [f"{root}/{name}" for name in LINTERS.values()]
        if changed and WHOLE_TREE not in packages:
            names += [str(path) for path in inventory.files.get(WHOLE_TREE, []) if looks_at_the_whole_tree(path)]
    if not names:
        return Selection([str(path) for path in inventory.all_files()], pytest_arguments)
    targets = [target for name in names for target in _named(inventory, name, root)]
    # A package and one of its files may both have been named.
    return Selection(list(dict.fromkeys(targets)), pytest_arguments, title)


def changed_files(root: Path, since: str) -> list[Path]:
    """Files that differ from a commit, and new ones. Raises SelectionError where git does not know the commit."""
    found = []
    for words in (["diff", "--name-only", "--no-renames", "-z", since, "--"],
                  ["ls-files", "--others", "--exclude-standard", "-z"]):
        done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True)
        if done.returncode:
            raise SelectionError(f"--changed: git says: {done.stderr.strip()}")
        found += [root / name for name in done.stdout.split("\0") if name]
    return found


def touched(inventory: Inventory, changed: list[Path], root: Path) -> set[str]:
    """The packages of changed files and all that depend on them; the whole tree's tests only if they have changed."""
    users: dict[str, set[str]] = {}
    for package, needs in inventory.needs.items():
        for need in needs:
            users.setdefault(need, set()).add(package)
    found, waiting = set(), {package_of(path, root) for path in changed}
    while waiting:
        package = waiting.pop()
        found.add(package)
        # The whole tree's package names nearly all others, for its benches and long runs.
        waiting |= users.get(package, set()) - found - {WHOLE_TREE}
    return found & set(inventory.files)


def names_and_options(arguments: list[str]) -> tuple[list[str], list[str]]:
    """(names of tests, pytest's options with their values). Raises SelectionError for an option without its value."""
    names, pytest_arguments = [], []
    rest = iter(arguments)
    for argument in rest:
        if argument in _OPTIONS_WITH_VALUE:
            if (value := next(rest, None)) is None:
                raise SelectionError(f"{argument} needs a value")
            pytest_arguments += [argument, value]
        elif argument.startswith("-"):
            pytest_arguments.append(argument)
        else:
            names.append(argument)
    return names, pytest_arguments


def _named(inventory: Inventory, name: str, root: Path) -> list[str]:
    if name in LINTERS:
        return [f"{root}/{LINTERS[name]}"]
    if name in inventory.folders or name in inventory.files:
        return [str(path) for path in inventory.files.get(name, [])]
    if "/" in name and Path(name).is_dir():
        below = [path for path in inventory.all_files() if Path(name).resolve() in path.resolve().parents]
        if not below:
            raise SelectionError(f"there are no tests in the folder '{name}'")
        return [str(path) for path in below]
    file_name, separator, test_id = name.partition("::")
    found = [path for path in inventory.all_files() if _means(file_name, path)]
    if not found:
        raise SelectionError(
            f"'{name}' is not a package, a folder with a slash, a test file or a pytest option. "
            f"Packages: {', '.join(sorted(inventory.folders))}"
        )
    if test_id and len(found) > 1:
        # Files of several packages may have one name.
        function = test_id.partition("[")[0].rpartition("::")[2]
        found = [path for path in found if function in path.read_text(encoding="utf-8", errors="replace")] or found
    # A .test file that is called by its own name runs even if it is long, as one test does that is called so.
    return [f"{path}::rostest" if path.suffix == ".test" else f"{path}{separator}{test_id}" for path in found]


def _means(name: str, path: Path) -> bool:
    """Whether a name on the command line means this test file."""
    if "/" in name:
        return Path(name).resolve() == path.resolve()
    return name in (path.name, path.stem)
