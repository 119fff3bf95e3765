# SPDX-License-Identifier: BSD-3-Clause
"""tests/sdk: a program in a pseudo-terminal gets its keys and Ctrl-C, and a missing output is an error."""

import os
import sys
import termios
from pathlib import Path

import pytest

from lab_testing.processes import is_alive

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "sdk"))
from program import Program  # noqa: E402

ECHO = """
import sys, termios, tty
tty.setraw(0)
print("terminal", sys.stdin.isatty(), flush=True)
while (key := sys.stdin.read(1)) != "q":
    print("key", key, flush=True)
"""
DISCARDS_KEYS = """
import sys, tty
print("up", flush=True)
open("go").read()
tty.setraw(0)
print("key", sys.stdin.read(1), flush=True)
"""
CHILD = """
import signal, subprocess, sys
child = subprocess.Popen([sys.executable, "-c", "import signal; signal.signal(2, signal.SIG_IGN); signal.pause()"])
print("child", child.pid, flush=True)
signal.pause()
"""


def start(text, folder):
    return Program([sys.executable, "-c", text], dict(os.environ), folder)


def test_keys_arrive_in_a_terminal_and_the_program_ends(tmp_path):
    with start(ECHO, tmp_path) as program:
        place = program.expect("terminal True")
        program.type("x")
        program.expect("key x", beyond=place)
        program.type("q")
        program.finish()


def test_a_pressed_key_waits_for_a_program_that_discards_earlier_ones(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "go")
    looks, settings = [], termios.tcgetattr

    def look(terminal):
        looks.append(terminal)
        if len(looks) == 3:  # the program goes on while the key waits
            (tmp_path / "go").write_text("")
        return settings(terminal)

    monkeypatch.setattr(termios, "tcgetattr", look)
    with start(DISCARDS_KEYS, tmp_path) as program:
        program.expect("up")
        program.expect("key x", timeout_s=20.0, beyond=program.press("x"))
        program.finish()


def test_an_output_that_does_not_come_is_an_error(tmp_path):
    with start("print('other')", tmp_path) as program:
        with pytest.raises(AssertionError, match="ended without 'wanted'.*other"):
            program.expect("wanted")


def test_another_exit_code_is_an_error(tmp_path):
    with start("raise SystemExit(3)", tmp_path) as program, pytest.raises(AssertionError, match="exit code 3"):
        program.finish()


def test_ctrl_c_reaches_the_program(tmp_path):
    with start("import signal; print('up', flush=True); signal.pause()", tmp_path) as program:
        program.expect("up")
        assert program.stop() < 30.0
        assert "KeyboardInterrupt" in program.output


def test_no_child_is_left_even_if_it_ignores_ctrl_c(tmp_path):
    with start(CHILD, tmp_path) as program:
        place = program.expect("child ")
        program.expect("\n", beyond=place)
        child = int(program.output[place:].split()[0])
    assert not is_alive(child)
