# SPDX-License-Identifier: BSD-3-Clause
"""The files of a student's program: the program, and the modules beside it that it imports. Free of ROS."""
from __future__ import annotations

import ast
import io
import os
import stat
import tokenize
from pathlib import Path

#: Largest size of a program [bytes, files].
LARGEST_BYTES, MAX_FILES = 1 << 20, 50


class BadSubmission(Exception):
    """The program is refused; the text says why."""


def read(path: Path, most_bytes: int = LARGEST_BYTES) -> bytes:
    """The bytes of a regular file that is not a link. Raises BadSubmission, OSError."""
    # Never wait for a pipe; and a link could lead to a file that only the judge may read.
    if os.path.islink(path):
        raise BadSubmission("%s is a link, to %s; a program is a file of its own" % (path, os.readlink(path)))
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise BadSubmission("%s is not a file" % path)
        if status.st_size > most_bytes:
            raise BadSubmission("%s has %d bytes; no more than %d are taken" % (path, status.st_size, most_bytes))
        return file.read(most_bytes)


def files(program: Path) -> dict[str, bytes]:
    """{name below the program's folder: bytes} of the program (Path) and of the modules beside it that it imports.

    Raises BadSubmission, OSError.
    """
    folder, found = program.parent, {program.name: read(program)}
    to_read = [program.name]
    while to_read:
        name = to_read.pop()
        for module in sorted(imported(found[name])):
            top = module.split(".")[0]
            package = folder / top
            is_package = package.is_dir() and not package.is_symlink()
            beside = [folder / (top + ".py"), *(sorted(package.glob("**/*.py")) if is_package else ())]
            for path in beside:
                relative = str(path.relative_to(folder))
                if relative in found or path.is_symlink() or not path.is_file():
                    continue
                if len(found) >= MAX_FILES:
                    raise BadSubmission("%s imports more than %d files beside it" % (program, MAX_FILES))
                found[relative] = read(path)
                to_read.append(relative)
    return found


def texts(program: Path) -> dict[str, str]:
    """As `files`, decoded."""
    return {name: decoded(content) for name, content in files(program).items()}


def decoded(content: bytes) -> str:
    """The text of a program (bytes) in the encoding that its first lines name, as Python reads it, without the mark
    that Windows puts before UTF-8; other bytes are replaced."""
    try:
        return content.decode(tokenize.detect_encoding(io.BytesIO(content).readline)[0], errors="replace")
    # The line names no encoding, or one that is none of texts.
    except (SyntaxError, LookupError, UnicodeError):
        return content.decode("utf-8-sig", errors="replace")


def imported(source: bytes) -> set[str]:
    """Names of the modules that a program (bytes) imports, as far as its text shows them."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


def copy(program: Path, folder: str) -> tuple[str, ...]:
    """Copy `files` into an empty folder; returns the names. Raises BadSubmission, OSError."""
    found = files(program)
    for name, content in found.items():
        target = Path(folder) / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        target.chmod(0o755)
    return tuple(found)
