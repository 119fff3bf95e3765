# SPDX-License-Identifier: BSD-3-Clause
"""The command that starts one lab: in a sandbox with a separate network, or, without walls, on free ports."""
from __future__ import annotations

import contextlib
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab_class.store import HOME
from lab_web.tokens import TOKEN, VIEW_TOKEN
from processes import isolation, ports, system_calls
from rf_checks import hidden_paths
from rf_checks.handout import STUBBED, emptied_notebook, stub
from world_picture.results import READY, cache_folder, ready_for

if TYPE_CHECKING:
    from lab_class.store import ClassOptions, Tokens

#: Ports inside of a lab's separate network, as on any lab's machine.
MASTER_PORT, PAGE_PORT = 11311, 8090
#: Size of /tmp and of /dev/shm in a lab [bytes]; both count towards its memory.
SCRATCH_BYTES = 512 << 20
#: Most processes and threads of a lab at a time.
TASKS = 4096
#: Paths below the workspace that no lab shows: the judge's solutions, the history, other people's notebooks and logs.
HIDDEN = (*hidden_paths.SOLVED, ".baxter/jupyter", ".baxter/logs", ".baxter/labs")


@dataclass(frozen=True)
class LabPlace:
    """Where a lab runs. ``folder``: of its files [Path]; ``state_folder``: of the class, which no lab shows;
    ``libraries``: of the page's libraries [Path]; ``walls``: in a sandbox."""

    folder: Path
    state_folder: Path
    libraries: Path
    walls: bool


def prepared(place: LabPlace, options: ClassOptions, tokens: Tokens, listener: int,
             refused: tuple[list[Any], tuple[Any, ...]]) -> tuple[list[str], dict[str, str], tuple[int]]:
    """(command, environment, descriptors to inherit) of one lab.

    options, tokens: store.ClassOptions, store.Tokens; listener: descriptor of the socket that the front door connects
    to; refused: what `system_calls.refused` yields. Raises isolation.NotIsolated, OSError without a free port.
    """
    if place.walls:
        home, master, page = isolation.HOME, MASTER_PORT, PAGE_PORT
    else:
        home, master, page = str(place.folder / HOME), ports.free_port(), ports.free_port()
    command = [sys.executable, "-P", "-m", "lab_class.inside", "--listener", str(listener), "--master", str(master),
               "--page", str(page), "--below", "%s/%s" % (options.prefix, place.folder.name), "--",
               *options.launch]
    limits = limited(options.disk_bytes, TASKS if place.walls else None)
    environment = {**isolation.environment_of(os.environ), TOKEN: tokens.act, VIEW_TOKEN: tokens.view,
                   "ROS_MASTER_URI": "http://localhost:%d" % master, "ROS_HOSTNAME": "localhost", "HOME": home,
                   "ROS_HOME": home + "/.ros", "ROS_LOG_DIR": home + "/.ros/log"}
    environment.pop("ROS_IP", None)
    if not place.walls:
        environment.update({name: os.environ[name] for name in ("USER", "LOGNAME", "TMPDIR") if name in os.environ},
                           XDG_CACHE_HOME=str(place.libraries.parent), **{READY: str(cache_folder(""))})
        environment.pop("XDG_RUNTIME_DIR", None)
        return [*limits, *command], environment, (listener,)
    environment[isolation.WALLED] = "1"
    options_of_calls, descriptors = refused
    ready, variables = ready_for(home)
    environment.update(variables)
    binds = [(place.folder / HOME, home, True), (place.libraries, home + "/.cache/lab_web", False),
             *ready, *isolation.caches(os.environ, place.folder / "caches"),
             *_without_solutions(os.environ, place.folder / "caches")]
    enter = isolation.command(os.environ, binds, (*HIDDEN, str(place.state_folder)), True, options_of_calls,
                              SCRATCH_BYTES)
    return [*enter, *limits, *command], environment, (listener, *descriptors)


def _without_solutions(environment: os._Environ, folder: Path) -> list[tuple[Path, Path, bool]]:
    """The labs' notebooks without solutions, and what stands for nodes that solve an exercise, as binds in their place.

    folder: of the copies, which exists."""
    binds = []
    for root in map(Path, isolation.workspaces(environment)):
        for source in _found(root, ("src/*/*/notebooks", "share/*/notebooks", "install/share/*/notebooks")):
            copy = folder / ("notebooks-%d" % len(binds))
            copy.mkdir(parents=True)
            for notebook in source.glob("*.ipynb"):
                text = emptied_notebook(notebook.read_text(encoding="utf-8"))
                (copy / notebook.name).write_text(text, encoding="utf-8")
            binds.append((copy, source, False))
        for name in STUBBED:
            file = Path(name).name
            for source in _found(root, (name, "lib/*/" + file, "install/lib/*/" + file)):
                copy = folder / ("node-%d" % len(binds))
                copy.write_text(stub(name), encoding="utf-8")
                copy.chmod(0o755)
                binds.append((copy, source, False))
    return binds


def _found(root: Path, patterns: tuple[str, str, str]) -> list[Path]:
    return sorted(path for pattern in patterns for path in root.glob(pattern))


def limited(file_bytes: int, tasks: int | None) -> list[str]:
    """The command prefix that limits the size of each file, and the number of processes and threads.

    ``tasks`` only in a sandbox (None: no limit): in its user namespace Linux counts them by themselves, since 5.14;
    elsewhere it counts all of the user's. They are not limited for root.
    """
    number = [] if tasks is None else ["--nproc=%d" % tasks]
    return ["prlimit", "--core=0", "--fsize=%d" % file_bytes, *number, "--"]


def refused(walls: Any) -> contextlib.AbstractContextManager[tuple[list[str], tuple[int, ...]]]:
    """The filter of system calls for one start; a context manager for `prepared`."""
    return system_calls.refused() if walls else contextlib.nullcontext(([], ()))
