# SPDX-License-Identifier: BSD-3-Clause
"""The processes of one lab, seen from outside of its walls: started, paused, woken, measured, ended."""
from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from processes.family import children_of, is_running

#: Time for a lab to end by itself [s]; a little more than inside.END_S.
END_S = 12.0
_ROUNDS = 50
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
#: How low the priority of a lab's processes is, where no control group divides the processors.
NICENESS = 1


class LabProcess:
    """Runs from the constructor on. The supervisor is its parent, and must start it in its main thread: bubblewrap ends
    with the thread that has started it."""

    def __init__(self, command: list[str], environment: dict[str, str], descriptors: Sequence[int], output: Path,
                 groups: Sequence[str] = ()) -> None:
        """output: file of all that it writes [Path]; groups: files cgroup.procs that it enters. Raises OSError."""
        enter = ["sh", "-c", 'while [ "$1" != -- ]; do echo 0 >"$1"; shift; done; shift; exec "$@"', "lab",
                 *map(str, groups), "--", "nice", "-n", str(0 if groups else NICENESS), *command]
        with open(output, "wb") as stream:
            self._process = subprocess.Popen(enter, env=environment, stdin=subprocess.PIPE, stdout=stream,
                                             stderr=subprocess.STDOUT, pass_fds=descriptors, start_new_session=True,
                                             cwd="/")

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def family(self) -> set[Any] | set[int]:
        """The process ids of the lab; orphans stay below it."""
        return set() if self.has_ended else children_of([self.pid])

    def pause(self) -> None:
        """Stop all processes where they are; they use no processor until `wake`.

        The first one goes on: it waits, and without walls it ends the others where the supervisor is killed meanwhile.
        """
        stopped = {self.pid}
        # A process may start another one before it is stopped.
        for _ in range(_ROUNDS):
            new = self.family() - stopped
            if not new:
                return
            for pid in new:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGSTOP)
            stopped |= new

    def wake(self) -> None:
        """Let all processes go on."""
        for pid in self.family():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    def _close_input(self) -> None:
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def ask_to_end(self) -> None:
        """Its first program ends the others and itself."""
        self.wake()
        self._close_input()

    def kill(self) -> None:
        """End all of its processes for good, and wait for that."""
        for _ in range(_ROUNDS):
            family = {pid for pid in self.family() if is_running(pid)}
            for pid in family:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            if not family:
                break
            time.sleep(0.01)
        self._close_input()
        self._process.wait()

    def memory_bytes(self, files_bytes: int = 0) -> int:
        """Memory of all processes, shared pages divided among their users; files_bytes: of files in memory, which
        processes may have mapped."""
        shares = [_share_of_memory(pid) for pid in self.family()]
        return sum(own for own, _ in shares) + max(files_bytes, sum(shared for _, shared in shares))


def _share_of_memory(pid: int):
    """(own, of files in memory) [bytes]."""
    with contextlib.suppress(OSError, KeyError):
        rows = dict(line.split(":") for line in
                    Path("/proc/%d/smaps_rollup" % pid).read_text(encoding="ascii").splitlines()[1:])
        share, in_files = (int(rows[name].split()[0]) << 10 for name in ("Pss", "Pss_Shmem"))
        return share - in_files, in_files
    # Of a process in a user namespace that this user may not look into.
    with contextlib.suppress(OSError, IndexError, ValueError):
        words = Path("/proc/%d/statm" % pid).read_text(encoding="ascii").split()
        return (int(words[1]) - int(words[2])) * _PAGE_BYTES, 0
    return 0, 0
