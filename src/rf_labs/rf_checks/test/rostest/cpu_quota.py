# SPDX-License-Identifier: BSD-3-Clause
"""A slow machine for tests: a share of one processor for this process and all that it starts (control groups)."""
import contextlib
import os
from pathlib import Path

from lab_testing.waiting import wait_until

_CGROUPS = Path("/sys/fs/cgroup")
_PERIOD_US = 50000


class QuotaUnavailable(Exception):
    """This machine lets nobody make control groups with a quota; the text says what failed."""


@contextlib.contextmanager
def cpu_quota(percent):
    """Within it this process and its children have `percent` of one processor. Raises QuotaUnavailable.

    Children that are left by then stay in the group, and the wait for their end fails.
    """
    is_v2 = (_CGROUPS / "cgroup.controllers").exists()
    root = _CGROUPS if is_v2 else _CGROUPS / "cpu"
    group, home = root / ("rf-checks-%d" % os.getpid()), _own_group(root, is_v2)
    try:
        group.mkdir()
    except OSError as error:
        raise QuotaUnavailable("no control group can be made: %s" % error) from error
    try:
        quota_us = _PERIOD_US * percent // 100
        settings = ({"cpu.max": "%d %d" % (quota_us, _PERIOD_US)} if is_v2 else
                    {"cpu.cfs_period_us": _PERIOD_US, "cpu.cfs_quota_us": quota_us})
        try:
            for name, value in settings.items():
                (group / name).write_text(str(value))
            (group / "cgroup.procs").write_text(str(os.getpid()))
        except OSError as error:
            raise QuotaUnavailable("a control group takes no quota: %s" % error) from error
        try:
            yield
        finally:
            (home / "cgroup.procs").write_text(str(os.getpid()))
    finally:
        wait_until(lambda: _is_removed(group), "the processes of the slow group to end")


def _own_group(root, is_v2):
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if (is_v2 and not controllers) or "cpu" in controllers.split(","):
            return root / path.lstrip("/")
    raise QuotaUnavailable("/proc/self/cgroup does not tell the group of this process")


def _is_removed(group):
    with contextlib.suppress(OSError):
        group.rmdir()
    return not group.exists()
