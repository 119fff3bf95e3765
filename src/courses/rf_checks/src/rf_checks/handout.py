# SPDX-License-Identifier: BSD-3-Clause
"""The students' copy of the workspace: everything except solutions and files that reveal them. Free of ROS.

`./baxter.sh handout FOLDER`. Needs no build. It copies what is in a list of what belongs to the workspace, and nothing
that merely lies there, as a roster or submissions: what git tracks, or, in a students' copy, that copy's own list. It
makes none in which a name or an address of a roster would be.
"""
from __future__ import annotations

import argparse
import codecs
import contextlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from command_line.user_files import read_file
from rf_checks import hidden_paths, roster, similarity

#: Left out: solutions, and tests that contain them or their programs.
LEFT_OUT = ("src/courses/rf_checks/exercises/solutions", "src/courses/rf_checks/test", "src/courses/rf_lab2/test",
            ".git", ".ci")
#: Finished nodes that are also exercises: they stay as empty files, because packages install them.
STUBBED = {"src/courses/rf_lab2/nodes/tf_listener.py": "tf_listener", "src/courses/rf_lab2/nodes/wave.py": "wave"}
#: Tag of notebook cells that solve an exercise.
SOLUTION_TAG = "solution"
_YOUR_TURN = "# Your turn: this cell is an exercise."
#: In a students' copy, which git does not track: the names of its files, one a line.
LIST = "files_of_this_copy.txt"
# A file that every workspace has: a list without it is another project's.
_OF_EACH = "baxter.sh"
# Folders that builds leave in a workspace, without rosters in them.
_MADE = frozenset((".baxter", ".venv", "build", "devel", "install", "__pycache__", ".git"))
#: Larger ones are neither rosters nor texts [bytes].
MAX_TEXT_BYTES = 20 << 20
#: The record of a class of `./baxter.sh labs`, below the user's folder of states.
_CLASS = "baxter_labs/class.json"
_ADDRESS = re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)+")
_WORD = re.compile(r"[^\W\d_]+")
# A letter as JSON may write it; the most words of a name.
_ESCAPE = re.compile(r"\\u([0-9a-fA-F]{4})")
_MAX_WORDS = 6
_STUB = '''#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""This node is an exercise of the course: ./baxter.sh check --start %(exercise)s"""
import sys

sys.exit("%(name)s is yours to write: ./baxter.sh check --start %(exercise)s gives you something to begin with")
'''


class HandoutFailed(Exception):
    """The copy cannot be made, or would reveal a solution or a student; the text says why."""


def is_left_out(name: str) -> bool:
    """Whether a file, named relative to the workspace, does not belong to the copy."""
    return any(name == left or name.startswith(left + "/") for left in LEFT_OUT)


def stub(name: str) -> str:
    """The program (text) that stands for a node of STUBBED."""
    return _STUB % {"exercise": STUBBED[name], "name": Path(name).name}


def _git(workspace: Path, *words: str) -> list[str]:
    done = subprocess.run(["git", "-C", str(workspace), "ls-files", "-z", *words], capture_output=True, check=True)
    return [os.fsdecode(name) for name in done.stdout.split(b"\0") if name]


def names(workspace: Path) -> list[str]:
    """Names of the files that belong to the workspace, relative to it, links among them. Raises HandoutFailed."""
    try:
        found = _git(workspace, "--cached")
    except (OSError, subprocess.CalledProcessError):
        found = []
    if _OF_EACH not in found:
        try:
            found = (workspace / LIST).read_text(encoding="utf-8").splitlines()
        except (OSError, ValueError):
            raise HandoutFailed(
                "there is no list of what belongs to the workspace: git does not track %s, and there is no %s. Work in "
                "a clone; or, in a fresh download, before you add files of your own: git init && git add ." % (
                    workspace, LIST)) from None
    # The entry of a submodule is a folder.
    return sorted(name for name in found if os.path.islink(os.path.join(workspace, name))
                  or os.path.isfile(os.path.join(workspace, name)))


def left_here(workspace: Path) -> list[str]:
    """Names of files that git neither tracks nor ignores; [] without git."""
    try:
        return _git(workspace, "--others", "--exclude-standard")
    except (OSError, subprocess.CalledProcessError):
        return []


