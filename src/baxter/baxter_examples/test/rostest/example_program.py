# SPDX-License-Identifier: BSD-3-Clause
"""Run an example as users do, in a separate terminal: type keys, read its output, end it with Ctrl-C."""
import contextlib
import functools
import os
import pty
import signal
import subprocess
import threading

from lab_testing import waiting

# Longest wait for anything [s, wall]: the machine may be busy.
DEADLINE_S = 90.0


wait_until = functools.partial(waiting.wait_until, timeout_s=DEADLINE_S)


class Program:
    """An example, a launch file of the package, or a program of another `package`, started with `options`."""

    def __init__(self, name, *options, package="baxter_examples"):
        tool = "roslaunch" if name.endswith(".launch") else "rosrun"
        self._name = name
        self._keys, terminal = pty.openpty()
        self._process = subprocess.Popen(
            [tool, package, name, *options], stdin=terminal, stdout=terminal, stderr=terminal,
            env=dict(os.environ, PYTHONUNBUFFERED="1"), start_new_session=True)
        os.close(terminal)
        self._text = ""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def output(self):
        return self._text

    def wait_for(self, text):
        """Wait until it has printed `text`."""
        wait_until(lambda: text in self._text or self._process.poll() is not None, "%s to say %r" % (self._name, text))
        self._reader.join(0.0 if self._process.poll() is None else DEADLINE_S)
        assert text in self._text, "%s ended without saying %r:\n%s" % (self._name, text, self._text)

    def type(self, keys):
        os.write(self._keys, keys.encode())

    def interrupt(self):
        """Press Ctrl-C and return the exit status."""
        os.killpg(self._process.pid, signal.SIGINT)
        return self.wait()

    def wait(self):
        """Wait for its end and return the exit status."""
        wait_until(lambda: self._process.poll() is not None, "the end of %s; it said:\n%s" % (self._name, self._text))
        self._reader.join(DEADLINE_S)
        assert "Traceback" not in self._text, self._text
        return self._process.returncode

    def end(self):
        """End it by force if it still runs."""
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def _read(self):
        # The terminal of an ended process reads as an error.
        with contextlib.suppress(OSError):
            while chunk := os.read(self._keys, 4096):
                self._text += chunk.decode(errors="replace")
