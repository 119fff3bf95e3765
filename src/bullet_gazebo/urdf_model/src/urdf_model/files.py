# SPDX-License-Identifier: BSD-3-Clause
"""Read files that descriptions name, without blocking and up to a limit."""

import errno
import os
import stat

from .errors import UrdfError


def read_file(path, most_bytes):
    """Return the content (bytes) of a regular file. Raises OSError for anything else, and for a larger one.

    Reading a named pipe may block, and a device may never end, so neither is opened.
    """
    with open(path, "rb", opener=_open_at_once) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is %s, not a file" % kind_of(status.st_mode), str(path))
        # The kernel's own files claim to be empty, and reading some of them blocks.
        if status.st_size == 0:
            raise OSError(errno.EINVAL, "it is empty", str(path))
        content = file.read(most_bytes + 1) if status.st_size <= most_bytes else b""
        if status.st_size > most_bytes or len(content) > most_bytes:
            raise OSError(
                errno.EFBIG, "it has %d bytes, expected at most %d" % (max(status.st_size, len(content)), most_bytes),
                str(path),
            )
        return content


def description_text(path):
    """Return the text of a description in a file (a ``Path``), URDF or SRDF; of xacro, what it expands to.

    Raises OSError for a file that cannot be read, ValueError for one that is not UTF-8, and :class:`UrdfError`, a
    ValueError, if xacro cannot expand it.
    """
    if path.suffix != ".xacro":
        return path.read_text(encoding="utf-8")
    import xacro

    try:
        return xacro.process_file(str(path)).toprettyxml(indent="  ")
    except Exception as error:  # its expressions are Python, which can raise any exception
        raise UrdfError("xacro cannot expand %s: %s" % (path, " ".join(str(error).split()))) from None


def kind_of(mode):
    """Return in words what a path with the ``st_mode`` ``mode`` is, where it is not a regular file."""
    kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a named pipe"), (stat.S_ISSOCK, "a socket"),
             (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"))
    return next((words for is_kind, words in kinds if is_kind(mode)), "something else")


def _open_at_once(path, flags):
    return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