def folded(text: str) -> str:
    """A text as names are compared: without case, and letters with marks in one form, however it was written."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def decoded(data: bytes) -> str:
    """The text of a file in whatever encoding: UTF-8, UTF-16 with its mark, or an older one of the West; and once more
    what JSON has escaped in it.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")
    plain = _ESCAPE.sub(lambda match: chr(int(match[1], 16)), text)
    return text if plain == text else "%s\n%s" % (text, plain)


def people(text: str, source: str) -> dict[str, str]:
    """{full name or address, folded: where it is from} of a roster's text. Raises roster.RosterError."""
    found = [" ".join(_WORD.findall(folded(student.full_name))) for student in roster.read(text)]
    # A single word, as of a first name or of "Student 7", is in many texts.
    return dict.fromkeys([name for name in found if " " in name] + _ADDRESS.findall(folded(text)), source)


def people_of_table(text: str, source: str) -> dict[str, str]:
    """As `people`, of a table that is no roster in form. In a line with an address, cells of several words are names,
    and so are two cells of one word beside each other. What several addresses have is none, as their course.
    """
    owners: dict[str, set[str]] = {}
    for line in folded(text).splitlines():
        addresses = _ADDRESS.findall(line)
        if not addresses:
            continue
        cells = [_WORD.findall(cell) for cell in re.split(r"[,;\t|]", line) if "@" not in cell]
        names = [" ".join(words) for words in cells if 2 <= len(words) <= _MAX_WORDS]
        names += [" ".join(a + b) for a, b in itertools.pairwise(cells) if len(a) == len(b) == 1]
        for name in (*addresses, *names):
            owners.setdefault(name, set()).add(addresses[0])
    return {name: source for name, found in owners.items() if "@" in name or len(found) == 1}


def known_people(workspace: Path, given: Iterable[Path | str], environment: Mapping[str, str]) -> dict[str, str]:
    """As `people`, of the rosters in ``given`` (paths), of all tables in the workspace, and of the user's class.

    Raises HandoutFailed for a given one that cannot be read.
    """
    found = {}
    for path in given:
        try:
            found.update(people(roster.text_of(read_file(path, MAX_TEXT_BYTES)), str(path)))
        except (OSError, roster.RosterError) as error:
            raise HandoutFailed("the roster %s cannot be read: %s" % (path, getattr(error, "strerror", error))
                                ) from error
    for folder, below, files in os.walk(workspace):
        below[:] = [name for name in below if name not in _MADE]
        for name in files:
            path = Path(folder) / name
            if name.lower().endswith((".csv", ".tsv")) and path.is_file() and path.stat().st_size <= MAX_TEXT_BYTES:
                source = os.path.relpath(path, workspace)
                with contextlib.suppress(OSError):
                    text = decoded(path.read_bytes())
                    try:
                        found.update(people(text, source))
                    except roster.RosterError:
                        found.update(people_of_table(text, source))
    states = environment.get("XDG_STATE_HOME") or os.path.join(os.path.expanduser("~"), ".local", "state")
    try:
        students = json.loads((Path(states) / _CLASS).read_text(encoding="utf-8"))["students"]
        for _, full_name in students:
            name = " ".join(_WORD.findall(folded(full_name)))
            found.update({name: "the class of ./baxter.sh labs"} if " " in name else {})
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass  # no class, or of another version
    return found


def named_people(text: str, known: dict[str, str]) -> list[str]:
    """Those of ``known``, as `people` gives them, that a text names: also last name first, and in a file's name."""
    plain = folded(text)
    words = _WORD.findall(plain)
    there = set(words)
    found = [address for address in dict.fromkeys(_ADDRESS.findall(plain)) if address in known]
    joined = None
    for name in known:
        parts = name.split()
        if "@" in name or not there.issuperset(parts):
            continue
        joined = joined or " %s " % " ".join(words)
        if any(" %s " % " ".join(order) in joined for order in (parts, [parts[-1], *parts[:-1]])):
            found.append(name)
    return found


