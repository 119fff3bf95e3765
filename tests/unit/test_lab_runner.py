# SPDX-License-Identifier: BSD-3-Clause
"""The test runner must not miss a failure: discovery, selection, counting, and left-over processes of a test."""

import fcntl
import os
import re
import signal
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path

import pytest

import run_tests
from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from lab_tests import comma_locale, processes, rostests, shared_labs
from lab_tests.discovery import SelectionError, changed_files, is_long, mostly_waits, select, take_inventory
from lab_tests.results import Tally, read_junit, read_rostest_results, summary

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = "<package format='3'><name>%s</name>%s</package>"
PASSING = "<testsuite tests='2'><testcase name='a' classname='T'/><testcase name='b' classname='T'/></testsuite>"
FAILING = "<testsuite tests='1'><testcase name='a' classname='T'><failure message='1 is not 2'/></testcase></testsuite>"
CRASHED = "<testsuite tests='1'><testcase name='testx' classname='R'><error message='none'/></testcase></testsuite>"
RAN = "<testsuite tests='1'><testcase name='testx' classname='R'/></testsuite>"


@pytest.fixture
def workspace(tmp_path):
    """Three packages, of which gamma needs beta; an ignored one, and tests of the whole tree."""
    files = {
        "src/group/alpha/package.xml": MANIFEST % ("alpha", ""),
        "src/group/alpha/test/unit/test_alpha.py": "",
        "src/group/alpha/test/unit/helper.py": "",
        "src/group/alpha/test/rostest/alpha.test": "<launch/>",
        "src/group/alpha/test/rostest/alpha_soak.test": "<launch><!-- long --></launch>",
        "src/beta/package.xml": MANIFEST % ("beta", ""),
        "src/beta/test/unit/test_beta.py": "",
        "src/gamma/package.xml": MANIFEST % ("gamma", "<exec_depend>beta</exec_depend>"),
        "src/gamma/test/unit/test_gamma.py": "",
        "src/copy/CATKIN_IGNORE": "",
        "src/copy/alpha/package.xml": MANIFEST % ("alpha", ""),
        "src/copy/alpha/test/unit/test_copy.py": "",
        "tests/package.xml": MANIFEST % ("workspace_tests", "<exec_depend>gamma</exec_depend>"),
        "tests/unit/test_lint.py": "pytestmark = pytest.mark.tree",
        "tests/unit/test_whole.py": "TEXT = 'pytestmark = pytest.mark.tree'",
        "tests/rostest/whole.test": "<!-- beside others --><launch/>",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def chosen(workspace, *arguments, changed=None):
    selection = select(take_inventory(workspace), list(arguments), workspace, changed)
    return [Path(target).name for target in selection.targets]


def test_everything_runs_without_names(workspace):
    assert chosen(workspace) == chosen(workspace, "-k", "alpha", "-x") == [
        "alpha.test", "alpha_soak.test", "test_alpha.py", "test_beta.py", "test_gamma.py", "whole.test", "test_lint.py",
        "test_whole.py"]


def test_marks_of_a_rostest(workspace):
    soak, whole = (workspace / name for name in ("src/group/alpha/test/rostest/alpha_soak.test",
                                                 "tests/rostest/whole.test"))
    assert (is_long(soak), mostly_waits(soak), is_long(whole), mostly_waits(whole)) == (True, False, False, True)


@pytest.mark.parametrize(("name", "files"), [
    ("alpha", ["alpha.test", "alpha_soak.test", "test_alpha.py"]),  # a package that has the name of a test file
    ("beta", ["test_beta.py"]),
    ("workspace_tests", ["whole.test", "test_lint.py", "test_whole.py"]),
    ("test_alpha", ["test_alpha.py"]),
    ("test_alpha.py::test_one", ["test_alpha.py::test_one"]),
    ("whole.test", ["whole.test::rostest"]),
    ("alpha_soak", ["alpha_soak.test::rostest"]),
    ("ruff", ["test_lint.py::test_ruff"]),
])
def test_names_select(workspace, name, files):
    assert chosen(workspace, name) == files


def test_files_that_are_named_twice_run_once(workspace):
    assert chosen(workspace, "beta", "test_beta", "test_beta.py") == ["test_beta.py"]


def test_path_selects(workspace):
    assert chosen(workspace, str(workspace / "src/beta/test/unit/test_beta.py")) == ["test_beta.py"]


def test_a_folder_selects_what_is_below_it(workspace, monkeypatch):
    monkeypatch.chdir(workspace)
    assert chosen(workspace, "src/group/") == chosen(workspace, "alpha")
    assert chosen(workspace, "./src") == chosen(workspace, "alpha", "beta", "gamma")
    with pytest.raises(SelectionError, match="'src/copy/alpha'"):
        chosen(workspace, "src/copy/alpha")


def test_unknown_name_lists_the_packages(workspace):
    with pytest.raises(SelectionError, match="delta.*alpha, beta, gamma, workspace_tests"):
        chosen(workspace, "delta")


def test_changed_packages_bring_those_that_depend_on_them(workspace):
    lint = ["test_lint.py::test_ruff", "test_lint.py::test_catkin_lint", "test_lint.py"]
    assert chosen(workspace, changed=[workspace / "src/gamma/x.py"]) == ["test_gamma.py", *lint]
    assert chosen(workspace, changed=[workspace / "src/beta/setup.py"]) == ["test_beta.py", "test_gamma.py", *lint]
    assert chosen(workspace, changed=[workspace / "tools/x.py"])[:3] == ["whole.test", "test_lint.py", "test_whole.py"]
    assert chosen(workspace, changed=[]) == []
    assert chosen(workspace, "alpha", changed=[]) == chosen(workspace, "alpha")
    assert chosen(workspace, "beta", changed=[workspace / "src/gamma/x.py"])[:2] == ["test_beta.py", "test_gamma.py"]


def test_an_option_without_its_value_is_refused(workspace):
    with pytest.raises(SelectionError, match="-k needs a value"):
        chosen(workspace, "alpha", "-k")


def test_a_test_is_looked_for_where_several_files_have_its_files_name(workspace):
    for package, name in (("src/beta", "one"), ("src/gamma", "two")):
        (workspace / package / "test/unit/test_same.py").write_text(f"def test_{name}(): pass")
    targets = select(take_inventory(workspace), ["test_same.py::test_two[a::b]"], workspace, None).targets
    assert targets == [f"{workspace}/src/gamma/test/unit/test_same.py::test_two[a::b]"]


def test_a_test_file_that_is_no_text_has_no_marks(workspace):
    path = workspace / "src/group/alpha/test/rostest/alpha.test"
    path.write_bytes(b"<launch><!-- f\xfcr --><!-- shared lab -->")
    assert not is_long(path) and shared_labs.lab_of(path) is None


def test_changed_files_are_those_that_differ_from_a_commit_and_new_ones(tmp_path):
    def git(*words):
        subprocess.run(["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=b", *words], check=True,
                       capture_output=True)
    for name in ("same", "edited", "moved"):
        (tmp_path / name).write_text("1" + name)
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "one")
    (tmp_path / "edited").write_text("2")
    (tmp_path / "new \u00c4").write_text("1")
    git("mv", "moved", "elsewhere")
    expected = [tmp_path / name for name in ("edited", "elsewhere", "moved", "new \u00c4")]
    assert changed_files(tmp_path, "HEAD") == expected
    with pytest.raises(SelectionError, match="nowhere"):
        changed_files(tmp_path, "nowhere")


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
    *ahead.test) [[ $LAB_REAL_TIME_FACTOR == 3 ]] || exit 1 ;;
    *in_time.test) [[ $LAB_REAL_TIME_FACTOR == 1 ]] || exit 1 ;;
    *as_usual.test) [[ -z $LEFT_BY_A_UNIT_TEST && $LC_ALL != de_DE* ]] || exit 1 ;;
