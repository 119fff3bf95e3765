# SPDX-License-Identifier: BSD-3-Clause
"""The compiler's pages are given back, and nothing else."""
import subprocess
import sys
from pathlib import Path

from disk_cache.compiler_pages import release

MAPS = """\
7f00000000-7f00001000 r--p 00000000 08:01 11 /venv/libllvmlite.so
7f00001000-7f00004000 r-xp 00001000 08:01 11 /venv/libllvmlite.so
7f00004000-7f00005000 rw-p 00004000 08:01 11 /venv/libllvmlite.so
7f00006000-7f00007000 r-xp 00000000 08:01 12 /venv/libother.so
7f00008000-7f00009000 r-xp 00000000 00:00 0
"""
PROGRAM = """
import re
import numba
from disk_cache.compiler_pages import release

def resident():
    found = re.findall(r" r-xp .*libllvmlite.*\\n(?:.*\\n)*?Rss: +(\\d+)", open("/proc/self/smaps").read())
    return sum(map(int, found))

first = numba.njit(lambda x: x + 1)
assert first(1) == 2
before = resident()
assert release() > 0
assert resident() < before / 10, (before, resident())
assert first(2) == 3
assert numba.njit(lambda x: 2.0 * x)(1.5) == 3.0
"""


def test_the_compilers_code_alone_is_given_back(tmp_path):
    maps, forgotten = tmp_path / "maps", []
    maps.write_text(MAPS)
    assert release(maps, lambda *one: forgotten.append(one)) == 0x3000
    assert forgotten == [(0x7f00001000, 0x3000)]


def test_a_system_without_such_a_file_keeps_its_pages():
    assert release(Path("/nowhere/maps")) == 0


def test_the_compiler_works_afterwards():
    subprocess.run([sys.executable, "-c", PROGRAM], check=True, timeout=120)
