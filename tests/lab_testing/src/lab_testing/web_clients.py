# SPDX-License-Identifier: BSD-3-Clause
"""Published web clients that tests drive, unmodified: pinned in tests/web_clients, installed by the first test that
needs them.
"""
import contextlib
import fcntl
import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

from lab_testing.waiting import stretched

ROOT = Path(__file__).resolve().parents[4]
PINS = ROOT / "tests" / "web_clients"
_TIMEOUT_S = 120.0


class NotThere(Exception):
    """The clients cannot be installed here; the text is a reason to skip a test."""


def of_npm():
    """The folder whose node_modules holds what package.json lists. Raises NotThere without node, npm or a network."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            raise NotThere("no %s" % program)
    files = [PINS / "package.json", PINS / "package-lock.json"]

    def install(folder):
        for file in files:
            shutil.copy(file, folder)
        _run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], folder)
    return _installed("npm", files, install)


def of_pip():
    """A folder for PYTHONPATH with what requirements.txt lists. Raises NotThere without a network."""
    pins = PINS / "requirements.txt"

    def install(folder):
        _run([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", folder, "-r", pins], folder)
    return _installed("pip", [pins], install)


def _run(command, folder):
    try:
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=stretched(_TIMEOUT_S))
    except subprocess.TimeoutExpired:
        raise NotThere("%s did not end within %g s" % (command[0], stretched(_TIMEOUT_S))) from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout).strip().splitlines()[-1:] or ["no message"]
        raise NotThere("%s failed: %s" % (Path(command[0]).name, last[0])) from None


def _installed(kind, files, install):
    """The folder of these pins; a folder that was not finished is made again."""
    pins = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    parent = ROOT / ".baxter" / "web_clients"
    parent.mkdir(parents=True, exist_ok=True)
    folder, done = parent / ("%s-%s" % (kind, pins)), parent / ("%s-%s.done" % (kind, pins))
    with _locked(parent / (kind + ".lock")):
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            install(folder)
            done.touch()
    return folder


@contextlib.contextmanager
def _locked(path):
    with open(path, "w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
