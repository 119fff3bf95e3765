# SPDX-License-Identifier: BSD-3-Clause
"""A SpaceMouse by its HID reports, without a driver: Linux's hidraw device in, axes and buttons out. Free of ROS.

Reports, as 3Dconnexion's devices send them (little-endian, int16): 1: three translations, and in newer devices three
rotations behind them; 2: three rotations; 3: a bit for each button. x is to the right, y towards the user, z down,
rotations are about these; at its end the cap reads about 350.
"""
from __future__ import annotations

import os
import select
import struct
from pathlib import Path

#: Reading of an axis at its end.
FULL = 350.0
#: 3Dconnexion, and Logitech for its older devices with their products' numbers.
_VENDOR, _OLD_VENDOR, _OLD_PRODUCTS = 0x256F, 0x046D, frozenset(range(0xC603, 0xC62C))
_TRANSLATION, _ROTATION, _BUTTONS = 1, 2, 3
_LONGEST_REPORT = 64
# Of reports per axis, x, y, z: the row of (forward, left, up), all of them in the other direction.
_ROWS = (1, 0, 2)


class SpaceMouseLost(Exception):
    """The device is not there; the text says why, and what to do."""


class Cap:
    """The newest state: ``axes`` (6,), -1 to 1, forward, left, up, and turns about these; ``buttons``, 0 or 1."""

    def __init__(self) -> None:
        self.release()

    def release(self) -> None:
        """All is let go."""
        self.axes, self.buttons = [0.0] * 6, [0] * 32

    def take(self, report: bytes) -> bool:
        """Take one report; whether it meant something. Others, such as of a battery, change nothing."""
        if not report:
            return False
        kind, content = report[0], report[1:]
        if kind == _TRANSLATION and len(content) >= 6:
            self._put(0, content)
            if len(content) >= 12:
                self._put(3, content[6:])
        elif kind == _ROTATION and len(content) >= 6:
            self._put(3, content)
        elif kind == _BUTTONS and content:
            pressed = int.from_bytes(content[:4], "little")
            self.buttons = [pressed >> number & 1 for number in range(32)]
        else:
            return False
        return True

    def _put(self, first: int, content: bytes) -> None:
        for row, value in zip(_ROWS, struct.unpack_from("<3h", content), strict=True):
            self.axes[first + row] = max(-1.0, min(1.0, -value / FULL)) or 0.0


class SpaceMouseDevice:
    """An open hidraw device. path "": the first SpaceMouse. Raises SpaceMouseLost."""

    def __init__(self, path: str = "", classes: Path = Path("/sys/class/hidraw")) -> None:
        self.path = path or _found(classes)
        try:
            self._file = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK)
        except PermissionError:
            raise SpaceMouseLost("%s may not be read; as root: setfacl -m u:$USER:r %s" % (self.path,
                                                                                           self.path)) from None
        except OSError as error:
            raise SpaceMouseLost("no SpaceMouse at %s: %s; plug one in, or set ~dev" % (
                self.path, error.strerror)) from None

    def read(self, timeout_s: float) -> list[bytes]:
        """Return the reports that come within a time [s], oldest first. Raises SpaceMouseLost."""
        reports: list[bytes] = []
        try:
            if not select.select([self._file], [], [], timeout_s)[0]:
                return reports
            while report := os.read(self._file, _LONGEST_REPORT):
                reports.append(report)
        except BlockingIOError:
            return reports
        except OSError as error:
            raise SpaceMouseLost("the SpaceMouse %s is lost: %s" % (self.path, error.strerror)) from None
        if not reports:
            raise SpaceMouseLost("the SpaceMouse %s is lost: it was closed" % self.path)
        return reports

    def close(self) -> None:
        os.close(self._file)


def _found(classes: Path) -> str:
    """The path of the first SpaceMouse. Raises SpaceMouseLost."""
    for device in sorted(classes.glob("hidraw*")):
        try:
            lines = (device / "device/uevent").read_text().splitlines()
            line = next(line for line in lines if line.startswith("HID_ID="))
            _, vendor, product = line.removeprefix("HID_ID=").split(":")
        except (OSError, StopIteration, ValueError):
            continue
        if int(vendor, 16) == _VENDOR or int(vendor, 16) == _OLD_VENDOR and int(product, 16) in _OLD_PRODUCTS:
            return "/dev/" + device.name
    raise SpaceMouseLost("no SpaceMouse is connected; plug one in, or set ~dev to its /dev/hidraw file")
