# SPDX-License-Identifier: BSD-3-Clause
"""`to_nbgrader`, with nbgrader itself, which is installed for it."""
import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "to_nbgrader"
NBGRADER = "nbgrader==0.9.6"
# What an instructor has done with nbgrader before: a student with a manual grade for an assignment of one notebook.
EARLIER = """
import os, sys
os.environ["PATH"] = os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"]
from nbgrader.api import Gradebook
with Gradebook("sqlite:///" + sys.argv[1]) as book:
    book.add_assignment("ps3")
    book.add_notebook("essay", "ps3")
    book.add_grade_cell("text", "essay", "ps3", max_score=10, cell_type="markdown")
    book.add_student("anna", last_name="Before")
    book.add_submission("ps3", "anna")
    book.find_grade("text", "essay", "ps3", "anna").manual_score = 7
    book.db.commit()
"""

COMMENTS = """
import sys
from nbgrader.api import Gradebook
with Gradebook("sqlite:///" + sys.argv[1]) as book:
    print([(one.notebook.student.id, one.notebook.name, one.auto_comment)
           for submission in book.assignment_submissions("ps3") for notebook in submission.notebooks
           for one in notebook.comments if one.auto_comment])
"""


def student(name, status="graded", **points):
    return {"student": name, "name": "Anna Maria Groß" if name == "anna" else "", "email": "", "status": status,
            "exercises": {exercise: {"points": value, "sentence": "" if value == 100.0 else "%s is off" % exercise}
                          for exercise, value in points.items()}}


@pytest.fixture
def results(tmp_path):
    path = tmp_path / "results.json"
    path.write_text(json.dumps({
        "assignment": "ps3", "exercises": [{"name": "wave"}, {"name": "tf_listener"}],
        "students": [student("anna", wave=91.5, tf_listener=100.0), student("bo", wave=30.0, tf_listener=0.0),
                     student("chen", "not graded", wave=None, tf_listener=50.0),
                     student("dan", "no program", wave=0.0, tf_listener=0.0)]}), encoding="utf-8")
    return path


def run(python, *words):
    return subprocess.run([python, *map(str, words)], capture_output=True, text=True, timeout=600)


def test_without_nbgrader_it_says_which_python_to_use(results, tmp_path):
    done = run(sys.executable, "-S", SCRIPT, results, tmp_path / "book.db")
    assert done.returncode == 2 and "pip install nbgrader" in done.stderr
    assert not (tmp_path / "book.db").exists()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"assignment": 3, "exercises": [], "students": []}',
                                  '{"assignment": "a", "exercises": [{"name": "wave"}], "students": [{"student": "x", '
                                  '"status": "graded", "exercises": {}}]}', "[" * 100000])
def test_another_file_is_refused(text, tmp_path):
    (tmp_path / "other.json").write_text(text)
    done = run(sys.executable, SCRIPT, tmp_path / "other.json", tmp_path / "book.db")
    assert done.returncode == 2 and "other.json" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.long
def test_points_are_in_the_gradebook_and_what_was_there_stays(results, tmp_path):
    run(sys.executable, "-m", "venv", tmp_path / "course")
    python = tmp_path / "course" / "bin" / "python"
    installed = run(python, "-m", "pip", "install", "--quiet", NBGRADER)
    assert installed.returncode == 0, installed.stderr
    book, table = tmp_path / "gradebook.db", tmp_path / "grades.csv"
    assert run(python, "-c", EARLIER, book).returncode == 0
    for _ in range(2):  # a second time changes nothing
        done = run(python, SCRIPT, results, book)
        assert done.returncode == 1, done.stderr
        assert done.stdout == ("not graded, and left as it was: chen, wave\n4 students in %s\n" % book)
        exported = run(python, "-m", "nbgrader", "export", "--db=sqlite:///%s" % book, "--to=%s" % table)
        assert exported.returncode == 0, exported.stderr
        rows = {row["student_id"]: row for row in csv.DictReader(table.open(encoding="utf-8"))}
        assert {name: (float(row["score"]), float(row["max_score"])) for name, row in rows.items()} == {
            "anna": (198.5, 210.0), "bo": (30.0, 210.0), "chen": (50.0, 210.0), "dan": (0.0, 210.0)}
        told = run(python, "-c", COMMENTS, book)
        assert told.stdout.strip() == str([
            ("anna", "wave", "wave is off"), ("bo", "tf_listener", "tf_listener is off"), ("bo", "wave", "wave is off"),
            ("chen", "tf_listener", "tf_listener is off")]), told.stderr
        assert (rows["anna"]["first_name"], rows["anna"]["last_name"]) == ("Anna Maria", "Groß")
