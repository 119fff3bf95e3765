# SPDX-License-Identifier: BSD-3-Clause
"""Batches: every seed has one outcome, whatever a job does; results do not depend on the workers; a batch continues."""
import argparse
import json
import os
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from lab_batch import JobError, Outcome, Spec, command, load, on_first_use, parquet, ray_engine, ray_node
from lab_batch.job import ResultError, plain
from lab_batch.processes import BatchLimits, map_seeds
from lab_batch.records import Records, RecordsError, summary
from lab_testing.waiting import wait_until

HERE = Path(__file__).parent
SQUARE, TROUBLE = "small_jobs:Square", "small_jobs:Trouble"
# A worker starts in a new Python, which reads the jobs from this folder.


@pytest.fixture(autouse=True)
def jobs_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")]))


def outcomes(name, seeds, limits=None, **parameters):
    found = list(map_seeds(Spec(name, parameters), seeds, limits or BatchLimits(2)))
    assert sorted(one.seed for one in found) == sorted(seeds)
    return {one.seed: one for one in found}


def test_results_are_the_same_with_one_worker_and_with_three():
    alone, together = outcomes(SQUARE, range(9), BatchLimits(1)), outcomes(SQUARE, range(9), BatchLimits(3))
    assert [alone[seed].result for seed in range(9)] == [together[seed].result for seed in range(9)]
    assert alone[4].result["square"] == 16.0
    assert alone[4].result["threads"] == "1"


def test_workers_end_the_job_and_are_replaced(tmp_path):
    outcomes(SQUARE, range(7), BatchLimits(1, episodes=3), folder=str(tmp_path))
    started, ended = ({path.name.split("-")[1] for path in tmp_path.glob(kind + "-*")} for kind in ("started", "ended"))
    assert len(started) == 3
    assert ended == started


def test_an_exception_fails_its_episode_alone():
    found = outcomes(TROUBLE, range(4), raises=(1,), nonsense=(2,))
    assert "ValueError: seed 1 is bad (" in found[1].error
    assert "small_jobs.py, line" in found[1].error
    assert "run() returned int" in found[2].error
    assert sorted(seed for seed, one in found.items() if one.is_done) == [0, 3]


ARRAY = np.array([1.5, 2.5])


@pytest.mark.parametrize("value, expected", [
    ((1, 2), [1, 2]), ({3: "a"}, {"3": "a"}), (np.float32(0.5), 0.5), (np.int64(3), 3), (np.bool_(True), True),
    (ARRAY, [1.5, 2.5]), ([{"deep": ARRAY}], [{"deep": [1.5, 2.5]}])])
def test_results_are_what_their_file_gives_back(value, expected):
    found = plain({"value": value})["value"]
    assert found == expected and type(found) is type(expected)


ITSELF = []
ITSELF.append(ITSELF)


@pytest.mark.parametrize("result, text", [
    ({"share": float("nan")}, "'share' cannot .* None can stand for a number that is NaN"),
    ({"share": np.array([np.inf])}, "'share' cannot .* None can stand"), ({"pose": object()}, "'pose' .* type object;"),
    ({"f": lambda: 1}, "type function;"), ({"x": ITSELF}, "'x' .*Circular"), ({("a",): 1}, r"named a result \('a',\)"),
    ({"grid": np.zeros(1_000_001)}, "array of 1000001 numbers.* write it to a file"),
    (None, "run.. returned NoneType; a dictionary")])
def test_results_that_no_file_can_hold_are_named(result, text):
    with pytest.raises(ResultError, match=text):
        plain(result)


def test_a_result_that_is_no_json_fails_its_episode():
    found = outcomes(TROUBLE, range(2), unwritable=(1,))
    assert found[0].is_done and "result 'value' cannot be written as JSON" in found[1].error


def test_whatever_a_job_raises_is_told(tmp_path, capsys):
    assert run("small_jobs:OddErrors", "--seeds", "0:4", "--out", tmp_path / "results.jsonl", "--workers", 1) == 1
    said = capsys.readouterr().out
    for text in ("seed 0 failed: SystemExit: 3 (", "seed 1 failed: SystemExit: 0 (", "seed 2 failed: Mute (",
                 "seed 3 failed: ValueError: half a character: \\ud800 (", "0 ended well, 4 failed"):
        assert text in said


