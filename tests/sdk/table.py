# SPDX-License-Identifier: BSD-3-Clause
"""The table of checks: modules enter theirs by the decorator `check`."""

CHECKS = {}  # name: function(lab) -> {measured: number}
BARE = set()  # names of those that need arms without grippers


def check(name, bare=False):
    """Enter a function as the check ``name``; bare: its lab has arms without grippers."""
    def enter(function):
        CHECKS[name] = function
        if bare:
            BARE.add(name)
        return function
    return enter
