# SPDX-License-Identifier: BSD-3-Clause
"""A verdict is used again as long as nothing changes that it depends on, and judged again when something does."""
import errno
import json
import os
import subprocess
import sys

import pytest

from rf_grading import keys, plan, programs
from rf_grading.ledger import Ledger, LedgerError
from rf_grading.submissions import Submission

WAVE, TF = programs.exercises_of("lab2", ["wave"])[0], programs.exercises_of("lab2", ["tf_listener"])[0]
CONDITIONS = {"seed": 0, "profile": "sim", "serial": 0}


def workspace(folder, **packages):
    for name, (needed, text) in packages.items():
        place = folder / "src" / "group" / name
        (place / "test").mkdir(parents=True)
        (place / "package.xml").write_text("<package><name>%s</name>%s</package>" % (
            name, "".join("<exec_depend>%s</exec_depend>" % one for one in needed)))
        (place / "code.py").write_text(text)
    return folder


def test_the_version_depends_on_the_judge_and_what_it_needs(tmp_path):
    root = workspace(tmp_path, rf_checks=(["sim", "rospy"], "1"), sim=([], "2"), other=([], "3"))
    first = keys.product_version(root)
    group = root / "src" / "group"
    (group / "other" / "code.py").write_text("changed")
    (group / "sim" / "README.md").write_text("changed")
    (group / "sim" / "test" / "test_code.py").write_text("changed")
    assert keys.product_version(root) == first
    (group / "sim" / "code.py").write_text("changed")
    assert keys.product_version(root) != first


def test_every_condition_changes_the_key():
    def key(version="v", exercise=WAVE, name="wave.py", files=(("wave.py", b"1"),), **conditions):
        return keys.key(version, exercise, {**CONDITIONS, **conditions}, name, dict(files))

    found = [key(), key("w"), key(exercise=TF), key(seed=1), key(profile="robot"), key(serial=2), key(name="w.py"),
             key(files=(("wave.py", b"2"),)), key(files=(("wave.py", b"1"), ("help.py", b"")))]
    assert len(set(found)) == len(found)
    assert key() == found[0]


def planned(tmp_path, submissions, exercises=(WAVE,), version="v", **options):
    tmp_path.mkdir(exist_ok=True)
    return plan.make(submissions, list(exercises), version, CONDITIONS, tmp_path / "programs", **options)


def test_only_the_program_and_its_modules_count(tmp_path):
    files = {"wave.py": b"import help", "help.py": b"", "notes.py": b"a"}
    _, (first,), _ = planned(tmp_path / "1", [Submission("li", "li", files=dict(files))])
    _, (second,), tasks = planned(tmp_path / "2", [Submission("li", "li", files={**files, "notes.py": b"b"})])
    _, (third,), _ = planned(tmp_path / "3", [Submission("li", "li", files={**files, "help.py": b"b"})])
    assert first.keys == second.keys != third.keys
    assert set(first.texts) == {"wave.py", "help.py"}
    (task,) = tasks.values()
    with open(task.program, "rb") as program:
        assert program.read() == b"import help"


def test_equal_programs_are_judged_once_and_the_rest_has_sentences(tmp_path):
    same = {"wave.py": b"1"}
    refused = Submission("d", "d")
    refused.refuse("is empty")
    exercises, entries, tasks = planned(tmp_path, [
        Submission("a", "a", files=same), Submission("b", "b", files=same), Submission("c", "c", files={"x.py": b""}),
        refused], exercises=(WAVE, TF), only_used=True)
    assert [exercise.name for exercise in exercises] == ["wave"]
    assert len(tasks) == 1
    assert [entry.problems for entry in entries] == [{}, {}, {"wave": "no program for wave"}, {"wave": "is empty"}]


def test_a_name_too_long_for_a_file_is_told(tmp_path):
    _, (entry,), tasks = planned(tmp_path, [Submission("a", "a", files={"wave%s.py" % ("x" * 300): b"1"})])
    assert os.strerror(errno.ENAMETOOLONG) in entry.problems["wave"] and not tasks


def test_a_program_sees_no_modules_of_other_students(tmp_path):
    _, _, tasks = planned(tmp_path, [Submission("a", "a", files={"wave.py": b"import b_wave"}),
                                     Submission("b", "b", files={"b_wave.py": b"1"})])
    folders = {task.program.rpartition("/")[0] for task in tasks.values()}
    assert len(folders) == 2


def test_verdicts_survive_a_cut_off_line(tmp_path):
    path = tmp_path / "verdicts.jsonl"
    with Ledger(path) as ledger:
        ledger.add("a", {"points": 1})
        ledger.add("b", {"points": 2})
        ledger.add("a", {"points": 3})
    path.write_bytes(path.read_bytes()[:-5])
    with Ledger(path) as ledger:
        assert ledger.verdicts == {"a": {"points": 1}, "b": {"points": 2}}
        ledger.add("c", {"points": 4})
    assert [json.loads(line)["key"] for line in path.read_text().splitlines()] == ["a", "b", "c"]


@pytest.mark.parametrize("text", ["{}\n", "x\n", '{"key": 1}\n'])
def test_another_file_is_no_ledger(tmp_path, text):
    (tmp_path / "verdicts.jsonl").write_text(text)
    with pytest.raises(LedgerError, match="line 1 of"):
        Ledger(tmp_path / "verdicts.jsonl")


def test_two_gradings_do_not_write_to_one_ledger(tmp_path):
    with Ledger(tmp_path / "v"):
        done = subprocess.run([sys.executable, "-c", "import sys; from rf_grading.ledger import Ledger; "
                               "Ledger(sys.argv[1])", tmp_path / "v"], capture_output=True, text=True)
    assert "another grading is writing" in done.stderr


def test_a_students_copy_has_the_same_version(tmp_path):
    root = workspace(tmp_path, rf_checks=(["rf_lab2"], "1"), rf_lab2=([], "2"))
    (root / "src" / "group").rename(root / "src" / "courses")
    labs = root / "src" / "courses"
    solved = [labs / "rf_checks/exercises/solutions/wave.py", labs / "rf_lab2/nodes/wave.py",
              labs / "rf_lab2/notebooks/1.ipynb"]
    for path in solved:
        path.parent.mkdir(parents=True)
        path.write_text("solved")
    first = keys.product_version(root)
    solved[0].unlink()
    for path in solved[1:]:
        path.write_text("an exercise")
    assert keys.product_version(root) == first