def test_a_worker_that_dies_costs_nothing_but_time(tmp_path):
    found = outcomes(TROUBLE, range(6), dies_once=(1, 4), folder=str(tmp_path))
    assert all(one.is_done for one in found.values())


def test_an_episode_that_kills_every_worker_fails(tmp_path):
    found = outcomes(TROUBLE, range(4), dies=(2,), folder=str(tmp_path))
    assert "died twice: signal SIGKILL" in found[2].error
    assert all(found[seed].is_done for seed in (0, 1, 3))


def is_alive(pid):
    try:
        return Path("/proc/%d/stat" % pid).read_text().split(")")[-1].split()[0] != "Z"
    except OSError:
        return False


def test_an_episode_over_its_time_is_stopped_with_its_children(tmp_path):
    found = outcomes(TROUBLE, range(3), BatchLimits(1, episode_s=8.0), hangs=(1,), folder=str(tmp_path))
    assert found[1].error == "took more than the limit of 8 s"
    assert found[0].is_done and found[2].is_done
    child = int((tmp_path / "child").read_text())
    wait_until(lambda: not is_alive(child), "the episode's own process has ended")


def test_processes_in_sessions_of_their_own_end_with_their_worker(tmp_path):
    """One worker ends by itself, one is stopped; a child of each has left its group, and its parent."""
    found = outcomes("small_jobs:Leaves", range(2), BatchLimits(2, episode_s=4.0), hangs=(1,), folder=str(tmp_path))
    assert found[0].is_done and "limit of 4 s" in found[1].error
    children = [int((tmp_path / ("left-%d" % seed)).read_text()) for seed in range(2)]
    wait_until(lambda: not any(map(is_alive, children)), "the processes that episodes left have ended")


def test_closing_the_iterator_stops_the_workers(tmp_path):
    iterator = map_seeds(Spec(TROUBLE, {"hangs": (1,), "folder": str(tmp_path)}), range(2), BatchLimits(1))
    assert next(iterator).seed == 0
    wait_until((tmp_path / "child").exists, "the second episode runs")
    wait_until((tmp_path / "child").read_text, "its process has a number")
    iterator.close()
    wait_until(lambda: not is_alive(int((tmp_path / "child").read_text())), "the episode's own process has ended")


@pytest.mark.parametrize("name, parameters, text", [
    ("no_colon", {}, "package.module:Class"), ("no_such_module:Job", {}, "cannot import no_such_module"),
    ("./jobs.py:Job", {}, "cannot import ./jobs.py"),
    ("small_jobs:Missing", {}, "has no Missing"), ("small_jobs:NoJob", {}, "derives from lab_batch.Job"),
    (SQUARE, {"facto": 1}, "no parameter facto; it has factor, folder"),
    ("small_jobs:CannotStart", {}, "OSError: no such robot"),
])
def test_wrong_jobs_are_refused(name, parameters, text):
    with pytest.raises(JobError, match="job|--list") as caught:
        load(Spec(name, parameters))
    assert text in str(caught.value)


@pytest.mark.parametrize("name, text", [("small_jobs:CannotStart", "no such robot"),
                                        ("small_jobs:ExitsAtStart", "cannot start: SystemExit: wrong option"),
                                        ("small_jobs:DiesAtStart", "2 workers in a row died at the start: signal SIG")])
def test_a_job_that_cannot_start_ends_the_batch(name, text):
    with pytest.raises(JobError, match=text):
        list(map_seeds(Spec(name), range(100), BatchLimits(2)))


# -- records

SPEC = Spec(SQUARE, {"factor": 2.0})


def test_records_are_continued(tmp_path):
    path = tmp_path / "some" / "results.jsonl"
    records = Records(path, SPEC, {"python": "3"})
    records.add(Outcome(3, {"square": 9.0}, "", 0.25))
    records.add(Outcome(4, {}, "bad", 0.5))
    records.close()
    with path.open("a") as stream:
        stream.write('{"seed": 5, "resu')  # a crash
    again = Records(path, SPEC, {"python": "3"})
    assert again.outcomes == {3: Outcome(3, {"square": 9.0}, "", 0.25), 4: Outcome(4, {}, "bad", 0.5)}
    again.add(Outcome(5, {"square": 25.0}))
    again.close()
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    assert rows[0]["batch"] == {"job": SQUARE, "parameters": {"factor": 2.0}, "versions": {"python": "3"}}
    assert [row["seed"] for row in rows[1:]] == [3, 4, 5]


