# SPDX-License-Identifier: BSD-3-Clause
"""Run an example as people do, in a terminal of its own: type keys, read what it says, end it with Ctrl-C."""
import contextlib
import functools
import os
import pty
import signal
import struct
import subprocess
import tempfile
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


class FakeJoystick:
    """A named pipe that says what a joystick's device would. Attribute `path`: of it, where there is none until then.

    sticks, buttons: what each reads at rest, -1..1 and 0 or 1, left and up positive.
    """

    _BUTTON, _AXIS, _INITIAL = 1, 2, 0x80  # linux/joystick.h

    def __init__(self, sticks, buttons):
        self._folder = tempfile.TemporaryDirectory()
        self.path = self._folder.name + "/js0"
        self._at_rest = [(self._AXIS, number, value) for number, value in enumerate(sticks)]
        self._at_rest += [(self._BUTTON, number, value) for number, value in enumerate(buttons)]
        self._file = None

    def plug_in(self):
        """Returns when somebody reads it."""
        os.mkfifo(self.path)
        self._file = os.open(self.path, os.O_WRONLY)
        self._write(self._INITIAL)

    def release(self):
        """Let go of everything."""
        self._write(0)

    def push(self, stick, value):
        os.write(self._file, self._event(self._AXIS, stick, value))

    def press(self, button):
        os.write(self._file, self._event(self._BUTTON, button, 1))

    def close(self):
        if self._file is not None:
            os.close(self._file)
        self._folder.cleanup()

    def _write(self, flag):
        os.write(self._file, b"".join(self._event(kind | flag, *where) for kind, *where in self._at_rest))

    def _event(self, kind, number, value):
        reading = round(-32767 * value) if kind & self._AXIS else value
        return struct.pack("=IhBB", 0, reading, kind, number)
