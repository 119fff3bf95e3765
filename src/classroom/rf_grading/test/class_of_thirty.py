#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Write thirty submissions of mixed quality into a new folder: `class_of_thirty.py FOLDER`. For tests and trials.

Programs are those of rf_checks: solutions, skeletons, and the judge's wrong and hostile ones.
"""
import io
import json
import sys
import tarfile
import zipfile
from pathlib import Path

CHECKS = Path(__file__).resolve().parents[3] / "courses" / "rf_checks"
#: Looks for what it must not see, and says so.
SPY = """import os, socket
seen = []
for top, below, names in os.walk("/"):
    below[:] = [name for name in below if name not in ("proc", "sys", "usr", "opt", "dev")]
    seen += [os.path.join(top, name) for name in names
             if name in ("verdicts.jsonl", "tasks.json", "solution.py", "judge.py") or "assignsubmission" in top
             or "assignsubmission" in name or "class_of_thirty" in top]
try:
    socket.create_connection(("192.0.2.1", 80), 1.0)
    seen.append("the network")
except OSError:
    print("no network")
print("seen:", sorted(seen))
"""
PYTHON2 = "import rospy\nprint 'waiting'\ntry:\n    rospy.init_node('a')\nexcept Exception, e:\n    print e\n"
#: Entry -> (how it is sent, exercise, folder and name of the program in rf_checks, or its text).
CLASS = {
    "Anna Groß_100001_assignsubmission_file_": ("folder", "rotate_gripper", "exercises/solutions/rotate_gripper.py"),
    "Björn Ek_100002_assignsubmission_file_": ("flat", "rotate_gripper", "exercises/solutions/rotate_gripper.py"),
    "chen": ("zip", "rotate_gripper", "exercises/solutions/rotate_gripper.py"),
    "david": ("tar", "tf_listener", "exercises/solutions/tf_listener.py"),
    "élodie": ("notebook", "tf_listener", "exercises/solutions/tf_listener.py"),
    "fatima": ("file", "tf_listener", "exercises/solutions/tf_listener.py"),
    "goran": ("folder", "joint_command", "exercises/solutions/joint_command.py"),
    "hana": ("zip in a folder", "joint_command", "exercises/solutions/joint_command.py"),
    "ivan": ("folder", "rotate_gripper", "exercises/skeletons/rotate_gripper.py"),
    "jana": ("folder", "rotate_gripper", "test/wrong/degrees.py"),
    "karim": ("folder", "rotate_gripper", "test/wrong/exits_early.py"),
    "lena": ("folder", "rotate_gripper", "test/wrong/infinite_loop.py"),
    "mia": ("folder", "rotate_gripper", "test/wrong/quaternion_order.py"),
    "nils": ("folder", "rotate_gripper", "test/wrong/wrong_arm.py"),
    "olga": ("folder", "rotate_gripper", "test/wrong/syntax_error.txt"),
    "pavel": ("folder", "tf_listener", "test/wrong/tf_quaternion_order.py"),
    "quentin": ("folder", "tf_listener", "test/wrong/prints_made_up_matrices.py"),
    "rosa": ("folder", "joint_command", "test/wrong/floods.py"),
    "sven": ("folder", "joint_command", "test/wrong/creeps.py"),
    "tina": ("folder", "joint_command", "test/wrong/fakes_joint_states.py"),
    "umut": ("folder", "joint_command", "test/wrong/teleports.py"),
    "vera": ("folder", "joint_command", "test/wrong/runs_the_solution.py"),
    "wen": ("folder", "rotate_gripper", "test/wrong/kills_simulator.py"),
    "xenia": ("folder", "tf_listener", "test/wrong/shuts_master_down.py"),
    "yusuf": ("folder", "tf_listener", "test/wrong/fork_bomb.py"),
    "zoe": ("folder", "tf_listener", "test/wrong/fills_output.py"),
    "a spy": ("folder", "tf_listener", SPY),
    "python two": ("folder", "rotate_gripper", PYTHON2),
    "damaged": ("damaged zip", "", ""),
    "climber": ("climbing zip", "", ""),
}
#: Entry -> least and most points in its exercise. All others get at most 50, the wrong ones' limit.
EXPECTED = {**dict.fromkeys(("Anna Groß_100001_assignsubmission_file_", "Björn Ek_100002_assignsubmission_file_",
                             "chen", "david", "élodie", "fatima", "goran", "hana"), (99.9, 100.0)),
            **dict.fromkeys(("lena", "olga", "wen", "xenia", "yusuf", "zoe", "a spy", "python two", "damaged",
                             "climber", "tina", "umut", "vera"), (0.0, 0.0))}


def write(folder, entries=CLASS):
    """Write the submissions of these entries into a new folder (Path)."""
    folder.mkdir()
    for entry in entries:
        how, exercise, source = CLASS[entry]
        text = (CHECKS / source).read_text(encoding="utf-8") if source.startswith(("exercises/", "test/")) else source
        _WRITERS[how](folder, entry, exercise + ".py", text)


def _folder(folder, entry, name, text):
    (folder / entry).mkdir()
    (folder / entry / name).write_text(text, encoding="utf-8")


def _flat(folder, entry, name, text):
    (folder / (entry + name)).write_text(text, encoding="utf-8")


def _file(folder, entry, name, text):
    (folder / ("%s_%s" % (entry, name))).write_text(text, encoding="utf-8")


def _zip(folder, entry, name, text):
    with zipfile.ZipFile(folder / (entry + ".zip"), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("abgabe/" + name, text)
        archive.writestr("__MACOSX/abgabe/._" + name, b"\0")
        archive.writestr("abgabe/report.pdf", b"%PDF")


def _zip_in_a_folder(folder, entry, name, text):
    (folder / entry).mkdir()
    _zip(folder / entry, "my work", name, text)


def _tar(folder, entry, name, text):
    with tarfile.open(folder / (entry + ".tar.gz"), "w:gz") as archive:
        info = tarfile.TarInfo("./" + name)
        info.size = len(text.encode())
        archive.addfile(info, io.BytesIO(text.encode()))


def _notebook(folder, entry, name, text):
    code = {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": []}
    cells = [{"cell_type": "markdown", "metadata": {}, "source": ["# My work"]},
             {**code, "source": ["%matplotlib inline"]}, {**code, "source": text.splitlines(True)}]
    (folder / entry).mkdir()
    (folder / entry / name.replace(".py", ".ipynb")).write_text(json.dumps(
        {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}), encoding="utf-8")


def _damaged_zip(folder, entry, name, text):
    _zip(folder, entry, "rotate_gripper.py", "print(1)\n" * 1000)
    content = (folder / (entry + ".zip")).read_bytes()
    (folder / (entry + ".zip")).write_bytes(content[:len(content) // 2])


def _climbing_zip(folder, entry, name, text):
    with zipfile.ZipFile(folder / (entry + ".zip"), "w") as archive:
        archive.writestr("../../planted.py", "print(1)\n")


_WRITERS = {"folder": _folder, "flat": _flat, "file": _file, "zip": _zip, "zip in a folder": _zip_in_a_folder,
            "tar": _tar, "notebook": _notebook, "damaged zip": _damaged_zip, "climbing zip": _climbing_zip}

if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: class_of_thirty.py FOLDER")
    write(Path(sys.argv[1]))
