# SPDX-License-Identifier: BSD-3-Clause
"""Where packages are: rospkg knows, and where there is no ROS, this library its own."""
from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, Protocol

from urdf_model import XmlRefused, parse_xml

#: Beside this library where pip has installed it: the packages' descriptions and settings.
SHARE = "baxter_lab_share"


class PackageNotFound(LookupError):
    """There is no package of that name; the text says where was looked."""


try:
    import rospkg
except ImportError:
    NOT_FOUND = (PackageNotFound,)
else:
    NOT_FOUND = (PackageNotFound, rospkg.ResourceNotFound)


class Packages(Protocol):
    """Folders of packages, as a ``rospkg.RosPack`` knows them."""

    def list(self) -> list[str]:
        """Names of the packages."""
        ...

    def get_path(self, name: str) -> str:
        """Folder of a package. Raises one of ``NOT_FOUND``."""
        ...


class LibraryPackages:
    """Asked as a ``rospkg.RosPack`` is. `folders`: {package: its folder}."""

    def __init__(self, folders: dict[str, Path]) -> None:
        self._found = {name: str(folder) for name, folder in folders.items()}

    def list(self) -> list[str]:
        """Names of the packages."""
        return list(self._found)

    def get_path(self, name: str) -> str:
        """Folder of a package. Raises PackageNotFound."""
        try:
            return self._found[name]
        except KeyError:
            raise PackageNotFound("no package '%s'; there are %s" % (name, ", ".join(sorted(self._found)))) from None


def find_packages() -> Packages:
    """Object that answers ``list()`` and ``get_path(name)``; names that it does not know raise one of ``NOT_FOUND``.

    Where pip has installed this library, its own packages, whatever ROS may be on this machine; in a workspace
    ``rospkg.RosPack``, or, without rospkg, the packages of the workspace.
    """
    here = Path(__file__).resolve()
    share = here.parents[1] / SHARE
    if share.is_dir():
        return LibraryPackages({folder.name: folder for folder in share.iterdir() if folder.is_dir()})
    if len(NOT_FOUND) > 1:
        return rospkg.RosPack()
    return LibraryPackages(_with_manifests(here.parents[4]))


def _with_manifests(folder: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for manifest in sorted(folder.glob("**/package.xml")):
        with contextlib.suppress(OSError, XmlRefused):
            root: Any = parse_xml(manifest.read_bytes())
            found.setdefault((root.findtext("name") or "").strip(), manifest.parent)
    return found
