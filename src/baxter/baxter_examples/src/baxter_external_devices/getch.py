# SPDX-License-Identifier: BSD-3-Clause
"""Single keys from the terminal, without Enter. Free of ROS."""
from __future__ import annotations

import os
import select
import sys
import termios
from typing import BinaryIO

ESCAPE, CTRL_C = "\x1b", "\x03"


class Keyboard:
    """Keys of the terminal (or of a pipe) for the length of a `with`.

    Keys are not shown meanwhile, and Ctrl-C is a key like others; at the end the terminal is as it was before.
    """

    def __init__(self, stream: BinaryIO | None = None) -> None:
        self._file = (stream or sys.stdin).fileno()
        self._before = None

    def __enter__(self) -> Keyboard:
        if os.isatty(self._file):
            self._before = termios.tcgetattr(self._file)
            ours = termios.tcgetattr(self._file)
            ours[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG)
            termios.tcsetattr(self._file, termios.TCSANOW, ours)
        return self

    def __exit__(self, *_error: object) -> None:
        if self._before is not None:
            termios.tcsetattr(self._file, termios.TCSANOW, self._before)
            self._before = None

    def read(self, timeout_s: float = 0.01) -> str | None:
        """Return the next key (str), or None if none was pressed within `timeout_s`. Raises EOFError at the end."""
        ready, _, _ = select.select([self._file], [], [], timeout_s)
        if not ready:
            return None
        key = os.read(self._file, 1)
        if not key:
            raise EOFError("the keyboard is gone: standard input is closed")
        return key.decode("latin-1")


def getch(timeout: float = 0.01) -> str | None:
    """Return the next key of the terminal, or None if none was pressed within `timeout` [s]."""
    with Keyboard() as keyboard:
        return keyboard.read(timeout)
