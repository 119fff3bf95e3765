# SPDX-License-Identifier: BSD-3-Clause
"""torture.py disk: logs and temporary files on a small file system that becomes full during the run."""
import subprocess

from full import bear, fill, require_root
from limits import arm_limits
from robot import init_node
from watch import Watch

from lab import Lab

SIZE = "48m"
STILL_RAD = 0.001
MINUTES = 1.0


def run(options, journal):
    """Fill the disk of a running lab; return figures for the result."""
    require_root()
    disk = options.out / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=" + SIZE, "tmpfs", str(disk)], check=True)
    try:
        environment = {"ROS_LOG_DIR": str(disk / "log"), "ROS_HOME": str(disk / "home"), "TMPDIR": str(disk)}
        with Lab(options.out, environment=environment) as lab:
            init_node()
            with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
                fill(disk)
                bear(lab, watch, options, journal, MINUTES if options.minutes is None else options.minutes)
                return {"simulated_s": watch.simulated_s, "also": {"disk": SIZE}}
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)
