# SPDX-License-Identifier: BSD-3-Clause
"""Keeps code compiled by numba between runs. Free of ROS."""
from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from disk_cache.files import cache_home, spare_folder

#: Environment variable: a file to which the paths of the sources of compiled code are added, one a line.
SOURCES_VARIABLE = "LAB_COMPILED_SOURCES"
# Number of folders of other states of the sources that are kept: a second checkout may use the same cache.
_KEPT = 3


def compiler(name: str, sources: Iterable[str | Path], **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles functions with ``numba.njit(cache=True, **options)`` and keeps the result.

    name: first part of the folder's name, usually the package's name; sources: the files whose functions call each
    other. numba itself checks the function's own file for changes, but not the files of the functions that it calls;
    here a change in any of them leads to another folder. Raises ImportError if numba is missing.
    """
    import numba  # callers of folder() need no numba
    from numba.core import config as settings

    sources = list(sources)
    place = folder(name, sources)
    if listed := os.environ.get(SOURCES_VARIABLE):
        with open(listed, "a", encoding="utf-8") as file:  # one call of write: processes that run beside each other
            file.write("".join(f"{os.path.abspath(source)}\n" for source in sources))

    def compiled(function: Callable[..., Any]) -> Any:
        config: Any = settings  # its entries are made at run time
        before, config.CACHE_DIR = config.CACHE_DIR, place
        try:
            return _loaded_alone(numba.njit(cache=True, **options)(function))
        finally:
            config.CACHE_DIR = before

    return compiled


def _loaded_alone(function: Any) -> Any:
    """A compiled function, which comes from the cache without the compiler's tables.

    numba makes them, of all functions of Python and numpy that it knows, before it looks into the cache; for them it
    imports scipy.linalg. That takes two thirds of the time of loading and 25 MB; only what compiles needs them, and
    makes them itself. Where numba has changed inside, functions are loaded as it does.
    """
    cache: Any = getattr(function, "_cache", None)
    if not (hasattr(cache, "_load_overload") and hasattr(cache, "_guard_against_spurious_io_errors")):
        return function

    def load_overload(signature: Any, target: Any) -> Any:
        from numba.core.runtime.nrt import rtsys

        rtsys.initialize(target)  # what allocates the arrays of compiled code
        with cache._guard_against_spurious_io_errors(), _without_its_library():
            return cache._load_overload(signature, target)

    cache.load_overload = load_overload
    return function


@contextlib.contextmanager
def _without_its_library() -> Iterator[None]:
    """While functions are loaded: those of numba's own library that are a part of them do not import their modules.

    numba imports the module of each for its global names, which compiled code does not look at; with them come
    scipy.linalg and a good part of the tables. Its lock for compiling must be held.
    """
    from numba.core import environment as parts

    original = getattr(parts, "_rebuild_env", None)
    if original is None or not hasattr(parts, "lookup_environment") or not hasattr(
            getattr(parts, "Environment", None), "_memo"):
        yield  # numba has changed inside
        return

    def rebuilt(module: str, constants: list[Any], name: str) -> Any:
        if not module.startswith("numba.") or module in sys.modules or parts.lookup_environment(name) is not None:
            return original(module, constants, name)
        part: Any = parts.Environment({"__name__": module})
        part.consts[:], part.env_name = constants, name
        parts.Environment._memo[name] = part
        return part

    parts._rebuild_env = rebuilt
    try:
        yield
    finally:
        parts._rebuild_env = original


def folder(name: str, sources: Iterable[str | Path], environment: Mapping[str, str] = os.environ) -> str:
    """Return the folder for what is compiled from ``sources``, paths of files.

    It lies in the first of these that is writable: ``NUMBA_CACHE_DIR``, ``__pycache__`` beside the first source, the
    user's cache, a private folder in the temporary directory. Its name holds a hash of the files' content, so that a
    change in any of them leads to a new, empty folder. Older folders beside it are deleted, but for the newest ones.
    """
    paths = sorted(map(Path, sources))
    digest = hashlib.sha256()
    for source in paths:
        text = source.read_bytes()
        digest.update(b"%s %d\n" % (source.name.encode(), len(text)) + text)
    places = filter(_writable, _places(paths[0], environment))
    place = Path(next(places, None) or _private_temporary_directory(name))
    path = place / ("%s-%s" % (name, digest.hexdigest()[:16]))
    if not path.is_dir():
        for old in sorted(place.glob(name + "-" + 16 * "[0-9a-f]"), key=_age)[_KEPT:]:
            shutil.rmtree(old, ignore_errors=True)
        path.mkdir(exist_ok=True)
    return str(path)


def _places(source: Path, environment: Mapping[str, str]) -> Iterator[str]:
    beside_source = os.path.join(os.path.dirname(os.path.abspath(source)), "__pycache__")
    return filter(None, (environment.get("NUMBA_CACHE_DIR"), beside_source, str(cache_home(environment) / "numba")))


def _age(path: Path) -> float:
    """Sort key: newest first; a folder that another process has just deleted comes last."""
    try:
        return -path.stat().st_mtime
    except OSError:
        return 0.0


def _writable(directory: str) -> bool:
    try:
        os.makedirs(directory, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def _private_temporary_directory(name: str) -> str:
    """A directory that only this user can write: the files in it are executed."""
    try:
        return str(spare_folder(name))
    except OSError:
        return tempfile.mkdtemp(prefix="%s_" % name)