esac
echo "<testsuite><testcase name='a' classname='T'/></testsuite>" >$ROS_TEST_RESULTS_DIR/T.xml
"""


@pytest.fixture
def fake_rostest(tmp_path, monkeypatch):
    fake = tmp_path / "bin" / "rostest"
    fake.parent.mkdir()
    fake.write_text(FAKE_ROSTEST)
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{fake.parent}:{os.environ['PATH']}")


@pytest.mark.parametrize(
    ("name", "limit_s", "passed", "failed", "detail"),
    [
        ("works", 60.0, 1, 0, None),
        ("leaves", 60.0, 1, 1, "left processes behind"),
        ("hangs", 1.0, 0, 1, "not finished after"),
        ("dies", 60.0, 0, 1, "no test"),
    ],
)
def test_every_fate_of_a_rostest_is_counted(tmp_path, fake_rostest, monkeypatch, name, limit_s, passed, failed, detail):
    monkeypatch.setattr(rostests, "LEFTOVER_GRACE_S", 0.2)
    path = tmp_path / f"{name}.test"
    path.write_text("<launch/>")
    tally = rostests.run(path, tmp_path / "work", dict(os.environ), time_limit_s=limit_s)
    assert (tally.passed, tally.failed) == (passed, failed)
    assert detail is None or detail in tally.details[0]


@pytest.mark.parametrize(("name", "mark"), [("ahead", ""), ("in_time", "<!-- real time -->")])
def test_labs_run_ahead_unless_the_file_says_real_time(tmp_path, fake_rostest, name, mark):
    path = tmp_path / f"{name}.test"
    path.write_text(f"{mark}<launch/>")
    assert rostests.run(path, tmp_path / "work", dict(os.environ)).failed == 0


def test_the_comma_locale_is_there_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    run, seen = subprocess.run, []

    def localedef(*words, **options):
        done = run(*words, **options)
        seen.append((tmp_path / comma_locale.NAME).exists())
        run([*words[0][:-1], str(tmp_path / comma_locale.NAME)], **options)  # another worker, which is first
        return done

    monkeypatch.setattr(comma_locale.subprocess, "run", localedef)
    comma_locale.variables(tmp_path)
    assert seen == [False] and [path.name for path in tmp_path.iterdir()] == [comma_locale.NAME]


def test_comma_locale_is_in_force(tmp_path):
    environment = {**os.environ, **comma_locale.variables(tmp_path)}
    program = "import locale; locale.setlocale(locale.LC_ALL, ''); print(locale.format_string('%.1f', 0.5))"
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "0,5\n"


def test_a_test_may_take_what_its_file_says(tmp_path):
    text = "<launch><test time-limit='2000'/><group><test time-limit='500'/></group></launch>"
    (tmp_path / "a.test").write_text(text)
    assert rostests.declared_s(tmp_path / "a.test") == 2560.0


UNIT = """import ctypes, threading, time
import pytest

