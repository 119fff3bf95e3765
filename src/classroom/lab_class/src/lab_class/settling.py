# SPDX-License-Identifier: BSD-3-Clause
"""When a lab has finished starting: its page answers long before its simulator has loaded the robot. `Settling` takes
time and measurements as arguments; `demand_s` reads them from /proc.
"""
from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

#: A lab has settled when, for QUIET_S [s], no process of it has started or ended, and its threads have asked for less
#: than MAX_DEMAND processors. One that starts asks for more: its programs import their libraries beside each other.
QUIET_S, MAX_DEMAND = 3.0, 1.0
#: A lab whose programs never become quiet counts as settled after this time [s].
LIMIT_S = 40.0


class Settling:
    """One lab, from the moment at which its page answers."""

    def __init__(self, now: float) -> None:
        """now: a clock [s]."""
        self._begun = now
        # Of the last change; None before the first look.
        self._since, self._demand_s = now, 0.0
        self._processes: frozenset[int] | None = None

    def look(self, processes: Iterable[int], demand_s: float, is_simulating: bool, now: float) -> bool:
        """Has it settled? processes: their ids; demand_s: by `demand_s`, since their start [s]; is_simulating: its
        simulator has reported a real-time factor; now: the clock [s]."""
        if now - self._begun >= LIMIT_S:
            return True
        processes = frozenset(processes)
        is_same = processes == self._processes
        if is_same and now - self._since < QUIET_S:
            return False
        if is_same and is_simulating and demand_s - self._demand_s < MAX_DEMAND * (now - self._since):
            return True
        self._since, self._processes, self._demand_s = now, processes, demand_s
        return False


def demand_s(processes: list[int], proc: Path = Path("/proc")) -> float:
    """Time that all threads of these processes have run or waited for a processor, since their start [s].

    The waiting makes it independent of other programs' load. Source: https://docs.kernel.org/scheduler/sched-stats.html
    """
    total = 0
    for pid in processes:
        # Processes and threads end meanwhile.
        with contextlib.suppress(OSError, ValueError):
            for thread in (proc / str(pid) / "task").iterdir():
                with contextlib.suppress(OSError, ValueError):
                    running, waiting, _ = (thread / "schedstat").read_text(encoding="ascii").split()
                    total += int(running) + int(waiting)
    return 1e-9 * total
