# SPDX-License-Identifier: BSD-3-Clause
"""The key of a verdict: a hash of what it depends on. Free of ROS.

A verdict is used again as long as its key is the same: the program with the modules that it imports, the exercise, the
seed, the robot, and the product's version.
"""
from __future__ import annotations

import hashlib
import json
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from rf_checks import handout

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise

_JUDGE = "rf_checks"
#: Libraries that change what a simulation computes.
_LIBRARIES = ("numpy", "pybullet", "numba")
_PAGES = (".md", ".rst", ".pyc", ".ipynb", ".png", ".jpg")
_NO_PART = frozenset(("test", "tests", "__pycache__", "node_modules", "docs"))


def packages_of(workspace: Path) -> dict[str, tuple[Path, set[str]]]:
    """{package name: (its folder, names that its package.xml depends on)} below the workspace's src."""
    found = {}
    for folder, below, names in os.walk(Path(workspace) / "src", followlinks=False):
        if "package.xml" in names:
            below.clear()
            try:
                root = ElementTree.parse(Path(folder) / "package.xml").getroot()
            except ElementTree.ParseError:
                continue
            needed = {tag.text.strip() for tag in root
                      if tag.text and tag.tag in ("depend", "exec_depend", "run_depend")}
            found[root.findtext("name", "").strip()] = Path(folder), needed
    return found


def judges_packages(workspace: Path) -> list[Path]:
    """Folders of the packages that a verdict depends on: the judge's, and those that it needs, sorted by name."""
    known, found, to_do = packages_of(workspace), {}, [_JUDGE]
    while to_do:
        name = to_do.pop()
        if name in known and name not in found:
            found[name], needed = known[name]
            to_do += needed
    return [found[name] for name in sorted(found)]


def product_version(workspace: Path) -> str:
    """16 hexadecimal digits: the same for the same judge, simulator and libraries, in a students' copy, too."""
    workspace = Path(workspace).resolve()
    digest = hashlib.sha256()
    for folder in judges_packages(workspace):
        for path in _files(folder):
            name = path.relative_to(workspace).as_posix()
            if handout.is_left_out(name) or name in handout.STUBBED:
                continue
            content = os.readlink(path).encode() if path.is_symlink() else path.read_bytes()
            digest.update(b"%s\0%s\0" % (name.encode(), hashlib.sha256(content).hexdigest().encode()))
    digest.update(json.dumps(_machine()).encode())
    return digest.hexdigest()[:16]


def _files(folder: Path) -> list[Path]:
    found = []
    for place, below, names in os.walk(folder):
        below[:] = [name for name in below if name not in _NO_PART and not name.startswith(".")]
        found += [Path(place) / name for name in names if not name.endswith(_PAGES)]
    return sorted(found)


def _machine() -> dict[str, str | None]:
    found: dict[str, str | None] = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def key(version: str, exercise: Exercise, conditions: dict[str, Any], name: str, files: dict[str, bytes]) -> str:
    """The key of one verdict, 32 hexadecimal digits.

    exercise: an Exercise. conditions: {"seed", "profile", "serial"}. name: of the program. files: {path: bytes} of the
    program and of the modules that it imports.
    """
    parts = [version, exercise.lab, exercise.name, sorted(conditions.items()), name,
             sorted((path, hashlib.sha256(content).hexdigest()) for path, content in files.items())]
    # Names of files on disk may hold bytes that are no UTF-8.
    return hashlib.sha256(json.dumps(parts).encode("ascii")).hexdigest()[:32]
