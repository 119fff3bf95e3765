# SPDX-License-Identifier: BSD-3-Clause
"""Control groups of a class, versions 1 and 2: processors in equal shares, and limits of memory and processes that
Linux itself keeps. They are made below this process's own groups, where this user may; no controller is required.

Sources: https://docs.kernel.org/admin-guide/cgroup-v2.html, .../cgroup-v1/memory.html and .../cgroup-v1/cgroups.html
"""
from __future__ import annotations

import contextlib
import errno
import getpass
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Where control groups are mounted, and the file with the groups of this process (cgroups(7)).
MOUNT, OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
#: Its files name the users whose systemd runs without a session (loginctl enable-linger).
LINGER = Path("/var/lib/systemd/linger")
CONTROLLERS = ("cpu", "memory", "pids")
#: The front door's weight at the processors, in labs.
DOOR_WEIGHT = 10
#: Version 1 counts buffers of network sockets beside the memory, and only where they have a limit. Beyond it, Linux
#: gives each socket little, but something, so thousands of them may hold more [bytes].
SOCKET_BYTES = 128 << 20
_SOCKETS_USED = "memory.kmem.tcp.usage_in_bytes"
#: Time for a group's last process to go [s].
REMOVAL_S = 5.0
# By version: the file, and the weight of a lab, which is the kernel's default; the largest weight.
_LAB_WEIGHTS = {1: ("cpu.shares", 1024), 2: ("cpu.weight", 100)}
_MAX_WEIGHT = {1: 262144, 2: 10000}
_DOOR = "front-door"
_PROBE_S = 10.0


@dataclass(frozen=True)
class _Home:
    """Where groups are made: a folder for the groups of one class.

    ``controllers``: those that it has; ``version``; ``is_own``: the folder is this process's own group, version 2."""

    folder: Path
    controllers: tuple
    version: int
    is_own: bool = False


class LabGroup:
    """The groups of one lab: a folder in each _Home."""

    def __init__(self, folders: list[tuple[_Home, Path]]) -> None:
        """folders: [(_Home, Path)]."""
        self._folders = folders
        self._kills_before = self._kills()

    @property
    def entrances(self) -> list[Path]:
        """Files to which a process writes 0 to enter [Path]."""
        return [folder / "cgroup.procs" for _, folder in self._folders]

    def _of(self, controller: str) -> tuple[int, Path | None]:
        return next(((home.version, folder) for home, folder in self._folders if controller in home.controllers),
                    (0, None))

    def share_processors(self, share: float) -> None:
        """Its part of the processors while there is more work than they can do; 1.0 is that of any lab."""
        version, folder = self._of("cpu")
        if folder is not None:
            file, weight = _LAB_WEIGHTS[version]
            # A lab that is being ended may have no group any more.
            with contextlib.suppress(OSError):
                _write(folder / file, round(share * weight))

    def memory_bytes(self) -> int | None:
        """Memory that its processes have written to, files in memory and buffers of network sockets included; None
        without the controller."""
        version, folder = self._of("memory")
        if folder is None:
            return None
        names = ("total_rss", "total_shmem") if version == 1 else ("anon", "shmem", "sock")
        sockets = sum(map(int, _words(folder / _SOCKETS_USED)))  # of version 1
        return sockets + sum(int(value) for name, _, value in _rows(folder / "memory.stat") if name in names)

    def has_run_out(self) -> bool:
        """Whether Linux has ended a process of it that had no memory left within the limit."""
        return self._kills() > self._kills_before

    def _kills(self) -> int:
        version, folder = self._of("memory")
        if folder is None:
            return 0
        name = "memory.oom_control" if version == 1 else "memory.events"
        return sum(int(value) for row, _, value in _rows(folder / name) if row == "oom_kill")

    def remove(self) -> None:
        """Remove it, once its processes have gone; they are expected to go at once."""
        for _, folder in self._folders:
            _remove(folder)


