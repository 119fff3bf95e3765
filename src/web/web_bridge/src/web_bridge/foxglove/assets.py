# SPDX-License-Identifier: BSD-3-Clause
"""Files of packages by their package:// names: meshes, textures, descriptions."""
from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

from web_bridge.errors import BridgeError, RequestForbidden, shown

#: A file that has more is not sent [bytes].
LARGEST_FILE = 32 << 20
_URI = re.compile(r"package://([A-Za-z][\w-]*)/(.+)", re.DOTALL)


class Assets:
    """``folder_of(package)`` returns the folder of a package, or None."""

    def __init__(self, folder_of: Callable[[str], str | None], largest_file: int = LARGEST_FILE) -> None:
        self._folder_of = folder_of
        self._largest_file = largest_file

    def read(self, uri: str) -> bytes:
        """The bytes of a file inside of its package's folder. Raises BridgeError."""
        parts = _URI.fullmatch(uri)
        if parts is None:
            raise BridgeError("%s is no package://PACKAGE/FILE" % shown(uri))
        package, inside = parts[1], unquote(parts[2])
        # After %2e%2e has become a dot.
        if ".." in inside or "\0" in inside or "\\" in inside:
            raise RequestForbidden("%s leaves its package" % shown(uri))
        folder = self._folder_of(package)
        if folder is None:
            raise BridgeError("the package %s is not on this machine" % package)
        root = Path(folder).resolve()
        try:
            path = (root / inside.lstrip("/")).resolve(strict=True)
            if not path.is_relative_to(root):
                raise RequestForbidden("%s leaves its package" % shown(uri))
            return self._contents(path, uri)
        # RuntimeError: a loop of links, before Python 3.13.
        except (OSError, RuntimeError) as error:
            reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else "a loop of links"
            raise BridgeError("%s cannot be read: %s" % (shown(uri, 200), reason)) from None

    def _contents(self, path: Path, uri: str) -> bytes:
        # Not to wait for a named pipe; and no link that has been put there since.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
        with open(descriptor, "rb") as stream:
            found = os.fstat(descriptor)
            if not stat.S_ISREG(found.st_mode):
                raise BridgeError("%s is no file" % shown(uri))
            if found.st_size > self._largest_file:
                raise BridgeError("%s has %d bytes; at most %d are sent"
                                  % (shown(uri), found.st_size, self._largest_file))
            return stream.read(self._largest_file)
