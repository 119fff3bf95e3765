# SPDX-License-Identifier: BSD-3-Clause
"""The process of a class: starts, pauses, wakes and ends the labs, and keeps the front door. An ordinary user's
program; no ROS here.
"""
from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import shutil
import signal
import socket
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tornado import netutil
from tornado.httpserver import HTTPServer

from lab_class import control_groups, front_door, launching, memory
from lab_class.disk import DiskQuota, remove
from lab_class.factors import Factors
from lab_class.lab_process import END_S, LabProcess
from lab_class.labs import Action, ClassError, ClassLabState, Labs
from lab_class.scratch import Scratch, too_many_sockets
from lab_class.settling import Settling, demand_s
from lab_class.store import HOME, RUNTIME, Store, StoreError
from lab_class.verdicts import Verdicts
from processes.isolation import NotIsolated
from web_bridge.serving import IDLE_S, LARGEST_BODY, LimitedServer

if TYPE_CHECKING:
    from lab_class.labs import ClassLab, Kind
    from lab_class.store import ClassRecord

_TICK_S, _SETTLING_S, _VERDICTS_S, _MEMORY_S = 0.2, 0.5, 2.0, 5.0
_PROBE = b"GET /?token=%s HTTP/1.0\r\nHost: localhost\r\n\r\n"
_PROBE_S = 5.0
# Of the processors, while a lab starts; 1 is a running lab's. With much less, a start on a busy machine would take too
# long.
_STARTING_SHARE = 0.5
_LAST_BYTES = 4000


