# SPDX-License-Identifier: BSD-3-Clause
"""A share of one processor core for this process and everything it starts: a CPU quota by control group, v1 or v2.

Busy loops beside a program slow it less than expected: the scheduler prefers processes that sleep most of the time.
A quota does not. See https://docs.kernel.org/admin-guide/cgroup-v2.html and .../cgroup-v1/cpusets.html (cpu.cfs_*).
"""

import contextlib
import os
import time
from pathlib import Path

PERIOD_US = 50_000
# Time limit for the end of started processes [s].
REMOVAL_S = 10.0


class QuotaError(Exception):
    """A control group with a quota cannot be made here; the text says why."""


class ProcessorQuota:
    """Context manager: inside, this process and its children get ``percent`` of one core together."""

    def __init__(self, percent: float, mount: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")):
        """mount, own: path of the control groups, and file with this process's groups (cgroups(7)).

        Raises ValueError for a share that is not between 1 % and all of the machine's cores, QuotaError.
        """
        most = 100 * (os.cpu_count() or 1)
        if not 1 <= percent <= most:
            raise ValueError(f"the share is {percent:g} % of one core; it must be between 1 and {most} %")
        self._percent, self._mount, self._own = percent, mount, own
        self._groups = self._own_groups()
        # Inside: the new group, and the one before.
        self._group: Path
        self._before: Path

    def __enter__(self):
        problems = []
        for parent, files in self._candidates():
            group = parent / f"lab_quota.{os.getpid()}"
            try:
                group.mkdir()
            except OSError as error:
                problems.append(f"{group}: {error.strerror}")
                continue
            try:
                for name, text in files.items():
                    (group / name).write_text(text)
                (group / "cgroup.procs").write_text(str(os.getpid()))
            except OSError as error:
                problems.append(f"{group}: {error.strerror}")
                with contextlib.suppress(OSError):
                    group.rmdir()
                continue
            self._group, self._before = group, self._home(parent)
            return self
        nothing = f"there are no control groups with a cpu controller below {self._mount}"
        raise QuotaError("; ".join(problems) or nothing)

    def __exit__(self, *_):
        (self._before / "cgroup.procs").write_text(str(os.getpid()))
        deadline = time.monotonic() + REMOVAL_S
        while True:
            try:
                self._group.rmdir()
                return
            except OSError:
                if time.monotonic() > deadline:
                    return  # a process of it still runs; the group stays until the next boot
                time.sleep(0.1)

    def _candidates(self):
        """(folder for a new group, settings to write), the most likely first."""
        quota = round(PERIOD_US * self._percent / 100)
        for controllers, path in self._groups.items():
            if "cpu" in controllers.split(","):
                first = {"cpu.cfs_period_us": str(PERIOD_US), "cpu.cfs_quota_us": str(quota)}
                for name in (controllers, "cpu"):
                    for folder in dict.fromkeys((self._mount / name / path, self._mount / name)):
                        if (folder / "cpu.cfs_quota_us").exists() or (folder / "cgroup.procs").exists():
                            yield folder, first
        if "" not in self._groups or not (self._mount / "cgroup.controllers").is_file():
            return
        # Version 2: beside or above our own group, where a parent enables the cpu controller for its children.
        folder = self._mount / self._groups[""]
        for parent in (folder, *folder.parents):
            if not parent.is_relative_to(self._mount):
                return
            handed_on = parent / "cgroup.subtree_control"
            with contextlib.suppress(OSError):
                if parent == self._mount and "cpu" not in handed_on.read_text().split():
                    handed_on.write_text("+cpu")
                if "cpu" in handed_on.read_text().split():
                    yield parent, {"cpu.max": f"{quota} {PERIOD_US}"}

    def _home(self, parent: Path) -> Path:
        """This process's original group in the hierarchy of ``parent``."""
        relative = parent.relative_to(self._mount)
        for controllers, path in self._groups.items():
            if controllers and relative.parts and relative.parts[0] in (controllers, "cpu"):
                folder = self._mount / relative.parts[0] / path
                return folder if folder.is_dir() else parent
        folder = self._mount / self._groups.get("", "")
        return folder if folder.is_dir() else parent

    def _own_groups(self) -> dict[str, str]:
        """Controllers ("" in version 2) to the group that this process is in, without the leading slash."""
        try:
            rows = self._own.read_text().split()
        except OSError as error:
            raise QuotaError(f"{self._own}: {error.strerror}") from error
        found = {}
        for row in rows:
            _, controllers, path = row.split(":", 2)
            found[controllers] = path.lstrip("/")
        return found
