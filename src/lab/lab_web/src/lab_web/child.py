# SPDX-License-Identifier: BSD-3-Clause
"""Processes beside the page's server that end with it. No ROS."""
from __future__ import annotations

import contextlib
import subprocess
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


class Child(subprocess.Popen[bytes]):
    """A command that ends when its standard input does, at the latest with this process. Raises OSError."""

    stdin: IO[bytes]

    def __init__(self, command: Sequence[str], stdout: int | None = None, stderr: int | None = None) -> None:
        """``stdout``, ``stderr``: as of subprocess.Popen."""
        # A separate session: Ctrl-C in a terminal reaches only the owner, which then ends it once.
        super().__init__(command, stdin=subprocess.PIPE, stdout=stdout, stderr=stderr, start_new_session=True)

    def end(self) -> None:
        """Ask it to end; does not wait."""
        with contextlib.suppress(OSError):
            self.stdin.close()


class HeardChild(Child):
    """A Child whose output is a pipe."""

    stdout: IO[bytes]

    def __init__(self, command: Sequence[str], stderr: int | None = None) -> None:
        """``stderr``: as of subprocess.Popen."""
        super().__init__(command, subprocess.PIPE, stderr)
