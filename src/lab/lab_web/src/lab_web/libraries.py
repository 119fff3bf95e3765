# SPDX-License-Identifier: BSD-3-Clause
"""The JavaScript libraries of the page: npm's packages, pinned by package-lock.json, fetched once and kept. No ROS.

npm fetches them, since it knows the user's proxies and mirrors. A machine without it downloads the same archives from
the registry that the environment names.
"""
from __future__ import annotations

import base64
import contextlib
import fcntl
import hashlib
import io
import json
import os
import shutil
import subprocess
import tarfile
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

from disk_cache.files import cache_home

if TYPE_CHECKING:
    from collections.abc import Callable

_TIMEOUT_S = 300.0


class LibrariesError(Exception):
    """The libraries are not here and cannot be fetched; the text says why, and what helps."""


def kept_in() -> Path:
    """The folder of fetched libraries: ``$XDG_CACHE_HOME/lab_web``, by default ``~/.cache/lab_web``."""
    return cache_home() / "lab_web"


def fetched(page: str | Path, parent: str | Path | None = None, run: Callable[..., object] = subprocess.run,
            tell: Callable[[str], object] = print) -> Path:
    """The folder ``node_modules`` of what ``page``/package.json lists; fetched if this version is not in ``parent``.

    ``tell(text)`` is called before something is fetched, which takes a while. Raises LibrariesError without a network.
    """
    files = [Path(page) / "package.json", Path(page) / "package-lock.json"]
    parent = kept_in() if parent is None else Path(parent)
    version = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    folder = parent / version
    done = folder / "fetched"
    if done.exists():
        return folder / "node_modules"
    parent.mkdir(parents=True, exist_ok=True)
    with _locked(parent / "lock"):
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            for file in files:
                shutil.copy(file, folder)
            tell("Fetching the page's library three.js; this happens once.")
            if shutil.which("npm"):
                _install(folder, run)
            else:
                _download(folder)
            done.touch()
    return folder / "node_modules"


def _install(folder: Path, run: Callable[..., object]) -> None:
    try:
        run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=folder, check=True, capture_output=True,
            text=True, timeout=_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise LibrariesError("npm did not fetch the page's libraries within %g s; is there a network?"
                             % _TIMEOUT_S) from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout or "").strip().splitlines()[-1:] or ["no message"]
        raise LibrariesError("npm could not fetch the page's libraries; the first start needs a network: %s"
                             % last[0]) from None


def _download(folder: Path) -> None:
    """As ``npm ci`` for packages without scripts: fetch the archives that package-lock.json names, by their hashes."""
    registry = os.environ.get("NPM_CONFIG_REGISTRY", "").rstrip("/")
    if not registry:
        raise LibrariesError("the page's library three.js comes from npm, and this machine has no npm; fix: sudo apt "
                             "install npm; or set NPM_CONFIG_REGISTRY to the address of an npm registry")
    packages = json.loads((folder / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for path, entry in packages.items():
        if not path:  # the page itself
            continue
        name = path.rpartition("node_modules/")[2]
        address = "%s/%s/-/%s-%s.tgz" % (registry, name, name.rpartition("/")[2], entry["version"])
        try:
            with urllib.request.urlopen(address, timeout=_TIMEOUT_S) as answer:
                archive = answer.read()
        except (OSError, ValueError) as error:
            raise LibrariesError("%s cannot be fetched; the first start needs a network: %s"
                                 % (address, error)) from None
        algorithm, _, due = entry["integrity"].partition("-")
        if hashlib.new(algorithm, archive).digest() != base64.b64decode(due):
            raise LibrariesError("%s is not the file that the page was made with: its %s differs"
                                 % (address, algorithm))
        _unpack(archive, folder / path)


def _unpack(archive: bytes, target: Path) -> None:
    """Write the files of an archive below ``target``, without the archive's own first folder."""
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        for member in files:
            inside = Path(*Path(member.name).parts[1:])
            content = files.extractfile(member) if member.isfile() else None
            if content is not None and ".." not in inside.parts:
                file = target / inside
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content.read())


@contextlib.contextmanager
def _locked(path):
    with open(path, "w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
