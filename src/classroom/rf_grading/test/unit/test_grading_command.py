# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh grade`: its words, its files, going on where it was; the judge is a stand-in (grading.test has the real
one)."""
import fcntl
import json
import os
import shutil
import tempfile
import zipfile
from pathlib import Path

import pytest

from lab_batch import JobError, Outcome
from processes import isolation
from rf_grading import command, keys, pages

MOTION = {"times": [0.0, 1.0], "left": [[[0, 0, 0]] * 5] * 2, "right": [[[0, 0, 0]] * 5] * 2}


class StandIn:
    """In place of the workers: 100 points for a program that says 'right'; fails and stops as its fields say."""

    def __init__(self):
        self.judged, self.failing, self.stop_after = [], "", None

    def map_seeds(self, spec, seeds, limits):
        self.limits, self.parameters = limits, spec.parameters
        tasks = json.loads(Path(spec.parameters["tasks"]).read_text())
        for seed in seeds:
            if self.stop_after is not None and len(self.judged) >= self.stop_after:
                raise KeyboardInterrupt
            text = Path(tasks[seed]["program"]).read_text()
            self.judged.append(text)
            assert str(os.environ["TMPDIR"]) in tasks[seed]["program"]
            if self.failing and self.failing in text:
                yield Outcome(seed, {}, "its worker died twice: signal SIGKILL")
                continue
            points = 100.0 if "right" in text else float("nan") if "nan" in text else 0.0
            yield Outcome(seed, {"motions": [MOTION], "verdict": {
                "graded": "slow" not in text, "not_graded": "the machine reached 0.01 of real time", "points": points,
                "passed": points > 80, "pass_mark": 80, "hint": None if points else "it does nothing", "fault": None,
                "notes": [], "wall_s": 1.0, "program": "wave.py", "isolation": "bubblewrap", "runs": [{
                    "arguments": [], "points": points, "fault": None, "end": None, "output": "", "errors": "",
                    "criteria": [{"name": "wave", "points": points, "of": 100.0, "found": "seen"}]}]}})


@pytest.fixture
def judge(monkeypatch, tmp_path):
    stand_in = StandIn()
    monkeypatch.setattr(command, "map_seeds", stand_in.map_seeds)
    monkeypatch.setattr(isolation, "problem", lambda: "")
    monkeypatch.setattr(keys, "product_version", lambda workspace: stand_in.version)
    stand_in.version = "v1"
    # The folders of other users' and tests' gradings stay out of it.
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.chdir(tmp_path)
    return stand_in


@pytest.fixture
def class_folder(tmp_path):
    for name, text in {"anna": "right", "bo": "wrong", "cy": "right, too"}.items():
        (tmp_path / "class" / name).mkdir(parents=True)
        (tmp_path / "class" / name / "wave.py").write_text("# " + text)
    return tmp_path / "class"


def points(folder="class-graded"):
    data = json.loads(Path(folder, "results.json").read_text())
    return {student["entry"]: student["points"] for student in data["students"]}


def test_a_class_is_graded_and_everything_is_written(judge, class_folder, capsys):
    assert command.main(["class", "lab2"]) == command.GRADED
    assert points() == {"anna": 100.0, "bo": 0.0, "cy": 100.0}
    out = Path("class-graded")
    written = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert {name for name in written if not name.startswith("motions/")} == {
        "verdicts.jsonl", "results.json", "results.csv", "results.xml", "nbgrader.csv", "index.html",
        *("feedback/%s/%s" % (name, file) for name in ("anna", "bo", "cy")
          for file in ("feedback.html", "results.json"))}
    assert "<animate" in (out / "feedback/anna/feedback.html").read_text()
    assert "3 of 3: cy, wave: 100 points" in capsys.readouterr().out
    assert judge.parameters["hidden"] == [str(class_folder), str(class_folder) + "-graded"]
    assert os.listdir("tmp") == []


def test_only_what_changed_is_judged_again(judge, class_folder):
    command.main(["class", "lab2"])
    judge.judged.clear()
    assert command.main(["class", "lab2"]) == command.GRADED
    assert judge.judged == []
    (class_folder / "bo" / "wave.py").write_text("# right at last")
    (class_folder / "dan").mkdir()
    (class_folder / "dan" / "wave.py").write_text("# right, too")  # as cy's
    command.main(["class", "lab2"])
    assert judge.judged == ["# right at last"]
    assert points() == {"anna": 100.0, "bo": 100.0, "cy": 100.0, "dan": 100.0}
    for change in (["--seed", "4"], ["--profile", "robot"], ["--serial", "2"]):
        judge.judged.clear()
        command.main(["class", "lab2", *change])
        assert len(judge.judged) == 3, change
    judge.judged.clear()
    judge.version = "v2"
    command.main(["class", "lab2"])
    assert len(judge.judged) == 3


def test_a_stopped_grading_writes_what_it_has_and_goes_on(judge, class_folder, capsys):
    judge.stop_after = 1
    assert command.main(["class", "lab2", "wave"]) == command.STOPPED
    assert "the same command goes on" in capsys.readouterr().err
    assert points() == {"anna": 100.0, "bo": None, "cy": None}
    assert os.listdir("tmp") == []
    judge.stop_after = None
    assert command.main(["class", "lab2", "wave"]) == command.GRADED
    assert judge.judged == ["# right", "# wrong", "# right, too"]


def test_half_written_files_of_a_killed_grading_go_and_others_stay(judge, class_folder, monkeypatch):
    command.main(["class", "lab2"])
    out = Path("class-graded")
    before = set(out.rglob("*"))

    def dies(*_):
        raise SystemExit  # as by kill -9: nothing is tidied up

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", dies)
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)
        for place in (out, out / "motions", out / "feedback" / "bo"):
            with pytest.raises(SystemExit):
                command.write_report(place / "results.json", "{")
    (out / ".mine.json").touch()
    assert len(set(out.rglob("*")) - before) == 7
    assert command.main(["class", "lab2"]) == command.GRADED
    assert set(out.rglob("*")) - before == {out / ".mine.json"}


@pytest.mark.parametrize(("text", "words"), [("# dies", "worker died twice"), ("# slow", "0.01 of real time")])
def test_what_the_judge_cannot_grade_is_told_and_tried_again(judge, class_folder, capsys, text, words):
    (class_folder / "bo" / "wave.py").write_text(text)
    judge.failing = "dies"
    assert command.main(["class", "lab2"]) == command.NOT_ALL_GRADED
    assert words in capsys.readouterr().out
    assert points() == {"anna": 100.0, "bo": None, "cy": 100.0}
    judge.judged.clear()
    command.main(["class", "lab2"])
    assert judge.judged == [text]


def test_a_notebooks_program_lies_beside_its_page(judge, class_folder):
    (class_folder / "bo" / "wave.py").unlink()
    (class_folder / "bo" / "wave.ipynb").write_text(json.dumps({"cells": [{"cell_type": "code", "source": "# right"}]}))
    assert command.main(["class", "lab2"]) == command.GRADED
    assert Path("class-graded/feedback/bo/wave.py").read_text() == "# right\n"


def test_folders_of_killed_gradings_are_removed_and_those_at_work_stay(judge, class_folder):
    for name in ("killed", "working"):
        Path("tmp", "lab-grade-" + name).mkdir()
        Path("tmp", "lab-grade-" + name, "lock").touch()
    with open("tmp/lab-grade-working/lock", "rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        command.main(["class", "lab2"])
    assert os.listdir("tmp") == ["lab-grade-working"]


def test_without_walls_nothing_runs(judge, class_folder, monkeypatch, capsys):
    monkeypatch.setattr(isolation, "problem", lambda: "bubblewrap is not installed (apt install bubblewrap)")
    assert command.main(["class", "lab2"]) == command.FAILED
    assert "apt install bubblewrap" in capsys.readouterr().err
    assert judge.judged == []
    assert command.main(["class", "lab2", "--trusted"]) == command.GRADED
    monkeypatch.setattr(isolation, "problem", lambda: "")
    judge.judged.clear()
    command.main(["class", "lab2"])  # verdicts without walls are none of a judge with walls
    assert len(judge.judged) == 3


def test_a_judge_that_cannot_start_is_told(judge, class_folder, monkeypatch, capsys):
    def map_seeds(*_):
        raise JobError("the kernel refuses namespaces")
        yield

    monkeypatch.setattr(command, "map_seeds", map_seeds)
    assert command.main(["class", "lab2"]) == command.FAILED
    assert "refuses namespaces" in capsys.readouterr().err


@pytest.mark.parametrize(("words", "said"), [
    (["gone"], "neither a folder nor"), (["class", "lab7"], "no lab 'lab7'"), (["class", "lab2", "wav"], "no exercise"),
    (["class", "--out", "class/out"], "must not lie in each other"), (["class", "--out", "."], "must not lie"),
    (["empty"], "has no submissions"), (["class", "cwru", "--seed", "-1"], "--seed: expected a whole number from 0"),
    ([], "which folder"),
    (["class", "lab2", "--workers", "0"], "--workers: expected a whole number from 1"), (["other"], "no submission in"),
])
def test_wrong_words_are_answered_in_a_sentence(judge, class_folder, capsys, words, said):
    Path("empty").mkdir()
    Path("other/li").mkdir(parents=True)
    Path("other/li/notes.py").write_text("1")
    try:
        status = command.main(words)
    except SystemExit as end:
        status = end.code
    assert status == command.WRONG_WORDS
    assert said in capsys.readouterr().err


def test_a_class_around_the_workspace_is_refused(judge, class_folder, monkeypatch, capsys):
    (class_folder / "ws").mkdir()
    monkeypatch.setenv("LAB_ROOT", str(class_folder / "ws"))
    assert command.main(["class", "lab2"]) == command.WRONG_WORDS
    assert "is hidden from the judged programs" in capsys.readouterr().err


@pytest.mark.parametrize(("share", "limit"), [(9 << 30, 9 << 30), (1 << 30, 3 << 30)])
def test_a_judge_with_its_lab_has_its_share_of_the_memory_and_room_for_a_program(
        judge, class_folder, monkeypatch, share, limit):
    monkeypatch.setattr(command, "default_memory_bytes", lambda workers: share)
    command.main(["class", "lab2"])
    assert judge.limits.memory_bytes == limit


def test_workers_are_limited_by_processors_and_memory():
    assert command.workers_for(2, 64 << 30) == 2
    assert command.workers_for(16, 7 << 30) == 2
    assert command.workers_for(4, 1 << 30) == 1


def test_one_submission_costs_itself_alone(judge, class_folder, capsys):
    with zipfile.ZipFile(class_folder / "dana.zip", "w") as archive:
        info = zipfile.ZipInfo("wave.py")
        archive.writestr(info, "right")
        info.filename = ""
    for name, cells in (("eve", [{"cell_type": "code", "source": ["# \ud800 right"]}]), ("fay", None)):
        (class_folder / name).mkdir()
        (class_folder / name / "wave.ipynb").write_text(json.dumps({"cells": cells}))
    # The judge's points are no number.
    (class_folder / "gil_wave.py").write_text("# nan")
    (class_folder / "hal_wave.py").write_text("# -*- coding: undefined -*-\n")
    assert command.main(["class", "lab2", "wave"]) == command.NOT_ALL_GRADED
    assert points() == {"anna": 100.0, "bo": 0.0, "cy": 100.0, "dana": 0.0, "eve": 0.0, "fay": 0.0, "gil": None,
                        "hal": 0.0}
    assert "Traceback" not in capsys.readouterr().err


def test_a_report_that_cannot_be_written_costs_its_row_alone(judge, class_folder, monkeypatch):
    def feedback(results, row, motions):
        if row.submission.entry == "bo" and row.points is not None:
            raise KeyError("found")
        return genuine(results, row, motions)

    genuine = pages.feedback
    monkeypatch.setattr(pages, "feedback", feedback)
    assert command.main(["class", "lab2"]) == command.NOT_ALL_GRADED
    assert points() == {"anna": 100.0, "bo": None, "cy": 100.0}
    assert "cannot be written" in Path("class-graded/feedback/bo/feedback.html").read_text()
