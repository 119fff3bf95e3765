# SPDX-License-Identifier: BSD-3-Clause
"""The students' copy of a small workspace: its content, what it must not contain, and when no copy is made."""
import json
import shutil
import subprocess
import unicodedata
from pathlib import Path

import pytest

from rf_checks import handout, similarity

HERE = Path(__file__).resolve().parents[5]
SOLUTION = (HERE / "src/courses/rf_checks/exercises/solutions/rotate_gripper.py").read_text(encoding="utf-8")
CHECKS = "src/courses/rf_checks/"


def cell(source, **metadata):
    return {"cell_type": "code", "execution_count": 3, "metadata": metadata, "outputs": [{"text": "42"}],
            "source": [source]}


@pytest.fixture(params=[True, False], ids=["git", "no git"])
def workspace(request, tmp_path):
    root = tmp_path / "workspace"
    notebook = {"cells": [{"cell_type": "markdown", "metadata": {}, "source": ["# One"]}, cell("a = 1"),
                          cell("answer = 42", tags=["solution"])], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    for name, text in {
            "baxter.sh": "#!/bin/sh\n", "README.md": "hello\n", CHECKS + "test/unit/test_x.py": "x = 1\n",
            CHECKS + "exercises/solutions/rotate_gripper.py": SOLUTION,
            CHECKS + "exercises/skeletons/rotate_gripper.py": "print('TODO')\n",
            CHECKS + "src/rf_checks/judge.py": "y = 1\n", "src/courses/rf_lab2/nodes/wave.py": "z = 1\n",
            "src/courses/rf_lab2/notebooks/1.ipynb": json.dumps(notebook), "build/made": "no\n",
            ".gitignore": "build/\n"}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    (root / "baxter.sh").chmod(0o755)
    if request.param:
        subprocess.run(["git", "init", "-q", str(root)], check=True)
        subprocess.run(["git", "-C", str(root), "add", "."], check=True)
    else:  # a students' copy
        (root / handout.LIST).write_text("".join("%s\n" % path.relative_to(root) for path in root.rglob("*")
                                                 if path.is_file() and "build" not in path.parts))
    return root


@pytest.fixture(autouse=True)
def no_class(tmp_path, monkeypatch):
    """The class of whoever runs the tests has no part in them."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "states"))


def test_the_copy_has_everything_but_what_solves(workspace, tmp_path):
    target = tmp_path / "students"
    handout.make(workspace, target)
    files = {str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()}
    assert files == {handout.LIST, "baxter.sh", "README.md", ".gitignore", CHECKS + "src/rf_checks/judge.py",
                     CHECKS + "exercises/skeletons/rotate_gripper.py", "src/courses/rf_lab2/nodes/wave.py",
                     "src/courses/rf_lab2/notebooks/1.ipynb"}
    assert (target / "baxter.sh").stat().st_mode & 0o111
    stub = subprocess.run(["python3", str(target / "src/courses/rf_lab2/nodes/wave.py")], capture_output=True,
                          text=True)
    assert stub.returncode == 1 and "check --start wave" in stub.stderr
    cells = json.loads((target / "src/courses/rf_lab2/notebooks/1.ipynb").read_text())["cells"]
    assert [one["source"] for one in cells[1:]] == [["a = 1"], [handout._YOUR_TURN]]
    assert [one["outputs"] for one in cells[1:]] == [[], []]
    # In it, the judge finds no reference and says nothing of copies.
    assert similarity.References(target).notes({"mine.py": SOLUTION}) == []


ROSTER = "First name,Last name,Email address\nAnna,Groß,anna.gross@example.edu\nLi,Wei,lw7@example.edu\n"


def belongs(workspace, name, text):
    """Add a file to the workspace's list, too."""
    (workspace / name).write_text(text)
    if (workspace / ".git").is_dir():
        subprocess.run(["git", "-C", str(workspace), "add", name], check=True)
    else:
        with (workspace / handout.LIST).open("a") as file:
            file.write(name + "\n")


def test_what_merely_lies_there_stays(workspace, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LAB_ROOT", str(workspace))
    (workspace / "submissions/li").mkdir(parents=True)
    for name in ("roster.csv", "submissions/li/wave.py", "src/mine.py"):
        (workspace / name).write_text(ROSTER)
    assert handout.main([str(tmp_path / "students")]) == 0
    assert not any("Wei" in path.read_text() for path in (tmp_path / "students").rglob("*") if path.is_file())
    assert ("3 files that git does not track" in capsys.readouterr().out) == (workspace / ".git").is_dir()
    # A copy of the copy is the same.
    handout.make(tmp_path / "students", tmp_path / "again")
    both = [{str(path.relative_to(tmp_path / place)) for path in (tmp_path / place).rglob("*")}
            for place in ("students", "again")]
    assert both[0] == both[1]


def test_without_a_list_there_is_no_copy(workspace, tmp_path):
    (workspace / handout.LIST).unlink(missing_ok=True)
    shutil.rmtree(workspace / ".git", ignore_errors=True)
    with pytest.raises(handout.HandoutFailed, match="git init"):
        handout.make(workspace, tmp_path / "students")
    assert not (tmp_path / "students").exists()


@pytest.mark.parametrize(("name", "text"), [
    ("note.md", "Thanks to Anna  Groß."), ("note.md", "GROSS, ANNA: anna.gross@EXAMPLE.edu"),
    ("wei_li.py", "x = 1"), ("note.md", "lw7@example.edu"), ("roster.csv", ROSTER)])
@pytest.mark.parametrize("source", ["in the workspace", "given", "class"])
def test_no_copy_names_a_student(workspace, tmp_path, name, text, source):
    place = {"in the workspace": workspace / "mine.csv", "given": tmp_path / "x.csv",
             "class": tmp_path / "states/baxter_labs/class.json"}[source]
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(ROSTER if source != "class" else json.dumps(
        {"students": [["anna", "Anna Groß"], ["li", "Li Wei"], ["student-7", "Student 7"]]}))
    belongs(workspace, "student.md", "Student 7 sees Anna's or Li's robot")
    given = [place] if source == "given" else []
    handout.make(workspace, tmp_path / "students", given)
    shutil.rmtree(tmp_path / "students")
    belongs(workspace, name, text)
    if source == "class" and "@" in text and "," not in text:
        return  # the class's record has no addresses
    with pytest.raises(handout.HandoutFailed, match="%s names" % name):
        handout.make(workspace, tmp_path / "students", given)
    assert not (tmp_path / "students").exists()


@pytest.mark.parametrize("table", [
    "name;email\nJürgen Müller;jm@example.edu\n".encode("cp1252"),
    "Matrikel;Teilnehmer;E-Mail\n1;Jürgen Müller;jm@example.edu\n".encode(),
    "Jürgen Müller\tjm@example.edu\n".encode(),
    "7,Müller,Jürgen,jm@example.edu\n7,Müller,Jürgen,jm@example.edu\n".encode("utf-16")],
    ids=["Latin-1", "unknown headings", "no headings", "UTF-16, a student twice"])
@pytest.mark.parametrize("note", [
    "by Jürgen Müller".encode(), unicodedata.normalize("NFD", "by Jürgen Müller").encode(),
    "by Jürgen Müller".encode("utf-16"), "by Jürgen Müller".encode("cp1252"),
    json.dumps("by Jürgen Müller").encode(), b"see jm@example.edu"],
    ids=["plain", "decomposed", "UTF-16", "Latin-1", "JSON", "address"])
def test_no_copy_names_a_student_in_whatever_form_table_and_text_are(tmp_path, table, note):
    workspace = tmp_path / "workspace"
    workspace.mkdir()
    (workspace / handout.LIST).write_text("baxter.sh\nnote.md\n")
    (workspace / "baxter.sh").write_text("")
    (workspace / "class.tsv").write_bytes(table)
    (workspace / "note.md").write_text("by somebody")
    handout.make(workspace, tmp_path / "before")
    (workspace / "note.md").write_bytes(note)
    with pytest.raises(handout.HandoutFailed, match="note.md names"):
        handout.make(workspace, tmp_path / "students")


@pytest.mark.parametrize("headings", ["Full name,Email,Course", "Student number,E-Mail,Course"])
def test_the_course_of_the_students_is_no_student(tmp_path, headings):
    workspace = tmp_path / "workspace"
    workspace.mkdir()
    (workspace / handout.LIST).write_text("baxter.sh\nnote.md\n")
    (workspace / "baxter.sh").write_text("")
    (workspace / "note.md").write_text("Welcome to Robotics Foundations")
    (workspace / "class.csv").write_text(
        headings + "\nAnna Groß,anna@example.edu,Robotics Foundations\nWei Li,li@example.edu,Robotics Foundations\n")
    handout.make(workspace, tmp_path / "students")


def test_a_roster_that_cannot_be_read_is_told(workspace, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LAB_ROOT", str(workspace))
    for name in ("/dev/zero", str(tmp_path / "gone.csv")):
        assert handout.main([str(tmp_path / "students"), "--roster", name]) == 1
        assert name in capsys.readouterr().err


def test_a_copy_that_would_reveal_a_solution_is_not_made(workspace, tmp_path):
    belongs(workspace, "src/hidden_away.py", SOLUTION.replace("orientation", "o"))
    with pytest.raises(handout.HandoutFailed, match="hidden_away.py is like .*rotate_gripper.py"):
        handout.make(workspace, tmp_path / "students")
    assert not (tmp_path / "students").exists()


def test_it_goes_into_an_empty_folder_elsewhere(workspace, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LAB_ROOT", str(workspace))
    assert handout.main([str(workspace / "students")]) == 1
    assert "in the workspace itself" in capsys.readouterr().err
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    assert handout.main([str(tmp_path / "full")]) == 1
    assert "not an empty folder" in capsys.readouterr().err
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    assert handout.main([str(tmp_path / "link")]) == 1
    assert "is a link, to" in capsys.readouterr().err
    assert handout.main([]) == 2
    assert handout.main([str(tmp_path / "students")]) == 0
    assert "check --list" in capsys.readouterr().out


def test_this_workspace_reveals_nothing(tmp_path):
    handout.make(HERE, tmp_path / "students")
    left = [path for path in (tmp_path / "students").rglob("*") if handout.is_left_out(
        str(path.relative_to(tmp_path / "students")))]
    assert left == []