@pytest.mark.parametrize("text, message", [
    ("hello\n", "no file of results"), ('{"batch": {"job": "a:B", "parameters": {}}}\n', "has results of job a:B"),
    (json.dumps({"batch": {"job": SQUARE, "parameters": {"factor": 1.0}}}) + "\n", "parameters"),
])
def test_other_files_are_not_touched(tmp_path, text, message):
    path = tmp_path / "results.jsonl"
    path.write_text(text)
    with pytest.raises(RecordsError, match=message):
        Records(path, SPEC, {})
    assert path.read_text() == text


@pytest.mark.parametrize("line", [
    '{"seed": [1], "seconds": 1, "result": {}}', '{"seed": "1", "seconds": 1, "result": {}}',
    '{"seed": 1, "seconds": 1, "result": [1]}', '{"seed": 1, "seconds": null, "result": {}}',
    '{"seed": 1, "seconds": 1, "error": 5}', "[" * 100_000])
def test_a_line_that_no_batch_wrote_is_named(tmp_path, line):
    path, spec = tmp_path / "results.jsonl", Spec("a:B", {})
    Records(path, spec, {}).close()
    text = path.read_text() + line + "\n"
    path.write_text(text)
    with pytest.raises(RecordsError, match="results.jsonl is no file of results"):
        Records(path, spec, {})
    assert path.read_text() == text


def test_a_file_that_another_batch_writes_is_refused(tmp_path):
    records = Records(tmp_path / "results.jsonl", SPEC, {})
    with pytest.raises(RecordsError, match="another batch is writing to .*results.jsonl"):
        Records(tmp_path / "results.jsonl", SPEC, {})
    records.close()
    Records(tmp_path / "results.jsonl", SPEC, {}).close()


def test_results_of_earlier_versions_are_told_apart(tmp_path, capsys):
    out = tmp_path / "results.jsonl"
    records = Records(out, SPEC, {"python": "2.7", "numpy": "1"})
    records.add(Outcome(0, {"square": 0.0}))
    records.close()
    assert run(SQUARE, "--set", "factor=2.0", "--seeds", "0:1", "--out", out) == 0
    said = capsys.readouterr().err
    assert "of other versions: " in said and "python 2.7 (now 3." in said
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert [row["batch"]["versions"]["numpy"] for row in rows if "batch" in row] == ["1", np.__version__]
    again = Records(out, SPEC, {"python": "4"})
    again.close()
    assert again.header["versions"] == {"python": "4"} and len(again.header["earlier versions"]) == 2
    assert list(again.outcomes) == [0]


def test_summary():
    found = summary([Outcome(0, {"good": True, "size": 1.0, "name": "a"}), Outcome(1, {"good": False, "size": 3}),
                     Outcome(2, {}, "failed")])
    assert found == ["good: 1 of 2", "size: mean 2, from 1 to 3 (2)"]
    assert summary([Outcome(0, {"huge": 10**400}), Outcome(1, {"huge": 2})]) == []  # no float holds it


# -- the command

@pytest.mark.parametrize("text, seeds", [("0:3", [0, 1, 2]), (":2", [0, 1]), ("7", [7]), ("1:3,7,2", [1, 2, 7])])
def test_seeds(text, seeds):
    assert command.seeds_of(text) == seeds


@pytest.mark.parametrize("text", [
    "", "3:3", "5:2", "a", "-1", "1:", "1.5", "1e3", "0:%d" % 10**20, "0:%d" % (10**7 + 1), str(2**63)])
def test_wrong_seeds(text):
    with pytest.raises(argparse.ArgumentTypeError):
        command.seeds_of(text)


def test_settings_are_literals_or_texts():
    assert command.setting_of("factor=2.5") == ("factor", 2.5)
    assert command.setting_of("side=left") == ("side", "left")
    assert command.setting_of("dies=(1, 2)") == ("dies", (1, 2))
    with pytest.raises(argparse.ArgumentTypeError):
        command.setting_of("factor")


def run(*words):
    return command.main([str(word) for word in words])


