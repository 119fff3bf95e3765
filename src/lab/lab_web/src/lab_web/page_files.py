# SPDX-License-Identifier: BSD-3-Clause
"""Files by which the lab's page and other programs of the same user meet: the page's address, an exercise's result.

Files, and not topics: the address holds a token, which only this user may read, and an exercise is checked in a
separate network, from which no master of the user is reached.
"""
from __future__ import annotations

import contextlib
import os
import re
import socket
from pathlib import Path
from urllib.parse import urlsplit

from disk_cache.files import replace_text

_CONNECT_S = 1.0


def folder() -> Path:
    """The folder of these files, below ROS's own; only its user can enter it."""
    path = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "lab_page"
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    return path


def write_address(master_uri: str, address: str) -> None:
    """The page of this master's lab is at ``address``, which holds a token. Raises OSError."""
    replace_text(_address_file(master_uri), address)


def remove_address(master_uri: str, address: str) -> None:
    """The page at ``address`` has ended; that of another one, which has taken its place, stays."""
    with contextlib.suppress(OSError):
        file = _address_file(master_uri)
        if file.read_text(encoding="utf-8") == address:
            file.unlink()


def address(master_uri: str) -> str | None:
    """The address of the page of this master's lab, or None where no page answers."""
    try:
        found = _address_file(master_uri).read_text(encoding="utf-8")
        parts = urlsplit(found)
        socket.create_connection((parts.hostname, parts.port), _CONNECT_S).close()
    # No file, another text in it, or a page that was killed.
    except (OSError, ValueError, TypeError):
        return None
    return found


def result_file() -> Path:
    """Where the result of the last checked exercise is, as the JSON of ``./baxter.sh check --json``."""
    return folder() / "exercise.json"


def write_result(text: str) -> None:
    """An exercise has been checked. Raises OSError."""
    replace_text(result_file(), text)


def _address_file(master_uri: str) -> Path:
    return folder() / ("address-" + re.sub(r"[^\w.-]+", "_", master_uri))
