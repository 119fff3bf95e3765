# SPDX-License-Identifier: BSD-3-Clause
"""Loops of threads that outlive unforeseen errors. No ROS."""
import time

from loop_ros.faults import SURVIVED

#: Between an error of a loop and its next try [s]: an error that comes each time must not fill a processor.
RETRY_S = 0.1


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
