# SPDX-License-Identifier: BSD-3-Clause
"""A joystick's device file."""
from __future__ import annotations

import array
import errno
import fcntl
import os
import select

# linux/joystick.h: how many axes and buttons there are, one byte each.
_AXES, _BUTTONS = 0x80016A11, 0x80016A12
_CHUNK = 8 * 64  # [bytes] of 64 events
_HINTS = {errno.ENOENT: "plug one in, or set ~dev", errno.ENODEV: "plug one in, or set ~dev",
          errno.EACCES: "put yourself into the group that owns the device (sudo usermod -aG input $USER)"}


class JoystickLost(Exception):
    """The device does not exist, or is gone; the text says why in one line."""


class JoystickDevice:
    """An open joystick. Attributes: `axes`, `buttons`, their numbers (0 if the device does not report them).

    Raises JoystickLost when it cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            hint = _HINTS.get(error.errno or 0)
            raise JoystickLost("no joystick at %s: %s%s" % (path, error.strerror,
                                                            "; " + hint if hint else "")) from None
        self.axes, self.buttons = self._count(_AXES), self._count(_BUTTONS)

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that arrive within a time [s]; may be empty. Raises JoystickLost."""
        try:
            if not select.select([self._file], [], [], timeout_s)[0]:
                return b""
            data = os.read(self._file, _CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise JoystickLost("joystick %s is lost: %s" % (self._path, error.strerror)) from None
        if not data:
            raise JoystickLost("joystick %s is lost: it was closed" % self._path)
        return data

    def close(self) -> None:
        os.close(self._file)

    def _count(self, request: int) -> int:
        found = array.array("B", [0])
        try:
            fcntl.ioctl(self._file, request, found)
        except OSError:  # a pipe or a terminal in place of a joystick
            return 0
        return found[0]
