# SPDX-License-Identifier: BSD-3-Clause
"""Free memory of the machine, and whether one more lab may start. Linux only."""
from __future__ import annotations

from pathlib import Path

#: What a lab of Baxter's needs at most by itself, running or paused (docs/performance.md, labs of a class).
LAB_BYTES = 850_000_000


def available_bytes(file: Path = Path("/proc/meminfo")) -> int:
    """Memory that programs can have without swapping [bytes] (proc_meminfo(5))."""
    rows = dict(line.split(":", 1) for line in file.read_text(encoding="ascii").splitlines())
    return int(rows["MemAvailable"].split()[0]) << 10


def shortage(available: int, limit_bytes: int, starting: int = 0) -> str:
    """Why no further lab should start, or "". limit_bytes: of the memory of each lab; starting: labs that are starting,
    which have not taken theirs yet."""
    if available >= (1 + starting) * min(LAB_BYTES, limit_bytes):
        return ""
    return "this machine has only %.1f GB of memory free" % (available / 1e9)


def forecast(count: int, available: float, limit_bytes: int) -> str:
    """The warning for an instructor whose labs are more than memory has room for; else ""."""
    each = min(LAB_BYTES, limit_bytes)
    if count * each <= available:
        return ""
    return ("This machine has %.1f GB of memory free, and a lab needs about %.1f GB, also while it is paused: about %d "
            "of the %d labs fit. The others wait: one that is opened takes the place of a paused one that nobody has "
            "opened; else one must be stopped." % (available / 1e9, each / 1e9, available // each, count))
