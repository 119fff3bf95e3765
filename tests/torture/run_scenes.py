# SPDX-License-Identifier: BSD-3-Clause
"""torture.py scenes: hostile planning scenes for the core of the planner, without a lab."""
import time

from scenes import Scenes


def run(options, journal):
    """Check scene after scene; return figures for the result."""
    scenes, slowest = Scenes(options.seed), (0.0, -1)
    for number in range(options.first, options.first + options.messages):
        if options.until is not None and time.monotonic() > options.until:
            break
        begin = time.process_time()
        journal.note(number, "scene", "hostile", number)
        found = scenes.problems(number)
        slowest = max(slowest, (time.process_time() - begin, number))
        if found:
            journal.fail("; ".join(found), options.seed, number, 1)
    return {"also": {"slowest_s": round(slowest[0], 2), "slowest": slowest[1]}}
