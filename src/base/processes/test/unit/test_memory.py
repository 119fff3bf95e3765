# SPDX-License-Identifier: BSD-3-Clause
"""Freed memory goes back to the system, or is used again."""
import subprocess
import sys

# Large blocks and small ones in turns; then the large ones go.
PROGRAM = """
import sys
from pathlib import Path
from processes.memory import return_large_blocks

def resident_mb():
    line, = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS:")]
    return int(line.split()[1]) / 1024

if sys.argv[1] == "mended":
    return_large_blocks()
bytes(30_000_000)
before, kept, large = resident_mb(), [], []
for number in range(20):
    large.append(bytearray(5_000_000))
    large[-1][::4096] = b"x" * len(large[-1][::4096])
    kept.append(bytes(100_000))
large.clear()
print(resident_mb() - before)
"""


def growth_mb(how):
    done = subprocess.run([sys.executable, "-c", PROGRAM, how], check=True, capture_output=True, text=True)
    return float(done.stdout)


def test_large_blocks_go_back():
    assert growth_mb("mended") < 15.0


def test_without_the_mending_malloc_keeps_them():
    assert growth_mb("as it is") > 50.0
