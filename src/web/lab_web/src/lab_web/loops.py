# SPDX-License-Identifier: BSD-3-Clause
"""Loops of threads: they outlive unforeseen errors, and rest while there is no page. No ROS."""
import time

from loop_ros.faults import SURVIVED

#: Between an error of a loop and its next try [s]: an error that comes each time must not fill a processor.
RETRY_S = 0.1
# Between two looks at whether all ends, while there is no page [s].
_LOOK_S = 0.5


def lasting(faults, place, loop, retry_s=RETRY_S):
    """A function of ``ends`` that runs ``loop(ends)`` until it returns, and again after each error; ``faults``
    (:class:`loop_ros.faults.Faults`) notes them under ``place``.
    """
    def run(ends):
        while True:
            try:
                loop(ends)
                return
            except SURVIVED as error:
                faults.note(place, error, "it goes on")
            if ends():
                return
            time.sleep(retry_s)
    return run


def attended(present, loop):
    """A function of ``ends`` that runs ``loop(ends)`` while the event ``present`` is set, until ``ends()``."""
    def run(ends):
        while not ends():
            if present.wait(_LOOK_S):
                loop(lambda: ends() or not present.is_set())
    return run
