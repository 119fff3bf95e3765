# SPDX-License-Identifier: BSD-3-Clause
"""Faults that the loop survives: counted for /diagnostics, logged now and then. ROS-free."""
import contextlib
import os
import time

#: What anybody's code may raise without taking the loop with it; ``sys.exit`` in a callback does not end the world.
SURVIVED = (Exception, SystemExit)
#: At most one line about the same place in so long [s, wall time].
LINE_PERIOD_S = 5.0
# Of an error's text, in a line and in /diagnostics [characters].
_TEXT_CHARACTERS = 300
# Places that are remembered. Topics and services are few; who opens and closes more loses the oldest.
_MOST_PLACES = 200


class Fault:
    """What went wrong in one place: how often, and the newest error as text."""

    __slots__ = ("count", "text", "told_s")

    def __init__(self):
        self.count = 0
        self.text = ""
        self.told_s = None


class Faults:
    """Counts faults by place: a topic, a service, a part of the loop. Any thread may note one."""

    def __init__(self, log, clock=time.monotonic):
        """``log``: ``error(text)``. ``clock`` is replaceable for tests."""
        self._log = log
        self._clock = clock
        #: {place: Fault}, in the order in which places were first noted.
        self.places = {}

    def note(self, place, error, consequence="it is left out"):
        """Count ``error`` at ``place`` and tell it, unless that place was told of lately."""
        fault = self.places.get(place)
        if fault is None:
            fault = self.places[place] = Fault()
            if len(self.places) > _MOST_PLACES:
                with contextlib.suppress(KeyError, StopIteration, RuntimeError):  # another thread was faster
                    del self.places[next(iter(self.places))]
        fault.count += 1
        fault.text = described(error)
        now = self._clock()
        if fault.told_s is None or now - fault.told_s >= LINE_PERIOD_S:
            fault.told_s = now
            again = "" if fault.count == 1 else " (%d times by now)" % fault.count
            self._log.error("%s: %s; %s%s" % (place, fault.text, consequence, again))

    def guarded(self, place, function, *arguments):
        """Call ``function(*arguments)`` and return what it does; note what it raises, and return None then."""
        try:
            return function(*arguments)
        except SURVIVED as error:
            self.note(place, error)
            return None


def described(error):
    """An exception in one line: its type, the beginning of its text, and where it was raised."""
    text = " ".join(str(error).split())
    if len(text) > _TEXT_CHARACTERS:
        text = text[:_TEXT_CHARACTERS] + " ..."
    where, trace = "", error.__traceback__
    while trace is not None:
        where = " (%s:%d)" % (os.path.basename(trace.tb_frame.f_code.co_filename), trace.tb_lineno)
        trace = trace.tb_next
    return "%s: %s%s" % (type(error).__name__, text, where)
