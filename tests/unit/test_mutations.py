# SPDX-License-Identifier: BSD-3-Clause
"""tests/mutations: every fault fits the code as it is; the runner tells found from survived and leaves no trace."""

import importlib.util
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lab_testing.waiting import stretched, wait_until

MUTATIONS = Path(__file__).resolve().parents[1] / "mutations"
sys.path.insert(0, str(MUTATIONS))
import faults  # noqa: E402

# Other folders have a run.py, too.
_SPEC = importlib.util.spec_from_file_location("mutations_run", MUTATIONS / "run.py")
run = sys.modules["mutations_run"] = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(run)

pytestmark = pytest.mark.tree

CODE = "def double(x):\n    return x + x\n\n\ndef half(x):\n    return x / 2  # exact\n"
# In place of the workspace's: tests double() alone, writes beside the code, and prints as the real one.
TESTS = """
import sys
from pathlib import Path
sys.path.insert(0, "src/alpha")
import code_of_alpha
Path("src/alpha/result").write_text(" ".join(sys.argv[1:]))
works = code_of_alpha.double(3) == 6 and not Path("src/alpha/always_fails").exists()
if not works:
    print("failed:\\n    src/alpha/test/unit/test_alpha.py::test_double\\n    E assert")
print("%d passed, %d failed, 0 skipped, 0 long not run" % (works, not works))
sys.exit(not works)
"""
WRONG_SIGN = faults.Fault("wrong-sign", "src/alpha/code_of_alpha.py", "sign", "all is 0", "unit", ("alpha",), "x + x",
                          "x - x")


def with_texts(old, new, **fields):
    return faults.Fault(**{**vars(WRONG_SIGN), "old": old, "new": new, **fields})


@pytest.fixture
def workspace(tmp_path):
    files = {"src/alpha/package.xml": "<package format='3'><name>alpha</name></package>",
             "src/alpha/code_of_alpha.py": CODE, "src/alpha/test/unit/test_alpha.py": "", "tools/run_tests.py": TESTS}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def trial(workspace):
    made = run.Trial(workspace, limit_s=120.0)
    try:
        made.check_machine()
    except run.NoOverlay as error:
        pytest.skip(f"this machine allows no overlay in a mount name space: {error}")
    return made


