# SPDX-License-Identifier: BSD-3-Clause
"""Mouse and keys of a virtual screen, by X's extension for tests (XTEST)."""
import ctypes
import ctypes.util

LEFT, MIDDLE, RIGHT, WHEEL_UP, WHEEL_DOWN = 1, 2, 3, 4, 5
#: Why a test that needs it is skipped.
MISSING = "libXtst, X's extension for tests, is not installed"
_IMMEDIATELY = 0


def is_there():
    """Whether this machine has the libraries."""
    return all(ctypes.util.find_library(name) for name in ("X11", "Xtst"))


class ScreenInput:
    """Moves the pointer and presses buttons and keys of a :class:`lab_testing.virtual_screen.VirtualScreen`."""

    def __init__(self, screen):
        """Raises OSError if the screen does not answer."""
        self._x, self._test = (ctypes.CDLL(ctypes.util.find_library(name)) for name in ("X11", "Xtst"))
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XStringToKeysym.restype = ctypes.c_ulong
        self._x.XKeysymToKeycode.argtypes = ctypes.c_void_p, ctypes.c_ulong
        self._x.XSync.argtypes = ctypes.c_void_p, ctypes.c_int
        self._x.XCloseDisplay.argtypes = (ctypes.c_void_p,)
        self._test.XTestFakeMotionEvent.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_int,
                                                    ctypes.c_ulong)
        self._test.XTestFakeButtonEvent.argtypes = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong
        self._test.XTestFakeKeyEvent.argtypes = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong
        name = screen.environment["DISPLAY"]
        self._display = self._x.XOpenDisplay(name.encode())
        if not self._display:
            raise OSError("display %s does not answer" % name)

    def move(self, x, y):
        """Put the pointer at ``x``, ``y`` [pixels]."""
        self._test.XTestFakeMotionEvent(self._display, -1, int(round(x)), int(round(y)), _IMMEDIATELY)
        self._x.XSync(self._display, 0)

    def button(self, number, is_down):
        """Press or release a button."""
        self._test.XTestFakeButtonEvent(self._display, number, int(is_down), _IMMEDIATELY)
        self._x.XSync(self._display, 0)

    def click(self, x, y, number=LEFT):
        """Move there, press and release."""
        self.move(x, y)
        self.button(number, True)
        self.button(number, False)

    def key(self, name, is_down):
        """Press or release a key by X's name for it, such as ``Control_L``, ``space``, ``t``."""
        symbol = self._x.XStringToKeysym(name.encode())
        if not symbol:
            raise ValueError("X knows no key '%s'" % name)
        self._test.XTestFakeKeyEvent(self._display, self._x.XKeysymToKeycode(self._display, symbol), int(is_down),
                                     _IMMEDIATELY)
        self._x.XSync(self._display, 0)

    def type(self, *names):
        """Press all of these keys, then release them."""
        for name in names:
            self.key(name, True)
        for name in reversed(names):
            self.key(name, False)

    def close(self):
        """Leave the display."""
        self._x.XCloseDisplay(self._display)
