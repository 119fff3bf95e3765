# SPDX-License-Identifier: BSD-3-Clause
"""The command ends with one line where it cannot fit, refuses what cannot be written, and keeps what was there."""
import importlib.util
import os
import signal
import subprocess
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path

import numpy as np
import pytest

from baxter_model import poses
from baxter_sysid import results
from baxter_sysid.recording import ArmRecording
from lab_testing.waiting import stretched, wait_until

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "sysid"
NEUTRAL = np.array(list(poses().angles("neutral", "left").values()))


@pytest.fixture(scope="module")
def command():
    loader = SourceFileLoader("sysid", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("sysid", loader))
    loader.exec_module(module)
    return module


def test_a_recording_that_is_missing_or_is_none(command, tmp_path, capsys):
    assert "none.csv cannot be read" in refused(command, capsys, str(tmp_path / "none.csv"))
    empty = tmp_path / "empty.csv"
    empty.write_text("time_s,what\n0,1\n1,2\n")
    assert command.main([str(empty)]) == 2
    assert "seven joints" in capsys.readouterr().err


def test_the_output_s_name_must_be_one_that_a_serial_can_be(command, capsys):
    with pytest.raises(SystemExit) as caught:
        command.main(["x.csv", "--out", "own.txt"])
    assert caught.value.code == 2 and "own.txt" in capsys.readouterr().err


def refused(command, capsys, *argv):
    """The parser's text about arguments that it refuses, before anything moves or is fitted."""
    with pytest.raises(SystemExit) as caught:
        command.main(list(argv))
    assert caught.value.code == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("option", ["--out", "--keep"])
def test_files_that_cannot_be_written_are_refused_before_a_robot_moves(command, capsys, tmp_path, option):
    folder = tmp_path / "own.yaml"
    folder.mkdir()
    assert "it is a folder" in refused(command, capsys, "--arm", "left", option, str(folder))
    assert "there is no folder" in refused(command, capsys, "--arm", "left", option, str(tmp_path / "no" / "own.yaml"))
    assert "no file can be made in /proc" in refused(command, capsys, "--arm", "left", option, "/proc/own.yaml")
    assert "the same file" in refused(command, capsys, "--arm", "left", "--out", "a.yaml", "--keep", "a.yaml")


@pytest.mark.parametrize("argv, said", [
    (("--arm", "both"), "one arm at a time"), ((), "--arm left or --arm right"), (("x.csv", "--told"), "--load"),
    (("x.csv", "--keep", "y.csv"), "x.csv is a recording"), (("--arm", "left", "--seconds", "1"), "from 10")])
def test_options_that_do_not_belong_together_are_refused(command, capsys, argv, said):
    assert said in refused(command, capsys, *argv)


def written(path, rows=100, still=False):
    """A CSV file of a left arm that swings."""
    time_s = 0.01 * np.arange(rows)
    positions = NEUTRAL + 0.2 * np.sin(time_s)[:, None] * (not still)
    ArmRecording(time_s, {"left": positions}, {"left": positions}).write(path)
    return str(path)


@pytest.mark.parametrize("arm, said", [("right", "it has the left arm"), ("both", "needs both")])
def test_an_arm_that_the_recording_has_not(command, capsys, tmp_path, arm, said):
    assert command.main([written(tmp_path / "arm.csv"), "--arm", arm]) == 2
    assert said in capsys.readouterr().err


def test_a_recording_of_a_still_arm_and_numbers_to_start_from_that_are_none(command, capsys, tmp_path):
    assert command.main([written(tmp_path / "arm.csv", still=True)]) == 2
    assert "no joint of the left arm" in capsys.readouterr().err
    start = tmp_path / "start.yaml"
    for text, said in (("lag: [", "cannot be read"), ("a: 1", "no section 'lag'"), ("", "empty")):
        start.write_text(text)
        assert command.main([written(tmp_path / "arm.csv"), "--start", str(start)]) == 2
        err = capsys.readouterr().err
        assert "start.yaml" in err and said in err


def test_what_was_there_is_kept_beside_what_is_written(tmp_path):
    path = tmp_path / "own.yaml"
    assert results.put(path, lambda draft: draft.write_text("first")) is None
    former = results.put(path, lambda draft: draft.write_text("second"))
    assert path.read_text() == "second" and former.name == "own.yaml~" and former.read_text() == "first"

    def interrupted(draft):
        draft.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        results.put(path, interrupted)
    assert path.read_text() == "second" and sorted(one.name for one in tmp_path.iterdir()) == ["own.yaml", "own.yaml~"]


def processor_s(pid):
    """The processor time that a process has had [s]."""
    fields = Path("/proc/%d/stat" % pid).read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_ctrl_c_ends_it_with_a_line_and_no_file(tmp_path):
    program = subprocess.Popen([sys.executable, str(SCRIPT), written(tmp_path / "arm.csv", 3000), "--out",
                                str(tmp_path / "own.yaml")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        # Its first line is that of the fit that begins; a second of it is spent in compiled functions, mostly.
        assert "a fit takes" in program.stdout.readline()
        at_first = processor_s(program.pid)
        wait_until(lambda: processor_s(program.pid) > at_first + 0.5 or program.poll() is not None, "a fit", 60.0)
        program.send_signal(signal.SIGINT)
        _, err = program.communicate(timeout=stretched(60.0))
    finally:
        program.kill()
    assert program.returncode == 130 and "interrupted" in err and "Traceback" not in err
    assert not (tmp_path / "own.yaml").exists()