def content(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# -- the list -------------------------------------------------------------------------------------------------------

def test_every_fault_fits_the_code():
    found = faults.read_faults()
    assert len(found) >= 40 and run.problems(found) == []


def test_faults_are_spread_over_all_rooms_and_half_take_integration():
    found = faults.read_faults()
    rooms = {fault.file.split("/")[1] for fault in found if fault.file.startswith("src/")}
    assert rooms >= {"base", "baxter", "classroom", "courses", "lab", "planning", "ros_control", "simulator", "web"}
    assert 2 * sum(fault.by == "integration" for fault in found) >= len(found)


@pytest.mark.parametrize(("old", "new", "told"), [
    ("x * x", "x - x", "0 times"),
    ("(x)", "(y)", "2 times"),
    ("x + x", "x +", "cannot be read"),
    ("# exact", "# nearly", "the same"),
])
def test_a_fault_that_does_not_fit_is_told(workspace, old, new, told):
    assert [told in text for text in run.problems([with_texts(old, new)], workspace)] == [True]


def test_missing_files_and_tests_are_told(workspace):
    moved = with_texts("x + x", "x - x", file="src/alpha/moved.py")
    untested = with_texts("x + x", "x - x", tests=("beta",))
    assert ["moved.py" in run.problems([moved], workspace)[0], "beta" in run.problems([untested], workspace)[0]] == [
        True, True]


@pytest.mark.parametrize(("entry", "told"), [
    ("{id: a, file: b}", "fields id, file"),
    ("{id: a, file: b, kind: c, seen: d, by: unit, tests: [e], old: f, new: g}", "twice"),
    ("{id: z, file: b, kind: c, seen: d, by: luck, tests: [e], old: f, new: g}", "integration"),
])
def test_a_bad_list_is_refused(tmp_path, entry, told):
    (tmp_path / "list.yaml").write_text(
        f"- {{id: a, file: b, kind: c, seen: d, by: unit, tests: [e], old: f, new: g}}\n- {entry}\n")
    with pytest.raises(faults.FaultError, match=told):
        faults.read_faults(tmp_path / "list.yaml")


def test_a_sample_is_the_same_for_the_same_seed():
    every = faults.read_faults()
    first, again, other = (faults.chosen(every, [], 10, seed) for seed in (7, 7, 8))
    assert len(first) == 10 and first == again != other
    assert faults.chosen(every, [every[3].id], None, 1) == [every[3]]
    with pytest.raises(faults.FaultError, match="no fault nonsense"):
        faults.chosen(every, ["nonsense"], None, 1)


# -- the runner -----------------------------------------------------------------------------------------------------

def test_found_and_survived_and_the_tree_stays_as_it_was(workspace, trial):
    before = content(workspace)
    found = trial.run(WRONG_SIGN)
    survived = trial.run(with_texts("x / 2", "x / 3"))
    gone = trial.run(with_texts("x * x", "x - x"))
    assert (found.outcome, found.failing_test) == (run.FOUND, "src/alpha/test/unit/test_alpha.py::test_double")
    assert (survived.outcome, survived.failing_test) == (run.SURVIVED, "")
    assert gone.outcome == run.NOT_RUN and "0 times" in gone.failing_test
    assert content(workspace) == before


def test_a_test_that_fails_without_the_fault_finds_nothing(workspace, trial):
    (workspace / "src/alpha/always_fails").write_text("")
    assert trial.run(WRONG_SIGN).outcome == run.UNCLEAR


def test_tests_that_print_no_counts_have_not_run(workspace, trial):
    (workspace / "tools/run_tests.py").write_text("raise SystemExit('no such package')")
    result = trial.run(WRONG_SIGN)
    assert (result.outcome, result.failing_test) == (run.NOT_RUN, "no such package")


@pytest.mark.parametrize(("always", "outcome"), [(False, run.FOUND), (True, run.UNCLEAR)])
def test_a_fault_that_hangs_is_found_and_its_processes_end(workspace, trial, monkeypatch, always, outcome):
    (workspace / "tools/run_tests.py").write_text(
        "import subprocess, sys, time\n"
        f"if {always} or 'x - x' in open('src/alpha/code_of_alpha.py').read():\n"
        "    subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'], start_new_session=True)\n"
        "    time.sleep(600)\n"
        "print('1 passed, 0 failed, 0 skipped, 0 long not run')\n")
    monkeypatch.setenv("PROBE_OF_THIS_TEST", str(workspace))
    assert run.Trial(workspace, limit_s=4.0).run(WRONG_SIGN).outcome == outcome
    assert run.processes.marked(str(workspace), "PROBE_OF_THIS_TEST") == {}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_its_tests_end_with_it(workspace, trial, monkeypatch, tmp_path, tmp_path_factory, number):
    """Also in a script's background job, where Ctrl-C is ignored."""
    began = tmp_path_factory.mktemp("beside") / "began"  # not in the workspace, over which the overlay is
    (workspace / "tools/run_tests.py").write_text(
        f"import pathlib, time\npathlib.Path({str(began)!r}).touch()\ntime.sleep(600)\n")
    (tmp_path / "list.yaml").write_text(
        "- {id: sign, file: src/alpha/code_of_alpha.py, kind: sign, seen: zeros, by: unit, tests: [alpha], old: x + x,"
        " new: x - x}\n")
    monkeypatch.setenv("PROBE_OF_THIS_TEST", str(workspace))
    command = [sys.executable, str(MUTATIONS / "run.py"), "--root", str(workspace), "--faults",
               str(tmp_path / "list.yaml")]
    with subprocess.Popen(command, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) as running:
        try:
            wait_until(began.exists, "the fault's tests to begin", stretched(30.0))
            running.send_signal(number)
            assert running.wait(stretched(30.0)) == 130
        finally:
            running.kill()
    assert run.processes.marked(str(workspace), "PROBE_OF_THIS_TEST") == {}


def test_results_are_kept_and_faults_with_a_row_are_not_run_again(workspace, trial, tmp_path, capsys):
    out = tmp_path / "out.csv"
    (tmp_path / "list.yaml").write_text(
        "- {id: sign, file: src/alpha/code_of_alpha.py, kind: sign, seen: zeros, by: unit, tests: [alpha], old: x + x,"
        " new: x - x}\n"
        "- {id: third, file: src/alpha/code_of_alpha.py, kind: bound, seen: thirds, by: unit, tests: [alpha],"
        " old: x / 2, new: x / 3}\n")
    words = ["--root", str(workspace), "--faults", str(tmp_path / "list.yaml"), "--out", str(out)]
    assert run.main([*words, "--only", "sign"]) == 0
    assert run.main(words) == 1
    rows = run.results_in(out)
    assert [(row.id, row.outcome) for row in rows] == [("sign", run.FOUND), ("third", run.SURVIVED)]
    printed = capsys.readouterr().out
    assert "1 found, 1 survived" in printed and printed.count("\nfound sign") + printed.startswith("found sign") == 1
