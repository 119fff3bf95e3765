# SPDX-License-Identifier: BSD-3-Clause
"""Room on a disk, tried before other programs or long calculations write there. Free of ROS."""
import os
import tempfile


def try_room(folder, size):
    """Raises OSError where a file of ``size`` bytes cannot be made in ``folder``."""
    with tempfile.TemporaryFile(dir=str(folder)) as file:
        os.posix_fallocate(file.fileno(), 0, size)