def test_comma_locale():
    number = ctypes.c_double(1.5)
    text = ctypes.create_string_buffer(8)
    ctypes.CDLL(None).snprintf(text, 8, b"%%.1f", number)
    assert text.value == b"1,5"

@pytest.mark.long
def test_slow():
    pass

def test_fails():
    assert 1 == 2

def test_skipped():
    pytest.skip("no zsh here")

def test_skipped_without_a_reason():
    pytest.skip()

def left():
    time.sleep(1000) if %r else all(True for _ in iter(int, 1))

def test_leaves_a_thread():
    threading.Thread(target=left, daemon=True, name="left").start()
"""


ENVIRONMENT = {"PYTHONPATH": f"{ROOT / 'tools'}:{os.environ.get('PYTHONPATH', '')}"}


# run_tests.py for the files of a folder.
CANCELLED = """import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import run_tests
from lab_tests.discovery import Selection
run_tests.select = lambda *words: Selection([str(path) for path in Path(sys.argv[2]).glob("test_*.py")], ["-s"])
sys.exit(run_tests.main([]))
"""
ROUNDS = "import sys, pytest; sys.exit(max(int(pytest.main(sys.argv[2:])) for _ in range(int(sys.argv[1]))))"


def run_pytest(folder, *words, rounds=1):
    """The output of a run of the files in a folder."""
    files = sorted(str(path) for pattern in ("test_*.py", "*.test") for path in folder.rglob(pattern))
    return subprocess.run([sys.executable, "-c", ROUNDS, str(rounds), "-q", "-p", "lab_tests.plugin",
                           "-c", ROOT / "pytest.ini", "--rootdir", folder, *words, *files], capture_output=True,
                          text=True, cwd=folder, env={**os.environ, **ENVIRONMENT, "LC_ALL": "C.UTF-8"})


@pytest.mark.parametrize("words", [[], ["-n3", "--dist=loadscope"]], ids=["one process", "workers"])
def test_a_run_counts_everything(tmp_path, fake_rostest, words):
    for name in ("one", "two"):
        (tmp_path / f"test_{name}.py").write_text(UNIT % True)
    (tmp_path / "rostest").mkdir()
    for name in ("works", "dies", "soak"):
        (tmp_path / f"rostest/{name}.test").write_text("<launch>%s</launch>" % ("<!-- long -->" * (name == "soak")))
    done = run_pytest(tmp_path, *words)
    last = done.stdout.splitlines()[-1]
    assert last == "5 passed, 5 failed, 2 skipped, 3 long not run", done.stdout
    assert done.returncode == 1 and "test_one.py::test_skipped_without_a_reason: skipped without" in done.stdout


@pytest.mark.parametrize("words", [[], ["-n3", "--dist=loadscope"]], ids=["one process", "workers"])
def test_tests_are_listed_without_a_run(tmp_path, words):
    (tmp_path / "test_one.py").write_text(
        "import atexit, shutil, tempfile\natexit.register(shutil.rmtree, tempfile.mkdtemp())\ndef test_one(): pass")
    done = run_pytest(tmp_path, "--collect-only", "-q", *words)
    assert (done.returncode, done.stderr, "test_one.py: 1" in done.stdout) == (0, "", True), done.stdout
    assert done.stdout.splitlines()[-1] == "0 passed, 0 failed, 0 skipped, 0 long not run"


@pytest.mark.parametrize("words", [[], ["-n3", "--dist=loadscope"]], ids=["one process", "workers"])
def test_rounds_follow_each_other(tmp_path, words):
    (tmp_path / "test_one.py").write_text("import tempfile\ndef test_one(): tempfile.TemporaryFile().close()")
    done = run_pytest(tmp_path, *words, rounds=2)
    assert (done.returncode, done.stdout.count("1 passed, 0 failed, 0 skipped")) == (0, 2), done.stdout + done.stderr


@pytest.mark.parametrize("words", [[], ["-n3", "--dist=loadscope"]], ids=["one process", "workers"])
def test_a_wrong_expression_is_named(tmp_path, words):
    (tmp_path / "test_one.py").write_text("def test_one(): pass")
    done = run_pytest(tmp_path, "-k", "one and", *words)
    assert done.returncode == 4 and "'-k': one and" in done.stdout and "test_one.py" not in done.stdout
    assert done.stdout.splitlines()[-1].startswith("0 passed, 1 failed")


def test_a_run_beside_another_one_says_so(tmp_path):
    (tmp_path / "test_one.py").write_text("def test_one(): pass")
    assert "Another run" not in run_pytest(tmp_path, rounds=2).stdout
    with (tmp_path / ".baxter/tests/run.lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        assert "Another run" in run_pytest(tmp_path).stdout


def test_a_worker_that_dies_fails_its_test_and_the_others_run(tmp_path):
    for name, what in {"dies": "import os; os.kill(os.getpid(), 9)", "exits": "import os; os._exit(0)", "one": "pass",
                       "two": "pass", "three": "pass"}.items():
        (tmp_path / f"test_{name}.py").write_text(
            f"def test_before(): pass\ndef test_it(): {what}\ndef test_after(): pass\n")
    done = run_pytest(tmp_path, "-n4", "--dist=loadscope")
    assert (done.stdout.splitlines()[-1], done.returncode) == ("13 passed, 2 failed, 0 skipped, 0 long not run", 1)
    assert "test_dies.py::test_it" in done.stdout and "test_exits.py::test_it" in done.stdout, done.stdout


@pytest.mark.parametrize("words", [[], ["-n4", "--dist=loadscope"]], ids=["one process", "workers"])
def test_a_module_that_is_skipped_and_what_is_expected_to_fail_are_named(tmp_path, words):
    (tmp_path / "test_one.py").write_text("import pytest\npytest.skip('no camera', allow_module_level=True)")
    (tmp_path / "test_two.py").write_text(
        "import pytest\n@pytest.mark.xfail(reason='not yet')\ndef test_one(): assert 0\ndef test_two(): pass")
    done = run_pytest(tmp_path, *words)
    last = done.stdout.splitlines()
    assert (last[-1], done.returncode) == ("1 passed, 0 failed, 2 skipped, 0 long not run", 0), done.stdout
    assert "skipped: no camera" in last and "skipped: expected to fail: not yet" in last


@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_a_run_that_is_cancelled_leaves_nothing(tmp_path, sign):
    (tmp_path / "test_one.py").write_text("""import subprocess, sys
