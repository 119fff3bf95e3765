# SPDX-License-Identifier: BSD-3-Clause
"""Libraries that few need are installed from PyPI when one needs them for the first time."""
from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from .job import JobError


def ensure_installed(root: Path, module: str, requirements: Path, otherwise: str = "") -> None:
    """Make ``module`` importable here and in processes started from here. Raises JobError; ``otherwise`` says in it
    what works without.

    On first use everything of the file ``requirements`` is installed into a folder below root/.baxter: a separate one,
    so that the rest of the workspace does not see what the module brings along.
    """
    if importlib.util.find_spec(module) is not None:
        return
    folder = root / ".baxter" / module
    if not _is_complete(folder, requirements):
        _install(folder, module, requirements, otherwise)
    sys.path.append(str(folder))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(folder)]))
    importlib.invalidate_caches()


def _is_complete(folder: Path, requirements: Path) -> bool:
    """Whether all of the requirements, as they are now, are installed there."""
    kept = folder / requirements.name
    return kept.is_file() and kept.read_bytes() == requirements.read_bytes()


def _install(folder: Path, module: str, requirements: Path, otherwise: str) -> None:
    print("%s is installed from PyPI into %s: it is needed for the first time" % (module, folder), file=sys.stderr)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".%s-" % module, dir=folder.parent) as unfinished:
            new = Path(unfinished) / module
            done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(new),
                                   "-r", str(requirements)])
            if done.returncode != 0:
                raise JobError("pip could not install %s from %s (exit code %d)%s" % (
                    module, requirements, done.returncode, otherwise and "; " + otherwise))
            # Last of all: a folder with it is complete.
            shutil.copy(requirements, new)
            shutil.rmtree(folder, ignore_errors=True)
            new.rename(folder)
    except OSError as error:
        raise JobError("%s cannot be installed into %s: %s" % (module, folder, error)) from error
