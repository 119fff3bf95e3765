# SPDX-License-Identifier: BSD-3-Clause
"""Room on a disk, tried before other programs or long calculations write there. Free of ROS."""
import errno
import os
import stat
import tempfile
from pathlib import Path


def try_room(folder, size):
    """Raises OSError where a file of ``size`` bytes cannot be made in ``folder``."""
    with tempfile.TemporaryFile(dir=str(folder)) as file:
        os.posix_fallocate(file.fileno(), 0, size)


def spare_folder(name):
    """The path of this user's folder ``name_UID`` among temporary files, for results that their own folder cannot take.

    It is the same in all processes: nodes that are ended at once delete nothing. Raises OSError, also where the folder
    is not this user's alone.
    """
    folder = Path(tempfile.gettempdir()) / ("%s_%d" % (name, os.getuid()))
    folder.mkdir(mode=0o700, exist_ok=True)
    status = os.lstat(folder)
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise PermissionError(errno.EPERM, "it is not a folder of this user alone", str(folder))
    return folder