class ControlGroups:
    """Those of one class. `found` makes them."""

    def __init__(self, homes: list[_Home], problems: list[str]) -> None:
        self._homes, self._problems = homes, problems

    @property
    def controllers(self) -> tuple[str, ...]:
        """The controllers that this class has, of CONTROLLERS."""
        return tuple(name for name in CONTROLLERS if any(name in home.controllers for home in self._homes))

    @property
    def folders(self) -> list[str]:
        """The folders to be removed by `removed`, also by another process later [str]."""
        return [str(home.folder) for home in self._homes if not home.is_own]

    def __str__(self) -> str:
        if len(self.controllers) == len(CONTROLLERS):
            return "control groups limit each lab's memory and processes, and share the processors out equally"
        what = "control groups for " + ", ".join(self.controllers) if self.controllers else "no control groups"
        return "%s (%s); the supervisor looks at each lab's memory" % (what, "; ".join(self._problems))

    def lab(self, name: str, memory_bytes: int, tasks: int) -> LabGroup:
        """A LabGroup with its limits. Raises OSError."""
        made = []
        for home in self._homes:
            folder = home.folder / name
            with contextlib.suppress(FileExistsError):
                folder.mkdir()
            made.append((home, folder))
            for file, value in _limits(home, memory_bytes, tasks):
                # Swap and sockets are not counted on every machine.
                optional = "sw" in file or "tcp" in file
                with contextlib.suppress(FileNotFoundError) if optional else contextlib.nullcontext():
                    _write(folder / file, value)
        return LabGroup(made)

    def remove(self) -> None:
        """Remove all groups of the class."""
        for home in self._homes:
            if home.is_own:
                continue
            _leave(home)
            remove_left_over(home.folder)


def found(name: str, labs: int, mount: Path = MOUNT, own: Path = OWN) -> ControlGroups:
    """The ControlGroups of a class: folders ``name`` below this process's groups, with weights for ``labs`` labs.

    This process moves to a group beside the labs'. Without groups that this user may make, it has no controllers.
    """
    homes, problems = [], []
    with contextlib.suppress(OSError, ValueError):
        groups = dict(row.split(":", 2)[1:] for row in own.read_text(encoding="ascii").splitlines())
        for controller in CONTROLLERS:
            home = _first_version_home(controller, groups, mount, name, problems)
            if home is not None:
                homes.append(home)
        if "" in groups and (mount / "cgroup.controllers").is_file():
            home = _second_version_home(mount / groups[""].lstrip("/"), mount, name, problems)
            if home is not None:
                homes.append(home)
    for home in homes:
        _weigh(home, labs, problems)
    return ControlGroups(homes, problems or ["none are mounted at %s" % mount])


def way_in(user: str | None = None, mount: Path = MOUNT) -> list[str]:
    """The command prefix that starts a program in a separate control group of systemd, which it may divide; [] where
    there is none, or where it would end with the last session of this user.

    user: its name; by default that of this process. See systemd-run(1), loginctl(1).
    """
    if not (mount / "cgroup.controllers").is_file() or shutil.which("systemd-run") is None:
        return []
    if os.geteuid() == 0:
        scope = ["systemd-run"]
    elif (LINGER / (user or getpass.getuser())).exists():
        # Where cron starts it, nothing else says so.
        scope = ["env", "XDG_RUNTIME_DIR=/run/user/%d" % os.geteuid(), "systemd-run", "--user"]
    else:
        return []
    scope += ["--scope", "--quiet", "--collect", "--property=Delegate=yes", "--"]
    with contextlib.suppress(OSError, subprocess.TimeoutExpired):
        probe = subprocess.run([*scope, "true"], stdin=subprocess.DEVNULL, capture_output=True, timeout=_PROBE_S)
        return scope if probe.returncode == 0 else []
    return []


def remove_left_over(folder: Path | str) -> None:
    """Remove a class's folder of groups, of which all processes have ended."""
    folder = Path(folder)
    for below in [*(path for path in folder.glob("*") if path.is_dir()), folder]:
        if (below / "cgroup.procs").exists():
            _remove(below)


def _first_version_home(controller: str, groups: dict[str, str], mount: Path, name: str,
                        problems: list[str]) -> _Home | None:
    for row, path in groups.items():
        if controller not in row.split(","):
            continue
        for top in dict.fromkeys((mount / row, mount / controller)):
            for parent in dict.fromkeys((top / path.lstrip("/"), top)):
                if not (parent / "cgroup.procs").exists():
                    continue
                try:
                    (parent / name).mkdir()
                    return _Home(parent / name, (controller,), 1)
                except OSError as error:
                    problems.append("%s: %s" % (parent, error.strerror))
    return None


