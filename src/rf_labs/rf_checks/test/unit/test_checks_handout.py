# SPDX-License-Identifier: BSD-3-Clause
"""The students' copy of a small workspace: its content, what it must not contain, and when no copy is made."""
import json
import subprocess
from pathlib import Path

import pytest

from rf_checks import handout, similarity

HERE = Path(__file__).resolve().parents[5]
SOLUTION = (HERE / "src/rf_labs/rf_checks/exercises/solutions/rotate_gripper.py").read_text(encoding="utf-8")
CHECKS = "src/rf_labs/rf_checks/"


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
            CHECKS + "src/rf_checks/judge.py": "y = 1\n", "src/rf_labs/rf_lab2/nodes/wave.py": "z = 1\n",
            "src/rf_labs/rf_lab2/notebooks/1.ipynb": json.dumps(notebook), "build/made": "no\n",
            ".gitignore": "build/\n"}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    (root / "baxter.sh").chmod(0o755)
    if request.param:
        subprocess.run(["git", "init", "-q", str(root)], check=True)
    return root


def test_the_copy_has_everything_but_what_solves(workspace, tmp_path):
    target = tmp_path / "students"
    handout.make(workspace, target)
    files = {str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()}
    assert files == {"baxter.sh", "README.md", ".gitignore", CHECKS + "exercises/skeletons/rotate_gripper.py",
                     CHECKS + "src/rf_checks/judge.py", "src/rf_labs/rf_lab2/nodes/wave.py",
                     "src/rf_labs/rf_lab2/notebooks/1.ipynb"}
    assert (target / "baxter.sh").stat().st_mode & 0o111
    stub = subprocess.run(["python3", str(target / "src/rf_labs/rf_lab2/nodes/wave.py")], capture_output=True,
                          text=True)
    assert stub.returncode == 1 and "check --start wave" in stub.stderr
    cells = json.loads((target / "src/rf_labs/rf_lab2/notebooks/1.ipynb").read_text())["cells"]
    assert [one["source"] for one in cells[1:]] == [["a = 1"], [handout._YOUR_TURN]]
    assert [one["outputs"] for one in cells[1:]] == [[], []]
    # In it, the judge finds no reference and says nothing of copies.
    assert similarity.Library(target).notes({"mine.py": SOLUTION}) == []


def test_a_copy_that_would_reveal_a_solution_is_not_made(workspace, tmp_path):
    (workspace / "src/hidden_away.py").write_text(SOLUTION.replace("orientation", "o"))
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
