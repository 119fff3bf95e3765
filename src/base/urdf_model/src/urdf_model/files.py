# SPDX-License-Identifier: BSD-3-Clause
"""Read descriptions from files."""
from __future__ import annotations

from pathlib import Path

from command_line.user_files import PIPE_WAIT_S, check_file, read_file, read_text

from . import bounds
from .errors import UrdfError

__all__ = ["check_file", "description_text", "read_file", "read_text"]


def description_text(path: Path) -> str:
    """Return the text of a description in a file (a ``Path``), URDF or SRDF; of xacro, what it expands to.

    Raises OSError for a file that cannot be read, ValueError for one that is not UTF-8, and :class:`UrdfError`, a
    ValueError, if xacro cannot expand it.
    """
    if path.suffix != ".xacro":
        return read_text(path, bounds.DESCRIPTION_BYTES, pipe_wait_s=PIPE_WAIT_S)
    import xacro

    check_file(path, bounds.DESCRIPTION_BYTES)
    try:
        return xacro.process_file(str(path)).toprettyxml(indent="  ")
    except Exception as error:  # its expressions are Python, which can raise any exception
        raise UrdfError("xacro cannot expand %s: %s" % (path, " ".join(str(error).split()))) from None