class Supervisor:
    """One class. ``now``: a clock [s]."""

    def __init__(self, store: Store, record: ClassRecord, libraries: Path, page: Path,
                 now: Callable[[], float] = time.monotonic) -> None:
        """store, record: store.Store, store.ClassRecord; libraries: folder of the page's libraries, page: of the
        instructor's page [Path]."""
        self._store, self._record, self._libraries, self._now = store, record, libraries, now
        names = [student.name for student in record.students]
        options = record.options
        self.labs = Labs(names, options.at_once, options.idle_s, options.keep_running)
        self.door = front_door.FrontDoor(record, self)
        self._page = page
        self._processes, self._listeners, self._tasks, self._memory, self._groups = {}, {}, {}, {}, {}
        self._end = asyncio.Event()
        # Short: the address of a socket has 107 bytes at most.
        self._runtime = Path(tempfile.mkdtemp(prefix=RUNTIME))
        self._factors = Factors(self.socket_of, lambda name: self._record.tokens[name].view)
        self._verdicts = {name: Verdicts(store.lab(name), store.lab(name) / HOME) for name in names}
        self._quota, self._scratch = DiskQuota(options.disk_bytes, store.folder), Scratch()
        self._class_groups = control_groups.found(self._runtime.name, len(names))

    # For the front door.

    def socket_of(self, name: str) -> Path:
        """The socket on which a lab answers [Path]."""
        return self._runtime / name

    def request(self, name: str) -> ClassLab:
        """A client asks this lab for something: wake it. Returns its labs.ClassLab."""
        self._do(self.labs.request(name, self._now()))
        return self.labs[name]

    def is_awake(self, name: str) -> bool:
        return self.labs[name].state is ClassLabState.RUNNING

    def serving(self, name: str, kind: Kind, by: int) -> None:
        """The number of a lab's connections of one labs.Kind changes ``by`` 1 or -1."""
        self.labs.serving(name, kind, by, self._now())

    def change(self, name: str, verb: str) -> None:
        """Start, stop or pause one lab. Raises ClassError."""
        verbs = {"start": self.labs.start, "stop": self.labs.stop, "pause": self.labs.pause}
        if verb not in verbs:
            raise ClassError("%s is nothing that can be done with a lab; expected %s" % (verb, ", ".join(verbs)))
        self._do(verbs[verb](name, self._now()))

    def renew(self, name: str) -> None:
        """New tokens for a student, or for the instructor: the old ones open nothing any more.

        What they have opened in a lab ends, since the lab starts again. Raises ClassError, StoreError.
        """
        record = self._record.renewed(name)
        self._store.write(record)
        self._record = self.door.record = record
        if name in self.labs and self.labs[name].has_processes:
            self._do(self.labs.stop(name, self._now()))
            self._do(self.labs.start(name, self._now()))

    def overview(self) -> dict[str, Any]:
        """The class as plain data, with the addresses' tokens: for the instructor alone."""
        now = self._now()
        labs = []
        for student in self._record.students:
            lab, tokens = self.labs[student.name], self._record.tokens[student.name]
            labs.append({
                "name": lab.name, "full_name": student.full_name, "state": lab.state.value,
                "is_starting": lab.is_starting, "reason": lab.reason,
                "since_s": round(now - lab.since, 1), "unused_s": round(now - lab.used, 1) if lab.used else None,
                "pages": lab.pages, "factor": self._factors.of(lab.name) if lab.state is ClassLabState.RUNNING
                else None, "memory_bytes": self._memory.get(lab.name) if lab.has_processes else None,
                "disk_bytes": self._quota.used.get(lab.name), "token": tokens.act, "view_token": tokens.view,
                "verdicts": self._verdicts[lab.name].known})
        return {"labs": labs, "idle_s": self._record.options.idle_s, "limits": str(self._class_groups)}

    def end(self) -> None:
        """End the class; `run` returns when all is gone."""
        self._end.set()

    # The class.

    async def run(self) -> None:
        """Until `end`, or a signal. Raises StoreError where the port is taken."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.end)
        servers = []
        try:
            servers = self._open()
            for lab in self.labs:
                self._listen(lab.name)
                self._do(self.labs.start(lab.name, self._now()))
            watches = [asyncio.ensure_future(watch) for watch in (
                self._every(_TICK_S, self._tick), self._every(_MEMORY_S, self._look_at_memory),
                self._every(_TICK_S, self._look_at_disk), self._every(_TICK_S, self._look_at_scratch),
                self._every(_VERDICTS_S, self._look_at_verdicts))]
            await self._end.wait()
            for watch in watches:
                watch.cancel()
        finally:
            for server in servers:
                server.stop()
            await self._end_all()
            for server in servers:
                await server.close_all_connections()
            self._class_groups.remove()
            shutil.rmtree(self._runtime, ignore_errors=True)

    def _open(self):
        options = self._record.options
        try:
            door = netutil.bind_sockets(options.port, "" if options.public else "127.0.0.1")
        except OSError as error:
            raise StoreError("port %d cannot be opened (%s); --port names another one, and students' addresses have it"
                             % (options.port, error.strerror or error)) from error
        server = LimitedServer(front_door.application(self.door, self._page), idle_connection_timeout=IDLE_S,
                               body_timeout=IDLE_S, max_body_size=LARGEST_BODY)
        server.add_sockets(door)
        control = HTTPServer(front_door.control(self.door))
        path = self._runtime / "control"
        control.add_socket(netutil.bind_unix_socket(str(path), mode=0o600))
        self._store.write_running({"pid": os.getpid(), "port": door[0].getsockname()[1], "control": str(path),
                                   "runtime": str(self._runtime), "groups": self._class_groups.folders})
        return [server, control]

    def _listen(self, name: str) -> None:
        # The supervisor opens it and the lab inherits it, so no lab can put anything else into its place.
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(self.socket_of(name)))
        listener.listen(128)
        self._listeners[name] = listener

    @staticmethod
    async def _every(period_s: float, function: Callable[[], Any]) -> None:
        while True:
            try:
                await function()
            except Exception:
                # One lab, or what a student has put into its folder, must not end the watch of all.
                traceback.print_exc()
            await asyncio.sleep(period_s)

    async def _tick(self) -> None:
        for name, process in list(self._processes.items()):
            # A task of this lab that runs is ending these processes, or is about to start others.
            if process.has_ended and (name not in self._tasks or self._tasks[name].done()):
                if self._groups[name].has_run_out():
                    self._exceed_memory(name)
                else:
                    self._do(self.labs.ended(name, self._last_words(name), self._now()))
        short = memory.shortage(memory.available_bytes(), self._record.options.memory_bytes,
                                sum(lab.is_starting for lab in self.labs))
        self._do(self.labs.due(self._now(), short))

    def _do(self, actions: Any) -> None:
        for action, name in actions:
            process = self._processes.get(name)
            if action is Action.START:
                self._go(name, self._start(name))
            elif action is Action.END:
                self._go(name, self._finish(name))
            elif action is Action.KILL:
                # It takes no more of what it has taken too much of, and nobody waits for it to end by itself.
                if process is not None:
                    process.pause()
                self._go(name, self._finish(name, at_once=True))
            elif process is not None:
                process.pause() if action is Action.PAUSE else process.wake()

    def _go(self, name: str, coroutine: Any) -> None:
        """Run one after the other for each lab: a start waits for the end before it."""
        before = self._tasks.get(name)

        async def next_one() -> None:
            if before is not None:
                await asyncio.wait([before])
            await coroutine

        self._tasks[name] = asyncio.ensure_future(next_one())

    async def _start(self, name: str) -> None:
        if self.labs[name].state is not ClassLabState.STARTING:
            return
        try:
            place = launching.LabPlace(self._store.lab(name), self._store.folder, self._libraries,
                                       not self._record.options.trusted)
            with launching.refused(place.walls) as refused:
                started = await asyncio.get_running_loop().run_in_executor(
                    None, launching.prepared, place, self._record.options, self._record.tokens[name],
                    self._listeners[name].fileno(), refused)
                self._groups[name] = self._class_groups.lab(name, self._record.options.memory_bytes, launching.TASKS)
                # Those that run keep their pace meanwhile.
                self._groups[name].share_processors(_STARTING_SHARE)
                self._processes[name] = LabProcess(*started, place.folder / "output.txt", self._groups[name].entrances)
        except (NotIsolated, OSError) as error:
            self._do(self.labs.ended(name, str(error), self._now()))
            return
        asyncio.ensure_future(self._await_answer(name, self._processes[name]))

    async def _await_answer(self, name: str, process: Any) -> None:
        while self._processes.get(name) is process and self.labs[name].state is ClassLabState.STARTING:
            if await self._answers(name):
                self.labs.answered(name, self._now())
                self._factors.follow(name)
                await self._await_settled(name, process)
                return
            await asyncio.sleep(_TICK_S)

    async def _await_settled(self, name: str, process: Any) -> None:
        settling = Settling(self._now())
        while self._processes.get(name) is process and self.labs[name].is_starting:
            family = process.family()
            if settling.look(family, demand_s(family), self._factors.of(name) is not None, self._now()):
                self._groups[name].share_processors(1.0)
                self._do(self.labs.has_settled(name, self._now()))
                return
            await asyncio.sleep(_SETTLING_S)
        if self._processes.get(name) is process:
            self._groups[name].share_processors(1.0)

    async def _answers(self, name: str) -> bool:
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(_PROBE_S):
                reader, writer = await asyncio.open_unix_connection(str(self.socket_of(name)))
                try:
                    writer.write(_PROBE % self._record.tokens[name].view.encode())
                    return b" 200 " in await reader.readline()
                finally:
                    writer.close()
        return False

    async def _finish(self, name: str, at_once: bool = False) -> None:
        process = self._processes.get(name)
        if process is None:
            return
        self._factors.leave(name)
        if not at_once:
            process.ask_to_end()
            deadline = time.monotonic() + END_S
            while not process.has_ended and time.monotonic() < deadline:
                await asyncio.sleep(_TICK_S)
        await asyncio.get_running_loop().run_in_executor(None, process.kill)
        del self._processes[name]
        self._memory.pop(name, None)
        self._quota.ended(name)
        self._scratch.ended(name)
        await asyncio.get_running_loop().run_in_executor(None, self._groups.pop(name).remove)
        await asyncio.get_running_loop().run_in_executor(None, remove, self._store.lab(name) / "caches")

    async def _end_all(self) -> None:
        for lab in self.labs:
            self._do(self.labs.stop(lab.name, self._now()))
        if self._tasks:
            await asyncio.wait(self._tasks.values())
        # Labs that were being ended when a start failed.
        for process in self._processes.values():
            process.kill()
        for listener in self._listeners.values():
            listener.close()

    def _last_words(self, name: str):
        """The last line of a lab's output, which inside.py writes."""
        with contextlib.suppress(OSError):
            lines = [line for line in _end_of(self._store.lab(name) / "output.txt").splitlines() if line.strip()]
            if lines:
                return lines[-1].removeprefix("the lab ended: ")[:300]
        return "its processes ended"

    async def _look_at_memory(self) -> None:
        most = self._record.options.memory_bytes
        for name, process in list(self._processes.items()):
            group = self._groups.get(name)
            # Nothing changes while it is paused.
            if group is None or (self.labs[name].state is ClassLabState.PAUSED and name in self._memory):
                continue
            used = group.memory_bytes()
            if used is None:
                used, too_many = await asyncio.get_running_loop().run_in_executor(
                    None, self._without_group, name, process)
                self._exceed(name, too_many)
            self._memory[name] = used
            if used > most or group.has_run_out():
                self._exceed_memory(name)

    def _without_group(self, name: str, process: LabProcess) -> tuple[int, str]:
        """Usage that no control group counts: (memory [bytes], why the lab is to end for something else or "")."""
        return (process.memory_bytes(self._scratch.bytes(name, process.family)),
                too_many_sockets(process.family()))

    def _exceed_memory(self, name: str) -> None:
        self._exceed(name, "it used all of its memory, %.1f GB" % (self._record.options.memory_bytes / 2**30))

    def _exceed(self, name: str, why: str) -> None:
        if why and self.labs[name].has_processes:
            self._do(self.labs.exceeded(name, why, self._now()))

    async def _look_at_scratch(self) -> None:
        for name, process in list(self._processes.items()):
            if self.labs[name].state is not ClassLabState.PAUSED:
                self._exceed(name, self._scratch.exceeded(name, process.family))

    async def _look_at_verdicts(self) -> None:
        for name in self._processes:
            self._verdicts[name].look()

    async def _look_at_disk(self) -> None:
        start = self._now()
        if not self._quota.is_due(start):
            return
        for name, process in list(self._processes.items()):
            try:
                why = await asyncio.get_running_loop().run_in_executor(
                    None, self._quota.measured, name, self._store.lab(name), process.family())
            except OSError as error:
                # Files that cannot be measured could be of any size.
                why = "its files could not be measured: %s" % error
            self._exceed(name, why)
        self._quota.looked(start, self._now())


def _end_of(path: Path) -> str:
    """The last text of a file, which may be large."""
    with open(path, "rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(0, stream.tell() - _LAST_BYTES))
        return stream.read(_LAST_BYTES).decode(errors="replace")


def main() -> int:
    """Run the class of a folder until it is ended; returns the exit code."""
    parser = argparse.ArgumentParser(prog="lab_class.supervisor")
    parser.add_argument("folder")
    parser.add_argument("libraries", type=Path)
    parser.add_argument("page", type=Path)
    options = parser.parse_args()
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    store = Store(options.folder)
    try:
        with store.locked():
            record = store.read()
            if record is None:
                raise StoreError("%s has no class" % store.folder)
            try:
                asyncio.run(_run(store, record, options))
            finally:
                store.remove_run()
    except (StoreError, OSError) as error:
        print("labs: %s" % error, flush=True)
        return 2
    return 0


async def _run(store: Store, record: ClassRecord, options: argparse.Namespace) -> None:
    await Supervisor(store, record, options.libraries, options.page).run()


if __name__ == "__main__":
    sys.exit(main())
