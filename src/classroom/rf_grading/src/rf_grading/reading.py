# SPDX-License-Identifier: BSD-3-Clause
"""Reads what students sent in separate processes with limits of processor time and memory. Free of ROS.

Python's own parser takes minutes, gigabytes, or ends the process, for some texts of a few hundred kilobytes, such as
one string with a hundred thousand replacement fields; so do readers of archives. The process that grades a class must
survive them all.
"""
from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rf_checks import diagnosis, similarity
from rf_checks.submission import decoded
from rf_grading import alike, programs

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise

#: Processor time for all programs of a submission [s]; a megabyte of ordinary code takes half of it.
CPU_S = 30
#: Memory beside that of the grading itself [bytes].
MEMORY_BYTES = 1 << 30
# The kernel refuses more than this many times as much: a reader that goes on without it has then gone beyond the limit.
_REFUSED = 2
_NO_MEMORY, _FAILED = 3, 4
_PR_SET_PDEATHSIG = 1


class NotRead(Exception):
    """A submission needs more than it may have, or ends the process that reads it; the text says which."""


def limited(function: Callable, *arguments: Any, cpu_s: int = CPU_S,
            memory_bytes: int = MEMORY_BYTES) -> Any:
    """``function(*arguments)`` in a separate process: returns its result, or raises its exception; both are pickled.

    Raises NotRead.
    """
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        _work(write_end, function, arguments, cpu_s, memory_bytes)
    os.close(write_end)
    try:
        with open(read_end, "rb") as stream:
            answer = stream.read()
    except BaseException:  # as Ctrl-C
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code == 0:
        is_result, found = pickle.loads(answer)
        if is_result:
            return found
        raise found
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        raise NotRead("it takes more than %d s of processor time to read, as no program written by hand does" % cpu_s)
    if code == _NO_MEMORY:
        raise NotRead("it takes more than %d MB of memory to read, as no program written by hand does"
                      % (memory_bytes >> 20))
    raise NotRead("it ends the process that reads it; an expression in it may be nested too deeply for Python")


def _work(answer_end: Any, function: Callable, arguments: Any, cpu_s: int, memory_bytes: int) -> None:
    """The separate process: answer, and end."""
    status = _FAILED
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        data = _memory("VmData") + _REFUSED * memory_bytes
        resource.setrlimit(resource.RLIMIT_DATA, (data, data))
        most = _memory("VmRSS") + memory_bytes
        try:
            answer = True, function(*arguments)
        except Exception as error:  # noqa: BLE001  (every error is passed on to the caller)
            answer = False, error
        if isinstance(answer[1], MemoryError) or _memory("VmHWM") > most:
            status = _NO_MEMORY
        else:
            with open(answer_end, "wb") as stream:
                pickle.dump(answer, stream)
            status = 0
    except MemoryError:
        status = _NO_MEMORY
    finally:
        os._exit(status)


def _memory(name: str):
    """One of the amounts in /proc/self/status [bytes]."""
    with open("/proc/self/status", encoding="ascii", errors="replace") as file:
        return next(int(line.split()[1]) << 10 for line in file if line.startswith(name + ":"))


def problem(files: dict, exercises: list, cpu_s: int = CPU_S, memory_bytes: int = MEMORY_BYTES) -> str:
    """Why the programs of a submission are not read, a sentence, or "". files: {path: bytes}; exercises: Exercises."""
    try:
        limited(_read_all, files, exercises, cpu_s=cpu_s, memory_bytes=memory_bytes)
    except NotRead as error:
        return "the submission is not read: %s" % error
    except Exception as error:  # noqa: BLE001  (one submission ends no grading of the others)
        return "the submission is not read: %s" % unforeseen(error)
    return ""


def unforeseen(error: Exception) -> str:
    """An error that nobody has thought of, for the sentence of the submission that it belongs to."""
    return "%s: %s" % (type(error).__name__, error) if str(error) else type(error).__name__


def _read_all(files: dict[str, bytes], exercises: list[Exercise]) -> None:
    """Do all that reads the programs of a submission."""
    programs.assign(files, exercises)
    for name, content in programs.with_notebooks_as_programs(files)[0].items():
        text = decoded(content)
        diagnosis.check_syntax(content, name)
        alike.fingerprints(text)
        similarity.opaque_calls(text)
        similarity.judges_own(text)
