# SPDX-License-Identifier: BSD-3-Clause
"""Refuse Python 2 in other people's packages, with file and line, before the build.

    python3 tools/check_overlay.py FOLDER
"""

import ast
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

SHOWN = 10


def is_python(path: Path) -> bool:
    """Whether a file is Python: by its suffix, or by a first line that starts a Python interpreter."""
    if path.suffix == ".py":
        return True
    if path.suffix:
        return False
    with path.open("rb") as file:
        first = file.readline(200)
    return first.startswith(b"#!") and b"python" in first


def findings(folder: Path) -> Iterator[tuple[Path, int, str]]:
    """(path, line, error) of each file that Python 3 cannot parse."""
    for path in sorted(folder.rglob("*")):
        if ".git" in path.parts or not path.is_file() or not is_python(path):
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                ast.parse(path.read_bytes(), str(path))
        except (SyntaxError, ValueError) as error:
            yield path, getattr(error, "lineno", None) or 1, getattr(error, "msg", None) or str(error)


def main(argv: list[str]) -> int:
    folder = Path(argv[0])
    found = list(findings(folder))
    for path, line, what in found[:SHOWN]:
        print(f"{path}:{line}: {what}", file=sys.stderr)
    if not found:
        return 0
    print(
        f"{len(found)} files in {folder} are not Python 3. Take a Python 3 branch or fork of that "
        f"package, or convert it (2to3 does most of it), or remove its folder.",
        file=sys.stderr,
    )
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