def _second_version_home(own: Path, mount: Path, name: str, problems: list[Any]) -> _Home | None:
    """In this process's group, if nobody else is in it; else in one above it that hands controllers on."""
    try:
        alone = (own / "cgroup.procs").read_text(encoding="ascii").split() == [str(os.getpid())]
        if alone and own != mount:
            (own / _DOOR).mkdir(exist_ok=True)
            _write(own / _DOOR / "cgroup.procs", os.getpid())
            return _Home(own, _hand_on(own), 2, True)
    except OSError as error:
        problems.append("%s: %s" % (own, error.strerror))
    for parent in own.parents:
        if not parent.is_relative_to(mount):
            break
        with contextlib.suppress(OSError):
            if parent == mount:
                _hand_on(parent)
            if not {"cpu", "memory"} <= set(_words(parent / "cgroup.subtree_control")):
                continue
            (parent / name).mkdir()
            return _Home(parent / name, _hand_on(parent / name), 2)
    problems.append("%s is not this user's" % own)
    return None


def _hand_on(folder: Path) -> tuple[str, ...]:
    """Let a group's children have its controllers; returns those that they have."""
    for controller in CONTROLLERS:
        with contextlib.suppress(OSError):
            _write(folder / "cgroup.subtree_control", "+" + controller)
    return tuple(name for name in CONTROLLERS if name in _words(folder / "cgroup.subtree_control"))


def _weigh(home: _Home, labs: int, problems: list[Any]) -> None:
    """The class weighs as much as its labs do together, and the front door DOOR_WEIGHT labs."""
    if "cpu" not in home.controllers:
        return
    (file, lab), most = _LAB_WEIGHTS[home.version], _MAX_WEIGHT[home.version]
    try:
        (home.folder / _DOOR).mkdir(exist_ok=True)
        _write(home.folder / _DOOR / file, min(most, DOOR_WEIGHT * lab))
        if not home.is_own:
            _write(home.folder / file, min(most, (labs + DOOR_WEIGHT) * lab))
            _write(home.folder / _DOOR / "cgroup.procs", os.getpid())
    except OSError as error:
        problems.append("%s: %s" % (home.folder, error.strerror))


def _limits(home: _Home, memory_bytes: int, tasks: int) -> Iterator[tuple[str, int]]:
    if "memory" in home.controllers:
        if home.version == 1:
            yield from (("memory.limit_in_bytes", memory_bytes), ("memory.memsw.limit_in_bytes", memory_bytes),
                        ("memory.kmem.tcp.limit_in_bytes", min(SOCKET_BYTES, memory_bytes)))
        else:
            yield from (("memory.max", memory_bytes), ("memory.swap.max", 0), ("memory.oom.group", 1))
    if "pids" in home.controllers:
        yield "pids.max", tasks


def _leave(home: _Home) -> None:
    """Back to the group above, so that the front door's can be removed."""
    with contextlib.suppress(OSError):
        if str(os.getpid()) in _words(home.folder / _DOOR / "cgroup.procs"):
            _write(home.folder.parent / "cgroup.procs", os.getpid())


def _remove(folder: Path) -> None:
    deadline = time.monotonic() + REMOVAL_S
    while not _removed(folder) and time.monotonic() < deadline:
        time.sleep(0.05)


def _removed(folder: Path) -> bool:
    try:
        folder.rmdir()
    except FileNotFoundError:
        return True
    except OSError as error:
        return error.errno not in (errno.EBUSY, errno.ENOTEMPTY)
    return True


def _rows(path: Path) -> list[tuple[str, str, str]]:
    with contextlib.suppress(OSError):
        return [line.partition(" ") for line in path.read_text(encoding="ascii").splitlines()]
    return []


def _words(path: Path) -> list[str]:
    with contextlib.suppress(OSError):
        return path.read_text(encoding="ascii").split()
    return []


def _write(path: Path, value: Any) -> None:
    with open(path, "r+", encoding="ascii") as stream:
        stream.write(str(value))
