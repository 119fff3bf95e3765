# SPDX-License-Identifier: BSD-3-Clause
"""The space of the labs' files on the disk, and the lab that must end for it. No file system's quotas are required.

A program fills gigabytes in seconds, so the free space of the disk is asked for several times a second, which costs
nothing, and the labs' files are measured whenever it falls. Free of ROS; Linux only.
"""
from __future__ import annotations

import os
import stat
import subprocess
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

# Of a file or folder without content, on ext4.
_INODE_BYTES = 256
# What du says of a folder that it may not read, in the C locale.
_LOCKED = b"Permission denied"
#: The files are measured at least this often [s].
PERIOD_S = 30.0
# The part of a lab's limit by which the free space falls before the files are measured, and by which a lab that the
# instructor has started with too many files may exceed what it had.
_STEP = 1.0 / 16.0
#: Below this number of limits the free space is nearly used up.
RESERVE = 2
#: Most files and folders of a student. A disk has a number of them that no file's size shows, on ext4 by default one
#: for each 16 kB.
ENTRIES = 200_000


class _Limit:
    """Of one quantity of each lab. A lab that was ended for what stays may have it at its next start."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._allowed = {}

    def is_exceeded(self, name: str, used: int, stays: int) -> bool:
        """used: what the lab has; stays: the part of it that does not go with its processes."""
        if used <= self.most:
            self._allowed.pop(name, None)
        if used <= self._allowed.get(name, self.most):
            return False
        self._allowed[name] = max(self.most, stays + self.most * _STEP)
        return True


class DiskQuota:
    """The limits of each lab's files. ``limit_bytes``; ``folder``: one on the disk of the labs' files [Path];
    ``entries``: of files and folders."""

    def __init__(self, limit_bytes: int, folder: Path, entries: int = ENTRIES) -> None:
        self._bytes, self._entries, self._folder = _Limit(limit_bytes), _Limit(entries), folder
        #: What the files of each lab that was measured occupy {name: bytes}.
        self.used = {}
        self._written = {}
        self._free, self._due, self._took = None, 0.0, 0.0

    def is_due(self, now: float) -> bool:
        """Whether the files are to be measured: their time has come, or the disk has filled since."""
        if now >= self._due or self._free is None:
            return True
        # As long as measuring takes on a disk that somebody else fills, half of the time goes to other things.
        return now >= self._due - PERIOD_S + self._took and any(
            before - free > limit.most * _STEP
            for before, free, limit in zip(self._free, self._space(), (self._bytes, self._entries), strict=True))

    def looked(self, start: float, now: float) -> None:
        """The files of all labs have been measured, from the time ``start`` to ``now`` [s]."""
        self._due, self._took = now + PERIOD_S, now - start
        self._free = self._space()

    def _space(self) -> tuple[int, int]:
        found = os.statvfs(self._folder)
        return found.f_bavail * found.f_frsize, found.f_favail

    def measured(self, name: str, folder: Path, pids: Any) -> str:
        """Measure one lab; why it is to end, or "".

        folder: of its files; pids: its processes. Its files are those in the folder, and those that its processes hold
        open after they have removed them. A lab that was ended for files in the folder may have these at its next
        start, so that its student can delete some. Raises OSError if they cannot be measured.
        """
        named, entries = occupied(folder)
        used = self.used[name] = named + nameless_bytes(pids, os.stat(folder).st_dev)
        written, before = written_bytes(pids), self._written.get(name, 0)
        self._written[name] = written
        if self._bytes.is_exceeded(name, used, named):
            return ("its files have %.2f GB, and may have %.2f GB. Some of them must be deleted once it runs again"
                    % (used / 2**30, self._bytes.most / 2**30))
        if self._entries.is_exceeded(name, entries, entries):
            return ("it has %d files and folders, and may have %d. Some of them must be deleted once it runs again"
                    % (entries, self._entries.most))
        # Removed files can be open without a descriptor, by a map of memory alone; what was written shows them.
        free, limit = room(self._folder), self._bytes.most
        if free < RESERVE * limit and written - before > limit * _STEP and written > limit:
            return "the disk is nearly full (%.2f GB are free), and this lab has written %.2f GB" % (
                free / 2**30, written / 2**30)
        return ""

    def ended(self, name: str) -> None:
        """Its processes have ended; its files stay."""
        self._written.pop(name, None)


def room(folder: Path) -> int:
    """Free space of a folder's disk for this user [bytes]."""
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize


def entries_left(folder: Path) -> int | None:
    """How many files and folders a folder's disk has room for; None where it has no fixed number."""
    found = os.statvfs(folder)
    return found.f_favail if found.f_files else None


def nameless_bytes(pids: Sequence[int] | set[Any], device: int) -> int:
    """Space of removed files that are still open in one of these processes, on a disk (st_dev) [bytes]."""
    found = {}
    for pid in pids:
        folder = "/proc/%d/fd" % pid
        try:
            names = os.listdir(folder)
        except OSError:
            continue  # it has ended
        for name in names:
            try:
                one = os.stat(folder + "/" + name)
            except OSError:
                continue
            if one.st_nlink == 0 and one.st_dev == device and stat.S_ISREG(one.st_mode):
                found[one.st_ino] = 512 * one.st_blocks
    return sum(found.values())


def written_bytes(pids: set[Any] | tuple[Any, ...]) -> int:
    """Bytes that these processes, and children of theirs that have ended, have written to disks (proc_pid_io(5))."""
    total = 0
    for pid in pids:
        try:
            with open("/proc/%d/io" % pid, encoding="ascii") as stream:
                rows = dict(line.split(": ") for line in stream)
        except OSError:
            continue
        total += int(rows["write_bytes"]) - int(rows["cancelled_write_bytes"])
    return total


def occupied(folder: Path) -> tuple[int, int]:
    """(bytes, number) of the files and folders below a folder, empty ones too; links are followed nowhere.

    A folder that its student has locked is unlocked. Raises OSError if it cannot be found out.
    """
    entries = _total("--inodes", folder)
    return _total("--block-size=1", folder) + _INODE_BYTES * entries, entries


def _total(unit: str, folder: Path) -> int:
    done = _summary(unit, folder)
    if _LOCKED in done.stderr:
        _unlock(folder)
        done = _summary(unit, folder)
    try:
        # It fails where a file goes away meanwhile, and counts the others.
        total = int(done.stdout.split(None, 1)[0])
    except (IndexError, ValueError):
        total = None
    if total is None or _LOCKED in done.stderr:
        raise OSError("du cannot read %s: %s" % (folder, done.stderr.decode(errors="replace").strip()[-200:]))
    return total


def _summary(unit: str, folder: Path) -> subprocess.CompletedProcess:
    # du goes into folders of any depth; os.walk ends at the longest path, or with the deepest recursion.
    return subprocess.run(["du", "--summarize", "--one-file-system", unit, "--", str(folder)], capture_output=True,
                          check=False, env={**os.environ, "LC_ALL": "C"})


def _unlock(folder: Path) -> None:
    # It follows no link that it meets on its way.
    subprocess.run(["chmod", "--recursive", "--silent", "u+rwX", "--", str(folder)], check=False)


def remove(folder: Path) -> None:
    """Remove a folder that a student could write to and lock, of any depth."""
    for _ in range(2):
        subprocess.run(["rm", "--recursive", "--force", "--one-file-system", "--", str(folder)],
                       stderr=subprocess.DEVNULL, check=False)
        if not os.path.lexists(folder):
            return
        _unlock(folder)
