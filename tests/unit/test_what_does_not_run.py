# SPDX-License-Identifier: BSD-3-Clause
"""Tests that did not run are counted and named, with the reason."""

import contextlib
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import run_tests
from lab_tests import rostests
from lab_tests.discovery import Selection, select, take_inventory
from lab_tests.results import Tally, read_junit, read_rostest_results, summary

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]
SKIPS = """<testsuite><testcase classname="a" name="b"><skipped type="pytest.skip" message="no zsh
 here"/></testcase><testcase classname="a" name="c"><skipped message="%s"/></testcase></testsuite>"""


def test_the_last_line_begins_as_ever_and_counts_what_did_not_run():
    tally = Tally(passed=2, skips=[("a.b", "no zsh here"), ("a.c", "no zsh here"), ("a.b", "no zsh here")],
                  long=["tests/unit/test_x.py::test_one", "tests/unit/test_x.py::test_two", "a/long.test::soak"])
    assert summary(tally).splitlines() == [
        "skipped: no zsh here", "    a.b", "    a.c", "long, not run (--long, or by name):", "    a/long.test",
        "    tests/unit/test_x.py, 2 tests", "2 passed, 0 failed, 3 skipped, 3 long not run"]
    assert summary(Tally(passed=1, failed=1)) == "1 passed, 1 failed, 0 skipped, 0 long not run"


def test_failures_are_told_once_more_before_the_last_line():
    lines = summary(Tally(failed=1, details=["a.b\nassert 1 == 2"])).splitlines()
    assert lines == ["failed:", "    a.b", "    assert 1 == 2", "0 passed, 1 failed, 0 skipped, 0 long not run"]
    lines = summary(Tally(failed=25, details=["x" * 5000] * 25)).splitlines()
    assert len(lines) == 23 and lines[-2] == "    and 5 more" and len("".join(lines)) < 30_000


@pytest.mark.parametrize(("reason", "skipped", "failed"), [
    ("not root", 2, 0), ("", 1, 1), ("unconditional skip", 1, 1)])
def test_a_skip_needs_a_reason(tmp_path, reason, skipped, failed):
    (tmp_path / "a.xml").write_text(SKIPS % reason)
    tally = read_junit(tmp_path / "a.xml")
    tally.refuse_bare_skips()
    assert (tally.skipped, tally.failed, tally.skips[0]) == (skipped, failed, ("a.b", "no zsh here"))
    assert all("a.c: skipped without a reason" in detail for detail in tally.details)


ROSTEST_NODE = """
import unittest
from rosunit.xmlrunner import XMLTestRunner
from lab_testing.skipping import skip

class Case(unittest.TestCase):
    def test_runs(self):
        pass
    def test_cannot(self):
        skip(self, "no screen")

with open("T.xml", "w") as stream:
    XMLTestRunner(stream).run(unittest.defaultTestLoader.loadTestsFromTestCase(Case))
"""


def test_a_test_of_rostest_that_is_skipped_has_not_passed(tmp_path):
    environment = {**os.environ, "ROS_TEST_RESULTS_DIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", ROSTEST_NODE], cwd=tmp_path, env=environment, check=True)
    tally = read_rostest_results(tmp_path)
    assert (tally.passed, tally.failed, tally.skips) == (1, 0, [("Case.test_cannot", "no screen")])


LONG = """import pytest

def test_quick():
    pass

@pytest.mark.long
def test_slow():
    pass

@pytest.mark.long
@pytest.mark.tree
def test_slower():
    pass

@pytest.mark.tree
def test_in_the_other_run():
    pass

@pytest.mark.%s
def test_once():
    pass
""" % "once"  # in two parts: test_lab_runner.py reads the marks of this file


@pytest.mark.parametrize(("words", "ran", "left_out"), [
    ([], ["test_once"], ["test_a.py::test_slow", "test_a.py::test_slower"]),
    (["--long"], ["test_quick", "test_slow", "test_slower", "test_once"], None),
    (["-k", "slower"], [], ["test_a.py::test_slower"]),
    (["-m", "long"], ["test_slow", "test_slower"], None),
    (["-m", "tree"], ["test_slower", "test_in_the_other_run"], None),
])
def test_long_tests_are_left_out_and_named(tmp_path, monkeypatch, words, ran, left_out):
    (tmp_path / "test_a.py").write_text(LONG)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    long: long\n    tree: tree\n    once: once\n")
    monkeypatch.setattr(run_tests, "ROOT", tmp_path)
    monkeypatch.setattr(run_tests, "WORK", tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "tools"), prepend=os.pathsep)
    monkeypatch.setattr(run_tests, "start_unit_under_comma_locale", lambda targets: run_tests.FailedStart("not here"))
    is_long, arguments = "--long" in words, [word for word in words if word != "--long"]
    selection = Selection([], ["test_a.py"], [], arguments, is_whole_suite=not arguments)
    with contextlib.ExitStack() as ending:
        tally = next(run for title, run in run_tests.layers(selection, is_long, 1.0, ending) if title == "unit tests")()
    report = ElementTree.parse(tmp_path / "unit.xml")
    assert [case.get("name") for case in report.iter("testcase")] == ran
    assert tally.long == (left_out or [])
    assert (tally.passed, tally.failed) == (len(ran), 0)


def test_long_rostests_of_what_was_named_are_left_out():
    inventory = take_inventory(ROOT)
    long = [test for test in inventory.rostests if test.is_long]
    assert long and select(inventory, [], False).left_out == long
    one = long[0]
    assert one in select(inventory, [one.package], False).left_out
    for words, is_long in (([one.package], True), ([one.path.name], False), ([one.package, one.path.name], False)):
        selection = select(inventory, words, is_long)
        assert one in selection.rostests and one not in selection.left_out
    assert all(name.startswith(f"{one.path.relative_to(ROOT)}::") for name in rostests.names(one, ROOT))


def files_that_say(*words):
    """Names of the test files that contain one of the words."""
    command = ["git", "-C", str(ROOT), "ls-files", "*.py", "*.test"]
    names = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    paths = [ROOT / name for name in names if "/test/" in name or name.startswith("tests/")]
    paths = [path for path in paths if path.is_file() and path != Path(__file__)]
    texts = [(path.name, path.read_text(encoding="utf-8")) for path in paths]
    return {name for name, text in texts if any(word in text for word in words)}


def test_contributing_says_which_tests_are_long_and_which_may_be_skipped():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    long, skipped = (page.partition(head)[2].partition("\n\n")[0] for head in ("`--long` alone", "what is skipped"))
    marks = ("pytest.mark.long", "<!-- long -->")
    assert files_that_say(*marks) - {"test_lab_runner.py"} == set(re.findall(r"`(\w+\.(?:py|test))`", long))
    may_skip = files_that_say("pytest.skip(", "pytest.importorskip(", "mark.skipif(")
    assert may_skip - set(re.findall(r"`(\w+\.py)`", skipped)) == set()


def test_tests_of_rostest_skip_so_that_it_is_counted():
    assert files_that_say("self.skipTest(", "@unittest.skip") == set()