def test_a_batch_says_what_failed_and_how_to_repeat_it_and_continues(tmp_path, capsys):
    out = tmp_path / "results.jsonl"
    words = (TROUBLE, "--workers", 2, "--out", out, "--set", "raises=[2]", "--set", "folder=%s" % tmp_path)
    assert run(*words, "--seeds", "0:4") == 1
    said = capsys.readouterr().out
    assert "seed 2 failed: ValueError: seed 2 is bad" in said
    assert ("baxter.sh batch small_jobs:Trouble --seeds 2 --set 'raises=[2]' --set folder=%s --out /dev/null"
            % tmp_path in said)
    assert "good: 3 of 3" in said
    assert "3 ended well, 1 failed; 4 run now" in said
    assert run(*words, "--seeds", "0:5") == 1
    said = capsys.readouterr().out
    assert "4 of 5 seeds" in said
    assert "1 run now" in said
    assert len(out.read_text().splitlines()) == 6
    assert run(*words, "--seeds", "0:2") == 0
    assert run(*words, "--seeds", "2", "--retry-failed") == 1
    assert "1 run now" in capsys.readouterr().out


@pytest.mark.parametrize("words, text", [
    (("--workers", "two"), "not two"), (("--workers", "0"), "from 1, at most"),
    (("--time-limit", "inf"), "not inf"), (("--recycle", ""), "not nothing")])
def test_wrong_options_say_what_is_expected(capsys, words, text):
    with pytest.raises(SystemExit) as caught:
        run(SQUARE, "--seeds", "0:2", *words)
    assert caught.value.code == 2 and text in capsys.readouterr().err