def emptied_notebook(text: str) -> str:
    """A notebook (text) without outputs, and without the code of cells tagged as solutions."""
    notebook = json.loads(text)
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        cell["outputs"], cell["execution_count"] = [], None
        if SOLUTION_TAG in cell["metadata"].get("tags", ()):
            cell["source"] = [_YOUR_TURN]
            cell["metadata"]["tags"].remove(SOLUTION_TAG)
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def make(workspace: Path, target: Path | str, rosters: Iterable[Path | str] = (),
         environment: Mapping[str, str] = os.environ) -> int:
    """Copy the workspace into the folder `target`, which must not exist or must be empty; returns the number of files.

    rosters: paths of further rosters, whose names must not be in it. Raises HandoutFailed, OSError.
    """
    workspace, target = Path(workspace).resolve(), Path(target).absolute()
    if target.is_symlink():
        raise HandoutFailed("%s is a link, to %s; name a folder" % (target, os.readlink(target)))
    if target.resolve() == workspace or workspace in target.resolve().parents:
        raise HandoutFailed("%s lies in the workspace itself; name a folder elsewhere" % target)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise HandoutFailed("%s is there already and not an empty folder" % target)
    kept = [name for name in names(workspace) if not is_left_out(name) and name != LIST]
    known = known_people(workspace, rosters, environment)
    for name in kept:
        source, copy = workspace / name, target / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        if source.is_symlink():
            os.symlink(os.readlink(source), copy)
        elif name in STUBBED:
            copy.write_text(stub(name), encoding="utf-8")
            shutil.copymode(source, copy)
        elif name.endswith(".ipynb"):
            copy.write_text(emptied_notebook(source.read_text(encoding="utf-8")), encoding="utf-8")
        else:
            shutil.copy2(source, copy)
    (target / LIST).write_text("".join(name + "\n" for name in [*kept, LIST]), encoding="utf-8",
                               errors="surrogateescape")
    for what, revealing in (("solutions", leaks(workspace, target, kept)), ("students", told(target, kept, known))):
        if revealing:
            shutil.rmtree(target)
            raise HandoutFailed("the copy would reveal %s: %s" % (what, "; ".join(revealing)))
    return len(kept)


def told(target: Path, kept: list[str], known: dict[str, str]) -> list[str]:
    """Sentences on files of the copy that name students. known: as `known_people` gives it."""
    found = []
    for name in kept if known else ():
        path = target / name
        text = ""
        if not path.is_symlink() and path.is_file() and path.stat().st_size <= MAX_TEXT_BYTES:
            text = decoded(path.read_bytes())
        there = named_people("%s\n%s" % (name, text), known)
        if there:
            found.append("%s names %s, of %s" % (name, there[0] if len(there) == 1 else "%s and %d more" % (
                there[0], len(there) - 1), known[there[0]]))
    return found


def leaks(workspace: Path, target: Path, kept: list[str]) -> list[str]:
    """Sentences on files of the copy that are, or hold, a solution."""
    library = similarity.References(workspace)
    skeletons = library.handed_out[:library.skeleton_count]
    found = []
    for name in kept:
        path = target / name
        if path.is_symlink() or not path.is_file():
            continue
        text = ""
        if name.endswith(".ipynb"):
            text = similarity.notebook_code(path)
        elif name.endswith(".py") or _is_script(path):
            text = path.read_text(encoding="utf-8", errors="replace")
        if "rospy" not in text:  # no program of an exercise
            continue
        found += ["%s is like %s" % (name, one.name) for one in similarity.compare(text, library.references, skeletons)
                  if one.of_reference >= similarity.COPY_SHARE]
    return found


def _is_script(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(64).startswith((b"#!/usr/bin/env python3", b"#!/usr/bin/python3"))


def main(words: list[str] | None = None) -> Any:
    """Returns the exit status: 0 done, 1 not possible, 2 wrong arguments."""
    parser = argparse.ArgumentParser(
        prog="./baxter.sh handout", description="Make the students' copy of this workspace in FOLDER: the files that "
        "git tracks, without solutions, the tests that hold them, solved cells of notebooks, and history. It is not "
        "made where a name or an address of a roster would be in it: of tables in the workspace, and of the class of "
        "./baxter.sh labs.")
    parser.add_argument("folder", metavar="FOLDER")
    parser.add_argument("--roster", metavar="FILE", action="append", default=[],
                        help="a further roster, as for ./baxter.sh labs up; may be repeated")
    try:
        options = parser.parse_args(words)
    except SystemExit as end:
        return end.code
    workspace = hidden_paths.workspace()
    try:
        count = make(workspace, options.folder, options.roster)
    except (HandoutFailed, OSError) as error:
        print("handout: %s" % error, file=sys.stderr)
        return 1
    others = left_here(workspace)
    if others:
        print("%d files that git does not track are not in it, as %s; `git add` what belongs to the workspace"
              % (len(others), ", ".join(others[:3])))
    print("%d files are in %s, without solutions. There: ./baxter.sh check --list" % (count, options.folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
