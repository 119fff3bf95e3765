# SPDX-License-Identifier: BSD-3-Clause
"""The fenced blocks of the project's pages that are marked for running, and the folder they run in.

The words after the opening fence: the language, then any of

    run          a bash block that needs no simulator; runs with the quick tests
    run lab      needs a running lab: the page's own (run start), else Baxter's, enabled and without a window
    run start    starts the page's own lab: one command that runs until the end of the page
    run long     a bash block that takes long; runs with the long tests
    file=PATH    no command: the block is a file of this name, for the blocks after it
"""
import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^```(\S*)[ ]*([^\n]*)\n(.*?)^```[ ]*$", re.MULTILINE | re.DOTALL)
KINDS = {("run",): "quick", ("run", "lab"): "lab", ("run", "start"): "start", ("run", "long"): "long"}


class PageError(Exception):
    """A block has an invalid mark; the text names page and line."""


@dataclass(frozen=True)
class Block:
    """One marked block. ``kind``: quick, lab, start, long or file; ``path``: a file's, relative to the workspace."""

    page: str
    line: int
    kind: str
    text: str
    path: str = ""


def marked_blocks(page: str, text: str) -> list[Block]:
    """The marked blocks of a page, in order; blocks without a mark are left out. Raises :class:`PageError`."""
    blocks = []
    for match in FENCE.finditer(text):
        language, words, body = match[1], tuple(match[2].split()), match[3]
        line = text.count("\n", 0, match.start()) + 1
        if not words:
            continue
        if len(words) == 1 and words[0].startswith("file="):
            blocks.append(Block(page, line, "file", body, words[0].removeprefix("file=")))
        elif words in KINDS and language == "bash":
            blocks.append(Block(page, line, KINDS[words], body))
        else:
            marks = ", ".join(" ".join(kind) for kind in KINDS)
            raise PageError(f"{page}:{line}: found '{language} {' '.join(words)}', expected no mark, file=PATH, "
                            f"or bash with one of: {marks}")
    return blocks


def make_workspace(folder: Path, root: Path) -> None:
    """Make in ``folder`` a copy of the workspace ``root`` by links, with its own ``src`` for files that pages write."""
    for entry in Path(root).iterdir():
        if entry.name not in ("src", ".git", ".baxter"):
            (folder / entry.name).symlink_to(entry)
    (folder / "src").mkdir()


def write_file(block: Block, folder: Path) -> None:
    """Write a file block to its path; a page must not write outside of the folder, nor overwrite files."""
    path = (Path(folder) / block.path).resolve()
    if Path(folder).resolve() not in path.parents:
        raise PageError(f"{block.page}:{block.line}: file={block.path} is outside of the workspace")
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("x", encoding="utf-8") as file:
        file.write(block.text)


def environment(folder: Path, **variables: str) -> dict[str, str]:
    """The environment of commands in ``folder``: packages written there are found, as after ``catkin_make``."""
    sources = sorted(str(path) for path in (Path(folder) / "src").glob("*/src"))
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([*sources, os.environ.get("PYTHONPATH", "")]),
        "ROS_PACKAGE_PATH": os.pathsep.join([f"{folder}/src", os.environ.get("ROS_PACKAGE_PATH", "")]),
        **variables,
    }


def command(block: Block) -> list[str]:
    """The command that runs a block."""
    return ["bash", "-euo", "pipefail", "-c", block.text]


def run(block: Block, folder: Path, limit_s: float, **variables: str) -> None:
    """Run a block in ``folder``; raises AssertionError with its page, line and output unless it succeeds in time."""
    place = f"{block.page}:{block.line}"
    try:
        done = subprocess.run(command(block), cwd=folder, env=environment(folder, **variables), timeout=limit_s,
                              text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    except subprocess.TimeoutExpired as error:
        said = (error.output or b"").decode(errors="replace")
        raise AssertionError(f"{place} has not ended after {limit_s} s:\n{block.text}{said}") from None
    if done.returncode != 0:
        raise AssertionError(f"{place} ends with {done.returncode}:\n{block.text}{done.stdout}")