def test_a_named_pipe_is_not_waited_for(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe")
    assert run(SQUARE, "--seeds", "0:2", "--out", tmp_path / "pipe") == 1
    assert "named pipe" in capsys.readouterr().err


def test_a_disk_without_space_ends_the_batch_with_one_line(capsys):
    assert run(SQUARE, "--seeds", "0:2", "--out", "/dev/full") == 1
    assert capsys.readouterr().err.startswith("batch: [Errno 28]")


@pytest.mark.parametrize("words, text", [
    (["nothing", "--seeds", "1"], "no job 'nothing'"), (["reech"], "did you mean reach"),
    (["ik"], "--seeds is needed")])
def test_a_wrong_job_is_told_before_anything_else(capsys, words, text):
    with pytest.raises(SystemExit) as caught:
        run(*words)
    assert caught.value.code == 2 and text in capsys.readouterr().err


def test_a_wrong_parameter_names_the_jobs_own_before_a_file_is_made(tmp_path, capsys):
    assert run("ik", "--seeds", "1", "--set", "sid=right", "--out", tmp_path / "r") == 1
    said = capsys.readouterr().err
    assert "sid" in said and "side" in said and said.count("\n") == 1 and not (tmp_path / "r").exists()


def test_list_names_every_job_with_its_parameters(capsys):
    assert run("--list") == 0
    said = capsys.readouterr().out
    assert "--set side=left" in said
    assert "{seed}" in said


def test_a_batch_tells_a_silence_unless_it_has_a_time_limit(tmp_path, monkeypatch, capsys):
    def slow(spec, seeds, limits):
        if limits.episode_s is None:
            wait_until(lambda: "--time-limit" in capsys.readouterr().err, "the line", 30.0)
        for seed in seeds:
            yield Outcome(seed, {"drawn": 1.0}, "")

    monkeypatch.setattr(command, "SILENT_S", 0.1)
    monkeypatch.setitem(command.ENGINES, "processes", slow)
    out = ["--out", str(tmp_path / "results.jsonl")]
    before = threading.active_count()
    assert command.main([TROUBLE, "--seeds", "0:2", *out]) == 0
    assert command.main([TROUBLE, "--seeds", "2:4", "--time-limit", "5", *out]) == 0
    wait_until(lambda: threading.active_count() == before, "the end of the thread")


def test_ctrl_c_ends_everything_and_the_batch_continues(tmp_path):
    out = tmp_path / "results.jsonl"
    words = [sys.executable, "-m", "lab_batch", TROUBLE, "--seeds", "0:3", "--workers", "1", "--out", str(out),
             "--set", "hangs=[1]", "--set", "folder=%s" % tmp_path]
    child = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        wait_until((tmp_path / "child").exists, "the second episode runs")
        wait_until((tmp_path / "child").read_text, "its process has a number")
        os.killpg(child.pid, signal.SIGINT)
        said = child.communicate(timeout=60)[1]
    finally:
        child.kill()
    assert child.returncode == 130
    assert said.strip().endswith("batch: stopped; the same command continues")
    assert "Traceback" not in said
    wait_until(lambda: not is_alive(int((tmp_path / "child").read_text())), "the episode's own process has ended")
    assert [json.loads(line)["seed"] for line in out.read_text().splitlines()[1:]] == [0]


def test_a_batch_that_is_killed_leaves_no_worker(tmp_path):
    words = [sys.executable, "-m", "lab_batch", TROUBLE, "--seeds", "1", "--workers", "1", "--out", str(tmp_path / "r"),
             "--set", "hangs=[1]", "--set", "folder=%s" % tmp_path]
    child = subprocess.Popen(words, start_new_session=True)
    wait_until((tmp_path / "child").exists, "the episode runs")
    wait_until((tmp_path / "child").read_text, "its process has a number")
    episode = int((tmp_path / "child").read_text())
    worker = int(Path("/proc/%d/stat" % episode).read_text().split(")")[-1].split()[1])
    child.kill()
    child.wait()
    wait_until(lambda: not is_alive(worker), "the worker has ended")
    wait_until(lambda: not is_alive(episode), "the episode's own process has ended")


# -- Ray's installation

def test_ray_is_installed_whole_or_not_at_all(tmp_path, monkeypatch):
    """pip is a program that writes a part and fails, then one that writes all; then the requirements change."""
    calls = []
    monkeypatch.setattr(on_first_use.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(ray_engine, "REQUIREMENTS", tmp_path / "requirements-ray.txt")
    monkeypatch.setattr(sys, "path", list(sys.path))
    ray_engine.REQUIREMENTS.write_text("ray==1\n")

    def run_pip(words, code):
        target = Path(words[words.index("--target") + 1])
        (target / "ray").mkdir(parents=True)
        calls.append(target)
        return subprocess.CompletedProcess(words, code)

    monkeypatch.setattr(on_first_use.subprocess, "run", lambda words: run_pip(words, 1))
    with pytest.raises(JobError, match="pip could not install ray .*--engine processes"):
        ray_engine.ensure_installed(tmp_path)
    assert list((tmp_path / ".baxter").iterdir()) == []
    monkeypatch.setattr(on_first_use.subprocess, "run", lambda words: run_pip(words, 0))
    for _ in range(2):
        ray_engine.ensure_installed(tmp_path)
    assert len(calls) == 2 and (tmp_path / ".baxter" / "ray" / "ray").is_dir()
    ray_engine.REQUIREMENTS.write_text("ray==2\n")
    ray_engine.ensure_installed(tmp_path)
    assert len(calls) == 3


# -- Parquet

OUTCOMES = [Outcome(3, {"good": True, "error_m": 0.5, "seed": 7, "mixed": 1}, "", 0.25),
            Outcome(4, {}, "ValueError: seed 4 is bad", 0.5),
            Outcome(5, {"good": False, "error_m": 2, "mixed": "two", "joints": [1.0, 2.0]}, "", 0.75)]
# What a job may return as well.
STRANGE = {"none": None, "empty": {}, "nothing": [], "deep": [{"a": []}], "huge": 2**70, "": "", "seconds": "late",
           "ragged": [1, "a"], "\u00e9": "\U0001f916"}


def test_results_become_columns_without_losing_those_of_the_same_name():
    assert parquet.columns_of(OUTCOMES) == {
        "seed": [3, 4, 5], "seconds": [0.25, 0.5, 0.75], "error": [None, "ValueError: seed 4 is bad", None],
        "good": [True, None, False], "error_m": [0.5, None, 2], "result.seed": [7, None, None],
        "mixed": [1, None, "two"], "joints": [None, None, [1.0, 2.0]]}


@pytest.mark.long
def test_parquet_has_all_results_with_seeds_and_versions(tmp_path):
    """pyarrow is installed for it."""
    words = [TROUBLE, "--seeds", "0:4", "--set", "folder=%s" % tmp_path, "--set", "raises=[2]",
             "--out", tmp_path / "out.jsonl", "--parquet", tmp_path / "new" / "out.parquet"]
    assert run(*words) == 1
    from pyarrow import parquet as arrow

    table = arrow.read_table(tmp_path / "new" / "out.parquet")
    rows = table.to_pylist()
    assert [row["seed"] for row in rows] == [0, 1, 2, 3]
    assert "seed 2 is bad" in rows[2]["error"] and rows[2]["good"] is None and rows[1]["good"]
    header = json.loads(table.schema.metadata[b"batch"])
    assert header["job"] == TROUBLE and header["versions"]["numpy"] == np.__version__
    parquet.write(tmp_path / "mixed.parquet", {}, OUTCOMES)
    found = arrow.read_table(tmp_path / "mixed.parquet").to_pydict()
    assert found["mixed"] == ["1", None, '"two"'] and found["error_m"] == [0.5, None, 2.0]
    assert found["joints"] == [None, None, [1.0, 2.0]]
    parquet.write(tmp_path / "strange.parquet", {}, [Outcome(0, STRANGE, "", 1.0)])
    found = arrow.read_table(tmp_path / "strange.parquet").to_pylist()[0]
    assert found == {"seed": 0, "seconds": 1.0, "error": None, "none": None, "empty": "{}", "nothing": [],
                     "deep": '[{"a": []}]', "huge": str(2**70), "": "", "result.seconds": "late",
                     "ragged": '[1, "a"]', "\u00e9": "\U0001f916"}
    parquet.write(tmp_path / "none.parquet", {}, [])
    assert arrow.read_table(tmp_path / "none.parquet").num_rows == 0


# -- Ray's machines

def test_a_token_is_found_where_ray_looks_for_it(tmp_path, monkeypatch):
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert not ray_engine.has_token()
    (tmp_path / ".ray").mkdir()
    (tmp_path / ".ray" / "auth_token").write_text("x")
    assert ray_engine.has_token()
    monkeypatch.setenv("RAY_AUTH_TOKEN_PATH", str(tmp_path / "other"))
    assert not ray_engine.has_token()
    monkeypatch.setenv("RAY_AUTH_TOKEN", "y")
    assert ray_engine.has_token()


def test_machines_of_a_cluster_are_started_with_fixed_ports():
    head = ray_node.command_of(ray_node.parse(["--head", "--listen", "10.0.0.1", "--cpus", "0"]))
    other = ray_node.command_of(ray_node.parse(["--address", "10.0.0.1:6379", "--listen", "10.0.0.2", "--cpus", "3"]))
    assert " ".join(head).endswith(
        "start --block --disable-usage-stats --head --port 6379 --include-dashboard false --node-ip-address 10.0.0.1 "
        "--num-cpus 0 --node-manager-port 6380 --object-manager-port 6381 --runtime-env-agent-port 6382 "
        "--dashboard-agent-grpc-port 6383 --dashboard-agent-listen-port 6384 --metrics-export-port 6385 "
        "--min-worker-port 10002 --max-worker-port 10999")
    assert " --address 10.0.0.1:6379 --node-ip-address 10.0.0.2 --num-cpus 3 " in " ".join(other)


def test_a_failure_is_repeated_from_the_folder_of_its_job(tmp_path, monkeypatch):
    monkeypatch.setenv("LAB_ROOT", "/home/me/lab")
    monkeypatch.chdir(tmp_path)
    options = command.parse(["mine:Job", "--seeds", "0:3"])
    assert command.repeating_line(options, 2) == "/home/me/lab/baxter.sh batch mine:Job --seeds 2 --out /dev/null"
    (tmp_path / "baxter.sh").touch()
    assert command.repeating_line(options, 2).startswith("./baxter.sh batch")


def test_a_failure_is_repeated_with_the_same_parameters_and_limit():
    settings = ("--set", "a='5'", "--set", "b=it's 5", "--set", "c=(1,)")
    options = command.parse(["mine:Job", "--seeds", "0:3", "--time-limit", "2.5", *settings])
    line = shlex.split(command.repeating_line(options, 2))
    again = command.parse(line[line.index("batch") + 1:])
    assert again.set == options.set == [("a", "5"), ("b", "it's 5"), ("c", (1,))]
    assert again.time_limit == 2.5 and again.seeds == [2]
