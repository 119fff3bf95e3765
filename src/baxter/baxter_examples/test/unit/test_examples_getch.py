# SPDX-License-Identifier: BSD-3-Clause
"""Keys from a terminal and from a pipe; the terminal is left as it was."""
import os
import pty
import termios

import pytest

from baxter_external_devices.getch import CTRL_C, Keyboard


@pytest.fixture
def terminal():
    ours, theirs = pty.openpty()
    stream = os.fdopen(theirs, "rb", buffering=0)
    yield ours, stream
    stream.close()
    os.close(ours)


def test_keys_come_without_enter_and_ctrl_c_is_one(terminal):
    ours, stream = terminal
    before = termios.tcgetattr(stream)
    with Keyboard(stream) as keyboard:
        assert keyboard.read(0.0) is None
        os.write(ours, b"a\x03")
        assert [keyboard.read(5.0), keyboard.read(5.0)] == ["a", CTRL_C]
    assert termios.tcgetattr(stream) == before


def test_terminal_is_put_back_after_an_error(terminal):
    _, stream = terminal
    before = termios.tcgetattr(stream)
    with pytest.raises(RuntimeError), Keyboard(stream):
        raise RuntimeError
    assert termios.tcgetattr(stream) == before


def test_pipe_that_ends():
    read, write = os.pipe()
    os.write(write, b"x")
    os.close(write)
    with os.fdopen(read, "rb", buffering=0) as stream, Keyboard(stream) as keyboard:
        assert keyboard.read(5.0) == "x"
        with pytest.raises(EOFError, match="standard input is closed"):
            keyboard.read(5.0)