def test_one():
    child = subprocess.Popen(["sleep", "1000"], start_new_session=True)
    print("child", child.pid, file=sys.__stdout__, flush=True)
    child.wait()
""")
    run = subprocess.Popen([sys.executable, "-c", CANCELLED, str(ROOT / "tools"), str(tmp_path)], text=True,
                           stdout=subprocess.PIPE, env={**os.environ, **ENVIRONMENT, "TMPDIR": str(tmp_path)})
    try:
        child = next(int(line.split()[-1]) for line in run.stdout if "child" in line)
        run.send_signal(sign)
        rest = run.stdout.read()
        assert run.wait(60.0) != 0 and re.fullmatch(r"0 passed, [01] failed, .*", rest.splitlines()[-1]), rest
        wait_until(lambda: not is_alive(child), "the end of what a test has started", 30.0)
        assert not list(tmp_path.glob("lab_tests_*"))
    finally:
        run.kill()
        run.wait()


def test_long_tests_of_both_kinds_are_listed_by_their_mark(tmp_path):
    (tmp_path / "test_one.py").write_text(UNIT % True)
    (tmp_path / "rostest").mkdir()
    for name in ("works", "soak"):
        (tmp_path / f"rostest/{name}.test").write_text("<launch>%s</launch>" % ("<!-- long -->" * (name == "soak")))
    done = run_pytest(tmp_path, "--collect-only", "-m", "long")
    assert done.returncode == 0 and [line for line in done.stdout.splitlines() if "::" in line] == [
        "rostest/soak.test::rostest", "test_one.py::test_slow"]


def test_an_error_of_pytest_itself_fails_the_run(tmp_path):
    (tmp_path / "test_one.py").write_text("def test_one(): pass")
    (tmp_path / "conftest.py").write_text("def pytest_runtest_logfinish(): raise RuntimeError('broken')")
    done = run_pytest(tmp_path)
    assert done.returncode != 0 and done.stdout.splitlines()[-1].startswith("1 passed, 1 failed")


def test_rostests_have_the_environment_of_the_command(tmp_path, fake_rostest):
    (tmp_path / "test_one.py").write_text("import os\nos.environ['LEFT_BY_A_UNIT_TEST'] = '1'\ndef test_one(): pass")
    (tmp_path / "rostest").mkdir()
    (tmp_path / "rostest/z_as_usual.test").write_text("<launch/>")
    assert run_pytest(tmp_path).stdout.splitlines()[-1].startswith("2 passed, 0 failed")


def test_a_thread_that_computes_after_the_last_test_fails_the_run(tmp_path):
    (tmp_path / "test_one.py").write_text(UNIT % False)
    done = run_pytest(tmp_path, "-k", "leaves or comma")
    assert "there are: MainThread, left" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("2 passed, 1 failed")


@pytest.mark.parametrize("words", [[], ["-n3", "--dist=loadscope"]], ids=["one process", "workers"])
def test_a_temporary_file_that_a_test_leaves_is_named_and_removed(tmp_path, words):
    (tmp_path / "test_one.py").write_text("import os, tempfile\ndef test_one(tmp_path):\n    tempfile.mkstemp('left')\n"
                                          "    os.system('mktemp -t XXXXXXleft')")
    before = set(Path(tempfile.gettempdir()).iterdir())
    done = run_pytest(tmp_path, *words)
    assert "left 2 temporary files" in done.stdout, done.stdout
    assert done.stdout.splitlines()[-1].startswith("1 passed, 0 failed"), done.stdout
    assert not {path.name for path in set(Path(tempfile.gettempdir()).iterdir()) - before if "left" in path.name}


def test_orders_are_the_longest_first_or_shuffled_by_a_seed(tmp_path):
    def order(*words):
        return re.findall(r"^(test_\w+\.py::\w+)", run_pytest(tmp_path, "--collect-only", *words).stdout, re.MULTILINE)
    for name in "abcd":
        (tmp_path / f"test_{name}.py").write_text("def test_1(): pass\ndef test_2(): pass\ndef test_3(): pass\n")
    assert order() == sorted(order())
    assert order("--shuffle=1") == order("--shuffle=1") != order("--shuffle=2")
    assert sorted(order("--shuffle=1")) == order()


def test_ros_tests_that_never_ran_do_not_come_last(tmp_path):
    (tmp_path / "test_quick.py").write_text("def test_1(): pass\n")
    (tmp_path / "rostest").mkdir()
    (tmp_path / "rostest/new.test").write_text("<launch/>")
    order = re.findall(r"^\S+::\w+", run_pytest(tmp_path, "--collect-only").stdout, re.MULTILINE)
    assert order == ["rostest/new.test::rostest", "test_quick.py::test_1"]


EXAMPLES = """import time
from hypothesis import given, settings, strategies
@given(strategies.integers())
def test_quick(number): print("one of quick")
@settings(max_examples=2)
@given(strategies.integers())
def test_on_a_busy_machine(number): time.sleep(0.3)
"""


@pytest.mark.parametrize(("words", "examples"), [([], 50), (["--long"], 500), (["-n1"], 50)])
def test_examples_are_few_unless_long_tests_run_and_their_time_is_no_failure(tmp_path, words, examples):
    (tmp_path / "test_one.py").write_text(EXAMPLES)
    done = run_pytest(tmp_path, "-rP", *words)
    assert done.stdout.splitlines()[-1].startswith("2 passed, 0 failed"), done.stdout
    assert done.stdout.splitlines().count("one of quick") == examples


CONSTANTS = """import sys
sys.path += ["src", "devel"]
import generated, own
from hypothesis import given, strategies
from hypothesis.internal.conjecture import providers
@given(strategies.integers())
def test_one(number):
    assert set(providers._get_local_constants().integers) == {12345}
