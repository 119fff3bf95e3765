# SPDX-License-Identifier: BSD-3-Clause
"""A program in a pseudo-terminal: keys are typed, its output is read."""
import contextlib
import os
import pty
import signal
import subprocess
import termios
import threading
import time

from lab_testing.processes import living
from lab_testing.waiting import wait_until

# [s] of wall time. Programs take up to 20 s of simulated time, of which a busy machine gives 0.1 s a second.
PATIENCE_S = 300.0
KILLED_LIMIT_S = 40.0
READING_POLL_S = 0.0005  # a program may read keys for 10 ms only


class Program:
    """A command in a pseudo-terminal, as a context manager; at the end, all its processes are ended."""

    def __init__(self, words, environment, folder, patience_s=10.0):
        """words: of the command; environment: {variable: value}; folder: where it runs; patience_s: before a kill."""
        self._words, self._environment, self._folder = words, environment, folder
        self._output, self._patience_s = "", patience_s

    def __enter__(self):
        self._terminal, theirs = pty.openpty()
        self._process = subprocess.Popen(self._words, stdin=theirs, stdout=theirs, stderr=theirs, cwd=self._folder,
                                         env=self._environment, start_new_session=True)
        os.close(theirs)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_):
        for number, patience_s in ((signal.SIGINT, self._patience_s), (signal.SIGKILL, KILLED_LIMIT_S)):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)
            with contextlib.suppress(AssertionError):
                wait_until(self._is_over, "the end of the program", patience_s)
                break
        self._reader.join(5.0)
        os.close(self._terminal)

    @property
    def output(self):
        """Everything printed so far."""
        return self._output

    def expect(self, text, timeout_s=PATIENCE_S, beyond=0):
        """Wait for ``text`` in the output behind its first ``beyond`` characters, and return the place behind it.

        Raises AssertionError if it does not come within ``timeout_s`` [s] of wall time, or the program ends without it.
        """
        def found():
            ended = self._process.poll() is not None and not self._reader.is_alive()
            place = self._output.find(text, beyond)
            assert place >= 0 or not ended, "ended without %r; its last output: %r" % (text, self._output[-300:])
            return place >= 0
        wait_until(found, lambda: "%r; the last output: %r" % (text, self._output[-300:]), timeout_s)
        return self._output.find(text, beyond) + len(text)

    def type(self, keys):
        os.write(self._terminal, keys.encode())

    def press(self, key, timeout_s=PATIENCE_S):
        """Type ``key`` while the program reads single keys: setting the terminal to that discards earlier ones.

        Returns the length of the output before. Raises AssertionError if the program reads no single keys within
        ``timeout_s`` [s] of wall time.
        """
        # This side of a pseudo-terminal shows the settings of the other one.
        wait_until(lambda: not termios.tcgetattr(self._terminal)[3] & termios.ICANON, "a program that reads keys",
                   timeout_s, READING_POLL_S)
        seen = len(self._output)
        self.type(key)
        return seen

    def interrupt(self):
        """Press Ctrl-C: every process of the terminal gets SIGINT."""
        os.killpg(self._process.pid, signal.SIGINT)

    def end(self, timeout_s=PATIENCE_S):
        """Wait for the program's end and return its exit code. Raises AssertionError after ``timeout_s`` [s]."""
        wait_until(self._is_over, lambda: "the program's end; the last output: %r" % self._output[-300:], timeout_s)
        return self._process.returncode

    def finish(self, timeout_s=PATIENCE_S):
        """Wait for the program's end. Raises AssertionError unless its exit code is 0."""
        code = self.end(timeout_s)
        assert code == 0, "exit code %d; its last output: %r" % (code, self._output[-300:])

    def stop(self, timeout_s=PATIENCE_S):
        """Press Ctrl-C, wait for the end and return the time that it took [s]."""
        begin = time.monotonic()
        self.interrupt()
        self.end(timeout_s)
        return time.monotonic() - begin

    def _is_over(self):
        return self._process.poll() is not None and not living(self._process.pid)

    def _read(self):
        with contextlib.suppress(OSError):  # how Linux reports that the other side is closed
            while data := os.read(self._terminal, 4096):
                self._output += data.decode(errors="replace")
