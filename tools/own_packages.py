#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Build the packages in src that are not the lab's, one by one into the devel space; nothing else changes.

    own_packages.py ROOT FOLDER… [--make [--jobs=-jN] [--only [NAME…]]]

A package that has not changed since its last build is skipped, unless one of the user's own packages that it depends on
was built. With --make none is skipped: make decides, and talks on the terminal. Exit code 0: all are built; 1: a
package does not build, and standard error names it and its log.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from catkin_pkg.package import InvalidPackage, Package
from catkin_pkg.topological_order import topological_order

# Files that a build reads; as in fingerprint() of environment.bash, plus compiled code, which only make can check.
NAMES = ("package.xml", "CMakeLists.txt", "setup.py")
ENDINGS = (".msg", ".srv", ".action", ".cfg", ".c", ".cc", ".cpp", ".cxx", ".h", ".hpp")
LOG_LINES_SHOWN = 20


def packages(root: Path, folders: Iterable[str]) -> list[tuple[Path, Package]]:
    """(path, package) in build order. Raises InvalidPackage, RuntimeError."""
    found = []
    for folder in folders:
        for path, package in topological_order(str(root / "src" / folder)):
            # The function reports a cycle in place of a path.
            if path is None:
                raise RuntimeError(f"these packages depend on each other: {package}")
            found.append((root / "src" / folder / path, package))
    by_name = {package.name: (path, package) for path, package in found}
    ordered, placed = [], set()

    def place(name: str) -> None:
        if name not in by_name or name in placed:
            return
        placed.add(name)
        package = by_name[name][1]
        for needed in sorted(dependencies(package)):
            place(needed)
        ordered.append(by_name[name])

    for name in sorted(by_name):
        place(name)
    return ordered


def dependencies(package: Package) -> set[str]:
    return {one.name for kind in (package.build_depends, package.buildtool_depends, package.build_export_depends,
                                  package.exec_depends) for one in kind}


def state_of(path: Path) -> str:
    """A hash of all files that a build of the package reads."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")):
        if file.is_file() and ".git" not in file.parts and (
                file.name in NAMES or file.suffix in ENDINGS or "env-hooks" in file.parts):
            digest.update(f"{file.relative_to(path)}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def with_dependencies(ordered: list[tuple[Path, Package]], names: Iterable[str]) -> list[tuple[Path, Package]]:
    """The (path, package) of `names` and of all that they depend on, in the same order; of all, if `names` is empty."""
    wanted = set(names)
    for _, package in reversed(ordered):
        if package.name in wanted:
            wanted |= dependencies(package)
    return [(path, package) for path, package in ordered if not names or package.name in wanted]


def build(root: Path, path: Path, package: Package, output: IO[str] | None, configure: bool = True,
          jobs: str = "") -> None:
    """Build one package, configured before or not. Raises CalledProcessError.

    output: an open file, or None for the terminal. jobs: make's option, as "-j4"; one for each processor if empty.
    """
    folder = root / ".baxter" / "own" / package.name
    # Each configuration rewrites the setup files of the devel space, as if the package were a separate workspace.
    of_the_space = {file: file.read_bytes() for file in (root / "devel").iterdir() if file.is_file()}
    # Without -l: on a busy machine make would wait for other processes.
    commands = [["cmake", "--build", folder, "--", jobs or f"-j{os.cpu_count() or 1}"]]
    if configure:
        # CMake refuses the build folder of a package that has moved.
        cache = folder / "CMakeCache.txt"
        home = f"CMAKE_HOME_DIRECTORY:INTERNAL={path}"
        if cache.is_file() and home not in cache.read_text(errors="replace").splitlines():
            shutil.rmtree(folder)
        commands.insert(0, ["cmake", "-S", path, "-B", folder, f"-DCATKIN_DEVEL_PREFIX={root}/devel",
                            f"-DCMAKE_INSTALL_PREFIX={root}/install", f"-DPYTHON_EXECUTABLE={root}/.venv/bin/python3"])
    try:
        for command in commands:
            subprocess.run(command, stdout=output, stderr=output, stdin=subprocess.DEVNULL, check=True)
    finally:
        for file, content in of_the_space.items():
            if file.read_bytes() != content:
                file.write_bytes(content)


def parsed(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("root", type=Path)
    parser.add_argument("folders", nargs="*")
    parser.add_argument("--make", action="store_true")
    parser.add_argument("--jobs", default="")
    parser.add_argument("--only", nargs="*", default=[])
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    options = parsed(arguments)
    root = options.root
    logs = root / ".baxter" / "logs"
    stamps = root / ".baxter" / "own"
    for folder in (logs, stamps):
        folder.mkdir(parents=True, exist_ok=True)
    try:
        ordered = with_dependencies(packages(root, options.folders), options.only)
    except (InvalidPackage, RuntimeError) as error:
        print(f"baxter.sh: {error}", file=sys.stderr)
        return 1
    built = set()
    for path, package in ordered:
        stamp = stamps / f"{package.name}.stamp"
        state = f"{path} {state_of(path)}"
        is_built = (stamp.is_file() and stamp.read_text() == state and not dependencies(package) & built
                    and (stamps / package.name / "CMakeCache.txt").is_file())
        if is_built and not options.make:
            continue
        print(f"building {package.name} …", file=sys.stderr, flush=True)
        log = logs / f"own-{package.name}.log"
        try:
            if options.make:
                build(root, path, package, None, configure=not is_built, jobs=options.jobs)
            else:
                with log.open("wb") as output:
                    build(root, path, package, output)
        except subprocess.CalledProcessError:
            if options.make:
                print(f"catkin_make: the package {package.name} does not build", file=sys.stderr)
                return 1
            print(f"baxter.sh: the package {package.name} does not build (log: {log}). The log ends with:",
                  file=sys.stderr)
            for line in log.read_text(errors="replace").splitlines()[-LOG_LINES_SHOWN:]:
                print(f"  | {line}", file=sys.stderr)
            return 1
        if not is_built:
            stamp.write_text(state)
            built.add(package.name)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
