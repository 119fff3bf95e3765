# SPDX-License-Identifier: BSD-3-Clause
"""Finds the files that URDF and world files name: package://, model://, file:// and plain paths."""
from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import yaml

from urdf_model import XmlRefused, parse_xml

from .packages import NOT_FOUND, Packages, find_packages


def model_folders(packages: Packages | None = None, environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Search path of ``model://NAME``: the user's folders first, ours last. ``packages``: RosPack."""
    packages = packages or find_packages()
    ours = Path(packages.get_path("model_files")) / "models"
    return [*_listed(environ, "GAZEBO_MODEL_PATH"), *exported_folders("gazebo_model_path", packages),
            Path.home() / ".gazebo" / "models", ours]


def resource_folders(packages: Packages | None = None, environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Search path of world files and ``file://media/...``, after the current folder: ``GAZEBO_RESOURCE_PATH``, then
    what packages export. ``packages``: RosPack."""
    return [*_listed(environ, "GAZEBO_RESOURCE_PATH"), *exported_folders("gazebo_media_path", packages)]


def plugin_tables(packages: Packages | None = None, environ: Mapping[str, str] = os.environ) -> list[Path]:
    """The files ``model_plugins.yaml`` in the folders of ``GAZEBO_PLUGIN_PATH`` and in those that packages export as
    ``plugin_path``, first the more important one. ``packages``: RosPack."""
    folders = [*_listed(environ, "GAZEBO_PLUGIN_PATH"), *exported_folders("plugin_path", packages)]
    return [path for path in (folder / "model_plugins.yaml" for folder in folders) if path.is_file()]


def model_sizes(packages: Packages) -> dict[str, dict[str, Any]]:
    """Shapes that replace models of Gazebo's library, in the form that :class:`sdf_model.ModelFolders` takes."""
    path = Path(packages.get_path("model_files")) / "config" / "model_sizes.yaml"
    sizes: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    return sizes


def exported_folders(attribute: str, packages: Packages | None = None) -> list[Path]:
    """The folders (Paths) that packages name in ``<export><gazebo_ros attribute="${prefix}/models:..."/></export>``.

    ``attribute``: gazebo_model_path, gazebo_media_path or plugin_path. An unreadable manifest is skipped.
    """
    packages = packages or find_packages()
    found = []
    for name in sorted(packages.list()):
        folder = Path(packages.get_path(name))
        try:
            text = (folder / "package.xml").read_bytes()
            # Most of the hundred packages export nothing, and parsing XML is slower than this search.
            if attribute.encode() not in text:
                continue
            root: Any = parse_xml(text)
            exports = root.findall("export/gazebo_ros")
        except (OSError, XmlRefused):
            continue
        for value in (element.get(attribute, "") for element in exports):
            found += [Path(part.replace("${prefix}", str(folder))) for part in value.split(":") if part]
    return found


def _listed(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(folder) for folder in environ.get(variable, "").split(":") if folder]


class ResourceFinder:
    """Turns resource names into paths. Callable; remembers what it found, so later calls cost a dictionary look-up."""

    def __init__(self, packages: Packages | None = None) -> None:
        """``packages``: a ``rospkg.RosPack`` that has crawled already, which saves a second crawl."""
        self._packages = packages or find_packages()
        self._model_folders = model_folders(self._packages)
        self._resource_folders = resource_folders(self._packages)
        self._found: dict[str, str | None] = {}
        self._may_look_again = True

    def __call__(self, name: str) -> str | None:
        """The path if it exists and is not a folder, else None. It need not be a regular file: the caller checks when
        it opens it."""
        if name not in self._found:
            self._found[name] = next((str(path) for path in self._candidates(name) if _is_there(path)), None)
        return self._found[name]

    def forget_missing(self) -> None:
        """Search again for names that were not found: files and packages appear while a user works on a lab."""
        self._found = {name: path for name, path in self._found.items() if path is not None}
        self._may_look_again = True

    def _candidates(self, name: str) -> Iterator[Path]:
        url = urlparse(name)
        if url.scheme == "package":
            package = self._package_folder(url.netloc)
            if package is not None:
                yield package / unquote(url.path).lstrip("/")
        elif url.scheme == "model":
            for folder in self._model_folders:
                yield folder / url.netloc / unquote(url.path).lstrip("/")
        elif url.scheme == "file":
            yield Path("/" + (url.netloc + unquote(url.path)).lstrip("/"))
            # Gazebo's own descriptions say file://media/...
            for folder in self._resource_folders if url.netloc else ():
                yield folder / (url.netloc + unquote(url.path))
        elif not url.scheme:
            yield Path(name)

    def _package_folder(self, name: str) -> Path | None:
        try:
            return Path(self._packages.get_path(name))
        except NOT_FOUND:
            if not self._may_look_again:
                return None
        # A RosPack caches its first crawl. A crawl is slow, so a missing package causes one, and not one per mesh.
        self._may_look_again = False
        self._packages = find_packages()
        return self._package_folder(name)


def _is_there(path: Path) -> bool:
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # a name that is too long, or holds a zero byte
        return False
