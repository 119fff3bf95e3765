# SPDX-License-Identifier: BSD-3-Clause
"""A fake joystick for tests."""
import os
import struct
import tempfile

_BUTTON, _AXIS, _INITIAL = 1, 2, 0x80  # linux/joystick.h


class FakeJoystick:
    """A named pipe that sends the events of a joystick's device. Attribute `path`: its path; it does not exist until
    plug_in.

    sticks, buttons: what each reads at rest, -1..1 and 0 or 1, left and up positive.
    """

    def __init__(self, sticks, buttons):
        self._folder = tempfile.TemporaryDirectory()
        self.path = self._folder.name + "/js0"
        self._at_rest = [(_AXIS, number, value) for number, value in enumerate(sticks)]
        self._at_rest += [(_BUTTON, number, value) for number, value in enumerate(buttons)]
        self._file = None

    def plug_in(self):
        """Create the pipe; returns when a reader has opened it."""
        os.mkfifo(self.path)
        self._file = os.open(self.path, os.O_WRONLY)
        self._write(_INITIAL)

    def unplug(self):
        """Tell the reader that it was closed."""
        if self._file is not None:
            os.remove(self.path)  # first, so that the reader cannot open the old one again
            os.close(self._file)
            self._file = None

    def release(self):
        """Release all controls."""
        self._write(0)

    def push(self, stick, value):
        os.write(self._file, self._event(_AXIS, stick, value))

    def press(self, button):
        os.write(self._file, self._event(_BUTTON, button, 1))

    def close(self):
        """Unplug it permanently."""
        self.unplug()
        self._folder.cleanup()

    def _write(self, flag):
        os.write(self._file, b"".join(self._event(kind | flag, *where) for kind, *where in self._at_rest))

    @staticmethod
    def _event(kind, number, value):
        reading = round(-32767 * value) if kind & _AXIS else value
        return struct.pack("=IhBB", 0, reading, kind, number)
