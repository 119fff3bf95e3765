# SPDX-License-Identifier: BSD-3-Clause
"""The first program of a lab, behind its walls: starts master, simulator and page, and forwards the front door's
connections to the page. Ends with any of them, and with the supervisor. No ROS here.
"""
from __future__ import annotations

import argparse
import asyncio
import contextlib
import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from processes.family import children_of, direct_children

_CHUNK = 65536
#: Time for a lab to end by itself after Ctrl-C [s].
END_S = 8.0
_LOOK_S = 0.1
_SET_CHILD_SUBREAPER = 36  # linux/prctl.h


def main() -> int:
    """Returns the exit code; the last line of the output says what ended."""
    parser = argparse.ArgumentParser(prog="lab_class.inside")
    for name in ("listener", "master", "page"):
        parser.add_argument("--" + name, type=int, required=True)
    parser.add_argument("--below", required=True)
    parser.add_argument("launch", nargs="+")
    options = parser.parse_args()
    # Orphans of the lab become children of this process, and end with it.
    ctypes.CDLL(None, use_errno=True).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: sys.exit(0))
    try:
        reason = asyncio.run(_run(options))
        print("the lab ended: %s" % reason, flush=True)
    finally:
        end_children()
    return 1


async def _run(options: argparse.Namespace) -> str:
    """The lab, until a part of it or the supervisor ends; returns which, as a text."""
    lab = await asyncio.create_subprocess_exec("roslaunch", "-p", str(options.master), *options.launch,
                                               stdin=subprocess.DEVNULL)
    listener = socket.socket(fileno=options.listener)
    listener.setblocking(False)
    forwarder = await asyncio.start_unix_server(lambda *streams: forward(streams, options.page), sock=listener)
    async with forwarder:
        ends = {asyncio.create_task(lab.wait()): "roslaunch %s" % " ".join(options.launch),
                asyncio.create_task(_page(options)): "its page", asyncio.create_task(_input_end()): "the supervisor"}
        done, others = await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        for task in others:
            task.cancel()
        first = done.pop()
        return "%s has ended (%s)" % (ends[first], first.result())


async def _page(options: argparse.Namespace):
    """The page, once there is a master."""
    while True:
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", options.master), 1.0).close()
            break
        await asyncio.sleep(_LOOK_S)
    page = await asyncio.create_subprocess_exec("rosrun", "lab_web", "lab_web", "--port", str(options.page),
                                                "--below", options.below, "--notebook-root", os.environ["HOME"],
                                                stdin=subprocess.DEVNULL)
    return await page.wait()


async def _input_end() -> str:
    """Until the standard input ends, which the supervisor holds open."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while await reader.read(_CHUNK):
        pass
    return "end of input"


async def forward(streams: Any, port: int) -> None:
    """One connection of the front door, (reader, writer), to a port of this lab; closed where nothing listens."""
    reader, writer = streams
    try:
        with contextlib.suppress(OSError):
            lab_reader, lab_writer = await asyncio.open_connection("127.0.0.1", port)
            try:
                await asyncio.gather(_copy(reader, lab_writer), _copy(lab_reader, writer))
            finally:
                lab_writer.close()
    finally:
        writer.close()


async def _copy(reader: Any, writer: Any) -> None:
    with contextlib.suppress(OSError):
        while chunk := await reader.read(_CHUNK):
            writer.write(chunk)
            await writer.drain()
    # The other side learns of the end; what comes from there goes on.
    with contextlib.suppress(OSError, RuntimeError):
        writer.write_eof()


def end_children() -> None:
    """End all descendants of this process: first as Ctrl-C does, then for good."""
    for pid in direct_children(os.getpid()):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGINT)
    deadline = time.monotonic() + END_S
    while _others() and time.monotonic() < deadline:
        time.sleep(_LOOK_S)
    while others := _others():
        for pid in others:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(_LOOK_S)


def _others():
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    return children_of([os.getpid()]) - {os.getpid()}


if __name__ == "__main__":
    sys.exit(main())
