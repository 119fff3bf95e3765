# SPDX-License-Identifier: BSD-3-Clause
"""Where the compiled kernels are kept between runs."""
import os
import stat
import sys
import tempfile


def choose(environment=os.environ):
    """Make sure that numba finds a place to keep compiled code; call before numba is imported.

    numba looks in ``NUMBA_CACHE_DIR``, beside the source, then in the user's cache directory, and refuses to import a
    cached function when it can write to none of them (an installed package, a home directory that is not there). Only
    in that last case this sets ``NUMBA_CACHE_DIR``: to a directory of this user under the temporary directory.
    """
    if environment.get("NUMBA_CACHE_DIR"):
        return
    beside_source = os.path.join(os.path.dirname(os.path.abspath(__file__)), "__pycache__")
    per_user = os.path.join(environment.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "numba")
    if _writable(beside_source) or _writable(per_user):
        return
    environment["NUMBA_CACHE_DIR"] = _private_temporary_directory()
    if "numba" in sys.modules:
        sys.modules["numba"].config.reload_config()


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
