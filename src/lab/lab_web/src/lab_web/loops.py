# SPDX-License-Identifier: BSD-3-Clause
"""Loops of threads that rest while there is no page. No ROS."""

# Between two looks at whether all ends, while there is no page [s].
_LOOK_S = 0.5


def attended(present, loop):
    """A function of ``ends`` that runs ``loop(ends)`` while the event ``present`` is set, until ``ends()``."""
    def run(ends):
        while not ends():
            if present.wait(_LOOK_S):
                loop(lambda: ends() or not present.is_set())
    return run
