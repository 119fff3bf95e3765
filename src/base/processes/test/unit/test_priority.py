# SPDX-License-Identifier: BSD-3-Clause
"""Helpers of programs that give way are not even slower than these."""
import os
import subprocess
import sys

# Its helper's niceness, after its own.
PROGRAM = """
import os, subprocess, sys
from processes.priority import as_before, give_way
give_way(10)
print(os.nice(0), end=" ", flush=True)
helper = "import os; from processes.priority import give_way; give_way(5); print(os.nice(0))"
as_before(subprocess.run, [sys.executable, "-c", helper], check=True, start_new_session=True)
give_way(3)
print(os.nice(0))
"""


def test_what_a_user_waits_for_does_not_inherit_a_low_priority():
    for leads in (False, True):
        done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True,
                              start_new_session=leads)
        # The tests may have a niceness of their own, and 19 is the greatest.
        assert done.stdout.split() == [str(min(os.nice(0) + step, 19)) for step in (10, 5, 13)]
