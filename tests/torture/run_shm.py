# SPDX-License-Identifier: BSD-3-Clause
"""torture.py shm: a separate /dev/shm for the lab, which becomes full during the run; then a start on a full one."""
from pathlib import Path

from full import bear, fill, require_root
from limits import arm_limits
from robot import init_node
from watch import Watch

from lab import Lab

SIZE = "64m"
STILL_RAD = 0.001
MINUTES = 1.0
# In a mount namespace, so that the machine's /dev/shm is not changed.
MOUNT = "mount -t tmpfs -o size=%s tmpfs /dev/shm && %s exec \"$@\""
FILL = "{ head -c 1g /dev/zero >/dev/shm/filler || true; } 2>/dev/null;"
START_LIMIT_S = 120.0


def run(options, journal):
    """Fill the /dev/shm of a running lab, then start another on a full one; return figures for the result."""
    require_root()
    with Lab(options.out, prefix=prefix("")) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            fill(Path("/proc", str(lab.pid("/gazebo")), "root", "dev", "shm"))
            bear(lab, watch, options, journal, MINUTES if options.minutes is None else options.minutes)
            simulated_s = watch.simulated_s
    said = start_on_a_full_one(options)
    if "/dev/shm" not in said and "No space left" not in said and "shared memory" not in said:
        journal.fail("the error of a start on a full /dev/shm does not name it: %s" % said[-400:], options.seed, 0, 1)
    return {"simulated_s": simulated_s, "also": {"shared_memory": SIZE}}


def start_on_a_full_one(options):
    """Start a lab on a full /dev/shm; return the end of its output."""
    output = options.out / "second"
    try:
        with Lab(output, prefix=prefix(FILL)):
            return "the lab started: shared memory is not needed"
    except AssertionError:
        return (output / "output.txt").read_text(errors="replace")[-4000:]


def prefix(fill_first):
    """Command prefix that gives a command its own /dev/shm."""
    return ("unshare", "--mount", "--propagation", "private", "bash", "-c", MOUNT % (SIZE, fill_first), "bash")
