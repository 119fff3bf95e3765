# SPDX-License-Identifier: BSD-3-Clause
"""Where the compiled kernels are kept between runs."""
import hashlib
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

# Folders of other states of the sources that are left in place: a second checkout may use the same cache.
_KEPT = 3


def choose(environment=os.environ):
    """Make sure that numba finds a place to keep compiled code; call before numba is imported.

    numba looks in ``NUMBA_CACHE_DIR``, beside the source, then in the user's cache directory, and refuses to import a
    cached function when it can write to none of them (an installed package, a home directory that is not there). Only
    in that last case this sets ``NUMBA_CACHE_DIR``: to a directory of this user under the temporary directory.
    """
    if any(_writable(place) for place in _places(environment)):
        return
    environment["NUMBA_CACHE_DIR"] = _private_temporary_directory()
    if "numba" in sys.modules:
        sys.modules["numba"].config.reload_config()


def folder(name, sources, environment=os.environ):
    """Return the folder for what is compiled from ``sources``, paths of files; call :func:`choose` before.

    Its name holds what the files hold, so that a change of any of them leads to another, empty folder. Those of older
    states beside it are deleted but for the newest.
    """
    digest = hashlib.sha256()
    for source in sorted(map(Path, sources)):
        text = source.read_bytes()
        digest.update(b"%s %d\n" % (source.name.encode(), len(text)) + text)
    place = Path(next(filter(_writable, _places(environment))))
    path = place / ("%s-%s" % (name, digest.hexdigest()[:16]))
    if not path.is_dir():
        for old in sorted(place.glob(name + "-" + 16 * "[0-9a-f]"), key=_age)[_KEPT:]:
            shutil.rmtree(old, ignore_errors=True)
        path.mkdir(exist_ok=True)
    return str(path)


def _places(environment):
    """Where to look, the first that can be written counts."""
    beside_source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "__pycache__")
    per_user = os.path.join(environment.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "numba")
    return filter(None, (environment.get("NUMBA_CACHE_DIR"), beside_source, per_user))


def _age(path):
    """Sorts the newest first; what another process deletes meanwhile comes last."""
    try:
        return -path.stat().st_mtime
    except OSError:
        return 0.0


def _writable(directory):
    try:
        os.makedirs(directory, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def _private_temporary_directory():
    """A directory that only this user can write: what lies in it is executed."""
    path = os.path.join(tempfile.gettempdir(), "baxter_sim_kinematics-%d" % os.getuid())
    try:
        os.mkdir(path, 0o700)
    except FileExistsError:
        pass
    found = os.lstat(path)
    if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022:
        return path
    return tempfile.mkdtemp(prefix="baxter_sim_kinematics-")
