# SPDX-License-Identifier: BSD-3-Clause
"""The test runner must not miss a failure: discovery, selection, counting, and left-over processes of a test."""

import os
import re
import subprocess
import sys
import threading
import uuid
from pathlib import Path

import pytest

import run_tests
from lab_tests import comma_locale, processes, rostests
from lab_tests.discovery import Rostest, SelectionError, select, take_inventory
from lab_tests.results import read_junit, read_rostest_results

pytestmark = pytest.mark.once

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = "<package format='3'><name>%s</name></package>"
PASSING = "<testsuite tests='2'><testcase name='a' classname='T'/><testcase name='b' classname='T'/></testsuite>"
FAILING = "<testsuite tests='1'><testcase name='a' classname='T'><failure message='1 is not 2'/></testcase></testsuite>"
CRASHED = "<testsuite tests='1'><testcase name='testx' classname='R'><error message='none'/></testcase></testsuite>"
RAN = "<testsuite tests='1'><testcase name='testx' classname='R'/></testsuite>"


@pytest.fixture
def workspace(tmp_path):
    """Two packages, an ignored one, and cross-package tests."""
    files = {
        "src/group/alpha/package.xml": MANIFEST % "alpha",
        "src/group/alpha/test/unit/test_alpha.py": "",
        "src/group/alpha/test/unit/helper.py": "",
        "src/group/alpha/test/rostest/alpha.test": "<launch/>",
        "src/group/alpha/test/rostest/alpha_soak.test": "<launch><!-- long --></launch>",
        "src/beta/package.xml": MANIFEST % "beta",
        "src/beta/test/unit/test_beta.py": "",
        "src/copy/CATKIN_IGNORE": "",
        "src/copy/alpha/package.xml": MANIFEST % "alpha",
        "src/copy/alpha/test/unit/test_copy.py": "",
        "tests/package.xml": MANIFEST % "workspace_tests",
        "tests/unit/test_whole.py": "",
        "tests/rostest/whole.test": "<launch/>",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def chosen(workspace, *arguments, long=False):
    selection = select(take_inventory(workspace), list(arguments), long)
    units = [Path(target).name for target in selection.unit_targets]
    return selection, units, [test.path.name for test in selection.rostests]


def test_everything_runs_without_names(workspace):
    selection, units, rostest_names = chosen(workspace)
    assert selection.linters == ["ruff", "catkin_lint"]
    assert units == ["test_alpha.py", "test_beta.py", "test_whole.py"]
    assert rostest_names == ["alpha.test", "whole.test"]


def test_marks_of_a_rostest(workspace):
    marked = "<!-- long -->\n<!-- beside others -->\n<launch/>"
    (workspace / "tests/rostest/whole.test").write_text(marked)
    (plain, *_), last = take_inventory(workspace).rostests[:1], take_inventory(workspace).rostests[-1]
    assert (plain.is_long, plain.is_beside_others, last.is_long, last.is_beside_others) == (False, False, True, True)


def test_long_brings_in_long_rostests(workspace):
    assert "alpha_soak.test" in chosen(workspace, long=True)[2]


@pytest.mark.parametrize(
    ("name", "units", "rostest_names"),
    [
        ("alpha", ["test_alpha.py"], ["alpha.test"]),  # a package that has the same name as a test file
        ("beta", ["test_beta.py"], []),
        ("workspace_tests", ["test_whole.py"], ["whole.test"]),
        ("test_alpha", ["test_alpha.py"], []),
        ("test_alpha.py::test_one", ["test_alpha.py::test_one"], []),
        ("whole.test", [], ["whole.test"]),
        ("alpha_soak", [], ["alpha_soak.test"]),
    ],
)
def test_names_select(workspace, name, units, rostest_names):
    selection, found_units, found_rostests = chosen(workspace, name)
    assert (found_units, found_rostests, selection.linters) == (units, rostest_names, [])


def test_what_is_named_twice_runs_once(workspace):
    assert chosen(workspace, "alpha", "test_alpha", "alpha.test")[1:] == (["test_alpha.py"], ["alpha.test"])


def test_path_selects(workspace):
    path = workspace / "src/beta/test/unit/test_beta.py"
    assert chosen(workspace, str(path))[1:] == (["test_beta.py"], [])


def test_pytest_arguments_run_the_unit_layer_alone(workspace):
    selection, units, rostest_names = chosen(workspace, "-k", "alpha", "-x")
    assert (selection.pytest_arguments, len(units), rostest_names) == (["-k", "alpha", "-x"], 3, [])


def test_unknown_name_lists_the_packages(workspace):
    with pytest.raises(SelectionError, match="gamma.*alpha, beta, workspace_tests"):
        chosen(workspace, "gamma")


@pytest.mark.parametrize(
    ("files", "passed", "failed"),
    [
        ({"rostest-x.xml": RAN, "T.xml": PASSING}, 2, 0),
        ({"rostest-x.xml": RAN, "T.xml": FAILING}, 0, 1),
        ({"rostest-x.xml": CRASHED}, 0, 1),
        ({"rostest-x.xml": RAN}, 0, 1),  # the test node ended normally and tested nothing
        ({}, 0, 1),
        ({"rostest-x.xml": RAN, "T.xml": "<testsuite"}, 0, 1),  # its writer died half-way
    ],
    ids=["passes", "fails", "crashes", "tests nothing", "no results", "cut off"],
)
def test_rostest_results_are_counted(tmp_path, files, passed, failed):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    tally = read_rostest_results(tmp_path)
    assert (tally.passed, tally.failed, len(tally.details)) == (passed, failed, failed)


def test_failure_text_is_kept(tmp_path):
    (tmp_path / "a.xml").write_text(FAILING)
    assert "1 is not 2" in read_junit(tmp_path / "a.xml").details[0]


def test_processes_left_behind_are_found_and_ended():
    run_id = uuid.uuid4().hex
    child = subprocess.Popen(["sleep", "60"], env={**os.environ, processes.MARKER: run_id}, start_new_session=True)
    try:
        assert list(processes.wait_until_gone(run_id, 0.2)) == [child.pid]
        processes.kill_all(run_id)
        assert child.wait(60) != 0
        assert processes.wait_until_gone(run_id, 5.0) == {}
    finally:
        child.kill()
        child.wait()


FAKE_ROSTEST = """#!/bin/bash
# Behaves like rostest in the way that the .test file's name says.
case $1 in
    *leaves.test) setsid sleep 60 & ;;
    *hangs.test) sleep 60 ;;
    *dies.test) exit 1 ;;
esac
echo "<testsuite><testcase name='a' classname='T'/></testsuite>" >$ROS_TEST_RESULTS_DIR/T.xml
"""


@pytest.mark.parametrize(
    ("name", "limit_s", "passed", "failed", "detail"),
    [
        ("works", 60.0, 1, 0, None),
        ("leaves", 60.0, 1, 1, "left processes behind"),
        ("hangs", 1.0, 0, 1, "not finished after"),
        ("dies", 60.0, 0, 1, "no test"),
    ],
)
def test_every_fate_of_a_rostest_is_counted(tmp_path, monkeypatch, name, limit_s, passed, failed, detail):
    fake = tmp_path / "bin" / "rostest"
    fake.parent.mkdir()
    fake.write_text(FAKE_ROSTEST)
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{fake.parent}:{os.environ['PATH']}")
    monkeypatch.setattr(rostests, "LEFTOVER_GRACE_S", 0.2)
    test = Rostest(tmp_path / f"{name}.test", "alpha", False)
    tally = rostests.run(test, tmp_path / "work", time_limit_s=limit_s)
    assert (tally.passed, tally.failed) == (passed, failed)
    assert detail is None or detail in tally.details[0]


def test_a_rostest_beside_others_ends_with_them(tmp_path, monkeypatch):
    fake = tmp_path / "rostest"
    fake.write_text(FAKE_ROSTEST)
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    ending = threading.Event()
    ending.set()
    with pytest.raises(rostests.Ended):
        rostests.run(Rostest(tmp_path / "hangs.test", "alpha", False, True), tmp_path / "work", 60.0, ending)


def test_rostests_with_the_longest_limits_begin_first(tmp_path, monkeypatch):
    begun = []
    monkeypatch.setattr(run_tests, "BESIDE", 1)
    monkeypatch.setattr(rostests, "run", lambda test, *_, **__: begun.append(test.path.name))
    tests = []
    for name, limit_s in (("short", 60), ("long", 900), ("middle", 300)):
        path = tmp_path / name
        path.write_text(f"<launch><test time-limit='{limit_s}'/></launch>")
        tests.append(Rostest(path, "alpha", False, True))
    beside = run_tests.Beside(tests)
    for test in beside.tests:
        beside.tally(test)
    beside.end()
    assert begun == [test.path.name for test in beside.tests] == ["long", "middle", "short"]


def test_comma_locale_is_in_force(tmp_path):
    environment = comma_locale.environment(tmp_path)
    program = "import locale; locale.setlocale(locale.LC_ALL, ''); print(locale.format_string('%.1f', 0.5))"
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "0,5\n"


def test_a_test_may_take_what_its_file_says(tmp_path):
    text = "<launch><test time-limit='2000'/><group><test time-limit='500'/></group></launch>"
    (tmp_path / "a.test").write_text(text)
    assert rostests.declared_s(tmp_path / "a.test") == 2560.0


def test_what_is_in_the_other_run_is_left_out_but_for_long_tests(tmp_path):
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    long:\n    once:\n    build:\n    tree:\n")
    (tmp_path / "test_one.py").write_text("import pytest\ndef test_plain(): pass\n" + "".join(
        "%sdef test_%s(): pass\n" % ("".join("@pytest.mark.%s\n" % mark for mark in marks), "_".join(marks))
        for marks in (("once",), ("build",), ("tree",), ("long",), ("long", "tree"))))

    def run(*options):
        done = subprocess.run([sys.executable, "-m", "pytest", "-v", "-p", "lab_tests.long_tests", *options, tmp_path],
                              text=True, capture_output=True, check=True,
                              env={**os.environ, "PYTHONPATH": str(ROOT / "tools")})
        return set(re.findall(r"::test_(\w+) PASSED", done.stdout))

    assert run("--in-this-run=once,build") == {"once", "build", "long", "long_tree"}
    assert run("--in-this-run=once,build", "--leave-out-long=%s" % (tmp_path / "left")) == {"once", "build"}
    assert (tmp_path / "left").read_text().split() == ["test_one.py::test_long", "test_one.py::test_long_tree"]
    assert run("--in-the-other-run=tree") == {"plain", "once", "build", "long", "long_tree"}


def test_every_test_is_in_one_of_the_two_runs():
    """With --long the first run leaves out tests marked `tree`; the one under the second locale always leaves out
    `build` and `once`."""
    marks = {path: set(re.findall(r"pytest\.mark\.(tree|once|build)\b", path.read_text(encoding="utf-8")))
             for folder in ("src", "tests") for path in (ROOT / folder).rglob("test_*.py") if path != Path(__file__)}
    assert {mark for found in marks.values() for mark in found} == {"tree", "once", "build"}
    assert not [str(path) for path, found in marks.items() if "tree" in found and len(found) > 1]


@pytest.mark.parametrize(("body", "code"), [("time.sleep(1000)", 0), ("while True: pass", 1)])
def test_a_thread_that_computes_after_the_last_test_fails_the_run(tmp_path, body, code):
    (tmp_path / "test_one.py").write_text("""import threading, time
def left():
    %s
def test_one():
    threading.Thread(target=left, daemon=True, name="left").start()
""" % body)
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "lab_tests.left_threads", tmp_path], text=True,
                          capture_output=True, check=False, env={**os.environ, "PYTHONPATH": str(ROOT / "tools")})
    assert done.returncode == code, done.stdout
    assert ("threads of this process still compute; there are: MainThread, left" in done.stdout) == bool(code)
