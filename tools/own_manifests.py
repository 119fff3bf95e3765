#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Say what is wrong with the package.xml of the packages in src that are not the lab's, one line each.

    own_manifests.py ROOT FOLDER…

A file that is no XML stops every command that looks for a package, the lab's too, and none of them names the file. One
that catkin refuses, as without a name or with a wrong address, ends rosmsg, catkin_make and set-up.
Exit code 0: nothing is wrong; 1: something is.
"""

import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree

# A package in src/overlay may have the name of one of the lab's: it is built in its place.
OVERLAY = "overlay"


def manifests(folder: Path) -> Iterator[Path]:
    """The package.xml files below a folder that catkin sees."""
    seen: set[str] = set()
    for place, folders, files in os.walk(folder, followlinks=True):
        real = os.path.realpath(place)
        if "CATKIN_IGNORE" in files or real in seen:  # a link may lead to a folder above it
            folders[:] = []
        elif os.path.isfile(os.path.join(place, "package.xml")):  # a pipe would never end
            folders[:] = []
            yield Path(place) / "package.xml"
        else:
            folders[:] = sorted(name for name in folders if not name.startswith("."))
        seen.add(real)


def problems(root: Path, own: Iterable[str]) -> list[str]:
    """Sentences about the packages of the folders `own` of root/src: no XML, nothing that catkin takes, a name that
    another package has."""
    own, found, owners = list(own), [], {}
    labs = [path.name for path in (root / "src").iterdir() if path.is_dir() and path.name not in (OVERLAY, *own)]
    for folder in (*sorted(labs), *own):
        for path in manifests(root / "src" / folder):
            place = str(path.parent.relative_to(root))
            try:
                name = _name(path)
            except (ElementTree.ParseError, OSError, ValueError) as error:
                found.append(f"{place}/package.xml cannot be read: {error}. Until it is mended no command finds any "
                             f"package. Mend it, or leave the package out: touch {place}/CATKIN_IGNORE")
                continue
            if folder in own and (refusal := _refusal(path)):
                found.append(f"{place}/package.xml is refused: {refusal}. Until it is mended, commands such as rosmsg "
                             "and catkin_make end with InvalidPackage. Mend it, or leave the package out: touch "
                             f"{place}/CATKIN_IGNORE")
                continue
            if folder in own and name in owners:
                found.append(f"{place} has the name '{name}' of {owners[name]}: rename yours in package.xml and "
                             "CMakeLists.txt")
            owners.setdefault(name, place if folder in own else f"the lab's {place}")
    return found


def _name(path: Path) -> str:
    """Raises ElementTree.ParseError, OSError, ValueError."""
    return (ElementTree.parse(path).findtext("name") or "").strip()


def _refusal(path: Path) -> str:
    """Why catkin does not take the package; empty if it does, or is not installed yet."""
    try:
        from catkin_pkg.package import InvalidPackage, parse_package
    except ImportError:  # the doctor of a workspace that is not set up
        return ""
    try:
        parse_package(str(path))
    except InvalidPackage as error:
        # The first line names the file.
        return "; ".join(str(error).splitlines()[1:]) or str(error)
    return ""


def main(arguments: list[str]) -> int:
    found = problems(Path(arguments[0]), arguments[1:])
    for sentence in found:
        print(f"baxter.sh: {sentence}", file=sys.stderr)
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
