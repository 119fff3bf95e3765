# SPDX-License-Identifier: BSD-3-Clause
"""Where the models are that ``model://NAME`` speaks of."""

import re
from pathlib import Path

from urdf_model import XmlRefused, bounds, parse_xml, read_file


class ModelFolders:
    """A path of folders, each with a folder per model; the first that has a model wins."""

    def __init__(self, folders):
        self.folders = [Path(folder) for folder in folders]

    def find(self, uri, base=None):
        """Return the description file (Path) that ``uri`` names, or None.

        ``uri``: model://NAME, model://NAME/FILE, file://PATH or a path, relative ones to the folder ``base``; a
        folder stands for the description in it.
        """
        scheme, separator, rest = uri.partition("://")
        if not separator:
            candidates = [Path(base or ".") / uri, *(folder / uri for folder in self.folders)]
        elif scheme == "model":
            candidates = [folder / rest for folder in self.folders]
        elif scheme == "file":
            candidates = [Path(rest)] if rest.startswith("/") else [folder / rest for folder in self.folders]
        else:
            candidates = []
        for path in candidates:
            if path.is_file():
                return path
            found = description_file(path)
            if found is not None:
                return found
        return None


def description_file(folder):
    """Return the SDF (Path) in a model's folder, or None.

    model.config names it, with several the one of the highest version; without model.config it is model.sdf.
    """
    folder = Path(folder)
    named = []
    try:
        manifest = parse_xml(read_file(folder / "model.config", bounds.DESCRIPTION_BYTES))
        for element in manifest.iterchildren("sdf"):
            version = tuple(int(word) for word in re.findall(r"\d+", element.get("version", "")))
            named.append((version, folder / (element.text or "").strip()))
    except (OSError, XmlRefused, AttributeError):  # the last for a file without an element
        named = []
    for _, path in [*sorted(named, reverse=True), ((), folder / "model.sdf")]:
        if path.is_file():
            return path
    return None
