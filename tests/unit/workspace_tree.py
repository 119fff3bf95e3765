# SPDX-License-Identifier: BSD-3-Clause
"""The workspace's files and packages, for tests that read the tree."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def own_files():
    """The workspace's files, relative to it: what git tracks or would track. Links are left out."""
    command = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
    return sorted(name for name in listed if (ROOT / name).is_file() and not (ROOT / name).is_symlink())


def packages():
    """Package name to folder, relative to the workspace, of all packages below src."""
    return {Path(name).parent.name: Path(name).parent for name in own_files()
            if name.startswith("src/") and name.endswith("/package.xml")}


def is_in_tests(name):
    """Whether a file belongs to tests, which may contain invented files and numbers."""
    return name.startswith("tests/") or "/test/" in name


def is_python(name):
    """Whether a file of the workspace is Python: by its ending, or by the first line of one without."""
    path = ROOT / name
    if path.suffix in (".py", ".cfg"):
        return True
    return path.suffix == "" and path.open("rb").readline(100).startswith(b"#!/usr/bin/env python3")