"""


def test_examples_take_constants_of_the_workspace_and_none_of_generated_code(tmp_path):
    for folder, name, number in (("src", "own", 12345), ("devel", "generated", 67890)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{name}.py").write_text(f"NUMBER = {number}")
    (tmp_path / "test_one.py").write_text(CONSTANTS)
    assert run_pytest(tmp_path).stdout.splitlines()[-1].startswith("1 passed, 0 failed")


COLLECTED = """import os
with open(os.environ["PYTEST_XDIST_WORKER"] + ".txt", "a") as stream:
    stream.write(__name__ + "\\n")
def test_one(): pass
"""


def test_each_worker_begins_its_collection_with_other_files(tmp_path):
    for name in "abcdef":
        (tmp_path / f"test_{name}.py").write_text(COLLECTED)
    done = run_pytest(tmp_path, "-n4", "--dist=loadscope")
    assert done.stdout.splitlines()[-1].startswith("6 passed, 0 failed")
    firsts = [(tmp_path / f"gw{number}.txt").read_text().split()[0] for number in range(2)]
    assert firsts == ["test_a", "test_d"]


@pytest.mark.parametrize(("files", "waiting"), [(1, 0), (1, 3), (4, 1)])
def test_workers_beside_the_cores_import_no_python_file_and_run_what_waits(tmp_path, fake_rostest, files, waiting):
    for name in "abcd"[:files]:
        (tmp_path / f"test_{name}.py").write_text(COLLECTED)
    (tmp_path / "rostest").mkdir()
    for number in range(waiting):
        (tmp_path / f"rostest/works_{number}.test").write_text("<!-- beside others --><launch/>")
    done = run_pytest(tmp_path, "-n3", "--dist=loadscope")
    assert done.stdout.splitlines()[-1].startswith(f"{files + waiting} passed, 0 failed"), done.stdout
    assert {path.stem for path in tmp_path.glob("gw*.txt")} == {"gw0"}


def test_modules_are_compiled_once_for_all_programs_of_a_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for name in ("PYTHONDONTWRITEBYTECODE", "PYTHONPATH"):
        monkeypatch.setenv(name, "1")
    with pytest.raises(SystemExit):
        run_tests.main(["no_such_package"])
    assert "PYTHONDONTWRITEBYTECODE" not in os.environ and not sys.dont_write_bytecode


def test_a_run_that_is_ended_leaves_no_process(tmp_path, fake_rostest):
    (tmp_path / "rostest").mkdir()
    for name in ("a_hangs", "b_hangs", "c_hangs"):
        (tmp_path / f"rostest/{name}.test").write_text("<launch/>")
    mark = uuid.uuid4().hex
    environment = {**os.environ, **ENVIRONMENT, processes.RUN_MARKER: mark}
    # Two of the workers take only files that mostly wait.
    words = ["-q", "-p", "lab_tests.plugin", "-c", str(ROOT / "pytest.ini"), "-n4", "--dist=loadscope",
             f"--rootdir={tmp_path}"]
    files = [str(path) for path in (tmp_path / "rostest").iterdir()]
    child = subprocess.Popen([sys.executable, "-m", "pytest", *words, *files], cwd=tmp_path, env=environment,
                             stdout=subprocess.DEVNULL, start_new_session=True)

    def rostests_running():
        return [line for line in processes.marked(mark, processes.RUN_MARKER).values() if "bin/rostest" in line]
    try:
        wait_until(lambda: len(rostests_running()) >= 2, "two tests run", 60.0)
        os.killpg(child.pid, signal.SIGINT)  # as Ctrl-C in a terminal
        child.wait(60)
        assert processes.wait_until_gone(mark, 30.0, processes.RUN_MARKER) == {}
    finally:
        processes.kill_all(mark, processes.RUN_MARKER)


@pytest.mark.parametrize(("codes", "rounds"), [((1, 0), 2), ((2, 0), 1)], ids=["fails", "interrupted"])
def test_a_round_that_fails_can_be_repeated_by_its_seed_and_all_count(monkeypatch, capsys, codes, rounds):
    from lab_tests.plugin import FINISHED
    ran = []

    def one_round(words):
        ran.append(words)
        FINISHED.append(Tally(passed=3, failed=1, details=[f"test_{len(ran)}"], long=["test_soak"]))
        return codes[len(ran) - 1]

    monkeypatch.setattr(run_tests.pytest, "main", one_round)
    options = run_tests.parser().parse_args(["--repeat=2", "--shuffle=7"])
    assert run_tests.run(run_tests.Selection([], []), options) == codes[0]
    assert [words[0] for words in ran] == ["--shuffle=7", "--shuffle=8"][:rounds]
    said = capsys.readouterr().out.splitlines()
    assert said[1:1 + rounds] == ["Round 1 of 2 --shuffle=7", "Round 2 of 2 --shuffle=8"][:rounds]
    assert said[-1] == f"{3 * rounds} passed, {rounds} failed, 0 skipped, 1 long not run"


@pytest.mark.parametrize("number", ["0", "-1", "1.5", "x"])
def test_rounds_are_one_or_more(number, capsys):
    with pytest.raises(SystemExit, match="2"):
        run_tests.parse([f"--repeat={number}"])
    assert "expected a number from 1 on" in capsys.readouterr().err


def test_without_names_a_busy_run_has_the_main_flows_whatever_pytests_options_are():
    assert run_tests.parse(["--busy", "--durations=3", "-k", "a"]).rest[-len(run_tests.MAIN_FLOWS):] == [
        *run_tests.MAIN_FLOWS]


def test_help_names_every_option(capsys):
    with pytest.raises(SystemExit) as ending:
        run_tests.main(["--help"])
    assert ending.value.code == 0
    told = capsys.readouterr().out
    assert all(word in told for word in ("--changed", "--long", "--busy", "--repeat", "--shuffle"))


def test_tests_of_rostest_skip_so_that_it_is_counted():
    command = ["git", "-C", ROOT, "grep", "-lE", r"self[.]skipTest[(]|@unittest[.]skip", "--", "*/test/*.py", "tests/"]
    found = subprocess.run(command, capture_output=True, text=True).stdout.split()
    assert found == []
