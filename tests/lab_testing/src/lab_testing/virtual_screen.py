# SPDX-License-Identifier: BSD-3-Clause
"""A virtual screen, and the picture on it."""
import os
import shutil
import struct
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from lab_testing.skipping import skip
from lab_testing.waiting import wait_until

WIDTH, HEIGHT = 1200, 800
#: Why a test of windows is skipped.
MISSING = "Xvfb, a virtual screen, is not installed"
_XWD_FIELDS = 25  # of 4 bytes each, at the start of an X window dump


def open_for(case):
    """A VirtualScreen until the test of a ``unittest.TestCase`` ends; skips the test where Xvfb is missing."""
    if shutil.which("Xvfb") is None:
        skip(case, MISSING)
    screen = VirtualScreen()
    case.addCleanup(screen.close)
    return screen


class VirtualScreen:
    """An X server without a screen; `environment` makes programs draw on it, with software OpenGL."""

    def __init__(self):
        self._folder = tempfile.TemporaryDirectory()
        reader, writer = os.pipe()
        # Xvfb picks a free display by itself and prints its number.
        self._server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writer), "-screen", "0", "%dx%dx24" % (WIDTH, HEIGHT), "-nolisten", "tcp",
             "-fbdir", self._folder.name], pass_fds=[writer], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(writer)
        with os.fdopen(reader) as stream:
            number = stream.readline().strip()
        if not number:
            raise RuntimeError("Xvfb did not start (exit code %s)" % self._server.wait())
        self.environment = {**os.environ, "DISPLAY": ":" + number, "LIBGL_ALWAYS_SOFTWARE": "1",
                            "QT_X11_NO_MITSHM": "1", "XDG_RUNTIME_DIR": self._folder.name}

    def picture(self):
        """The present picture: (HEIGHT, WIDTH, 3) uint8, red first."""
        data = (Path(self._folder.name) / "Xvfb_screen0").read_bytes()
        fields = struct.unpack(">%dI" % _XWD_FIELDS, data[:4 * _XWD_FIELDS])
        header_size, bytes_per_line, colours = fields[0], fields[12], fields[19]
        begin = header_size + 12 * colours
        rows = np.frombuffer(data, np.uint8, HEIGHT * bytes_per_line, begin).reshape(HEIGHT, bytes_per_line)
        return rows[:, :4 * WIDTH].reshape(HEIGHT, WIDTH, 4)[:, :, 2::-1].copy()

    def wait_until_still(self, part, timeout_s, still_s=2.0):
        """Return the picture once `part(picture)` has been the same array for still_s [s].

        part: function that returns the relevant part of a picture, or None while it does not exist yet.
        Raises AssertionError after timeout_s.
        """
        last, since, moved = None, time.monotonic(), "nothing was seen"

        def still_picture():
            nonlocal last, since, moved
            picture = self.picture()
            seen = part(picture)
            if seen is None or last is None or not np.array_equal(seen, last):
                moved = _difference(last, seen)
                last, since = seen, time.monotonic()
            elif time.monotonic() - since > still_s:
                return (picture,)
            return None

        return wait_until(still_picture, lambda: "the screen to come to rest; %s" % moved, timeout_s, 0.25)[0]

    def close(self):
        self._server.terminate()
        self._server.wait(10.0)
        self._folder.cleanup()


def _difference(before, after):
    """Where two pictures differ, for an error."""
    if before is None or after is None or before.shape != after.shape:
        return "it came or went"
    rows, columns = np.nonzero((before != after).reshape(*before.shape[:2], -1).any(axis=2))
    return ("%d pixels differed last, in rows %d to %d and columns %d to %d"
            % (len(rows), rows.min(), rows.max(), columns.min(), columns.max()))
