# SPDX-License-Identifier: BSD-3-Clause
"""The students' copy of the workspace: everything except solutions and files that reveal them. Free of ROS.

`./baxter.sh handout FOLDER`. Needs no build: it copies the files that git tracks, or, without git, those that no build
makes.
"""
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from rf_checks import similarity

#: Left out: solutions, and tests that contain them or their programs.
LEFT_OUT = ("src/rf_labs/rf_checks/exercises/solutions", "src/rf_labs/rf_checks/test", "src/rf_labs/rf_lab2/test",
            ".git", ".ci")
#: Finished nodes that are also exercises: they stay as empty files, because packages install them.
STUBBED = {"src/rf_labs/rf_lab2/nodes/tf_listener.py": "tf_listener", "src/rf_labs/rf_lab2/nodes/wave.py": "wave"}
#: Tag of notebook cells that solve an exercise.
SOLUTION_TAG = "solution"
_YOUR_TURN = "# Your turn: this cell is an exercise."
# Files that builds and runs leave in a workspace.
_MADE = frozenset((".baxter", ".venv", "build", "devel", "install", "logs", "src_overlay", "__pycache__", ".git",
                   ".ipynb_checkpoints", ".pytest_cache", ".ruff_cache", ".catkin_workspace"))
_STUB = '''#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""This node is an exercise of the course: ./baxter.sh check --start %(exercise)s"""
import sys

sys.exit("%(name)s is yours to write: ./baxter.sh check --start %(exercise)s gives you something to begin with")
'''


class HandoutFailed(Exception):
    """The copy cannot be made, or would reveal a solution; the text says why."""


def is_left_out(name):
    """Whether a file, named relative to the workspace, does not belong to the copy."""
    return any(name == left or name.startswith(left + "/") for left in LEFT_OUT)


def stub(name):
    """The program (text) that stands for a node of STUBBED."""
    return _STUB % {"exercise": STUBBED[name], "name": Path(name).name}


def names(workspace):
    """Names of the workspace's own files, relative to it; links among them."""
    try:
        done = subprocess.run(["git", "-C", str(workspace), "ls-files", "-z", "--cached", "--others",
                               "--exclude-standard"], capture_output=True, check=True)
        found = [os.fsdecode(name) for name in done.stdout.split(b"\0") if name]
    except (OSError, subprocess.CalledProcessError):
        found = []
        for folder, below, files in os.walk(workspace):
            below[:] = [name for name in below if name not in _MADE]
            found += [os.path.relpath(os.path.join(folder, name), workspace) for name in files]
    return sorted(name for name in found if os.path.lexists(os.path.join(workspace, name)))


def emptied_notebook(text):
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


def make(workspace, target):
    """Copy the workspace into the folder `target`, which must not exist or must be empty; returns the number of files.

    Raises HandoutFailed, OSError.
    """
    workspace, target = Path(workspace).resolve(), Path(target).absolute()
    if target.is_symlink():
        raise HandoutFailed("%s is a link, to %s; name a folder" % (target, os.readlink(target)))
    if target.resolve() == workspace or workspace in target.resolve().parents:
        raise HandoutFailed("%s lies in the workspace itself; name a folder elsewhere" % target)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise HandoutFailed("%s is there already and not an empty folder" % target)
    kept = [name for name in names(workspace) if not is_left_out(name)]
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
    revealing = leaks(workspace, target, kept)
    if revealing:
        shutil.rmtree(target)
        raise HandoutFailed("the copy would reveal solutions: %s" % "; ".join(revealing))
    return len(kept)


def leaks(workspace, target, kept):
    """Sentences on files of the copy that are, or hold, a solution."""
    library = similarity.Library(workspace)
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


def _is_script(path):
    with open(path, "rb") as file:
        return file.read(64).startswith((b"#!/usr/bin/env python3", b"#!/usr/bin/python3"))


def main(words=None):
    """Returns the exit status: 0 done, 1 not possible, 2 wrong arguments."""
    words = sys.argv[1:] if words is None else words
    if len(words) != 1 or words[0].startswith("-"):
        print("usage: ./baxter.sh handout FOLDER\n\nMakes the students' copy of this workspace in FOLDER: without "
              "solutions, the tests that hold them, solved\ncells of notebooks, and history.", file=sys.stderr)
        return 0 if words in (["-h"], ["--help"]) else 2
    workspace = os.environ.get("LAB_ROOT") or Path(__file__).resolve().parents[5]
    try:
        count = make(workspace, words[0])
    except (HandoutFailed, OSError) as error:
        print("handout: %s" % error, file=sys.stderr)
        return 1
    print("%d files are in %s, without solutions. There: ./baxter.sh check --list" % (count, words[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
