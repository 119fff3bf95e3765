# SPDX-License-Identifier: BSD-3-Clause
"""Whether Python can read a submission's programs in bounded time: tried in a separate process. Free of ROS.

Python's own parser takes minutes, or ends the process, for some texts of a few hundred kilobytes, such as one string
with a hundred thousand replacement fields. The process that grades a class must survive them all.
"""
import ctypes
import os
import resource
import signal

from rf_checks import diagnosis, similarity
from rf_checks.submission import decoded
from rf_grading import alike, programs

#: Processor time for all programs of a submission [s]; a megabyte of ordinary code takes half of it.
CPU_S = 30
#: Less text than this is read in moments, whatever it is [bytes].
LEAST_BYTES = 32 << 10
_PR_SET_PDEATHSIG = 1


def problem(files, exercises, cpu_s=CPU_S):
    """Why the programs of a submission are not read, a sentence, or "". files: {path: bytes}; exercises: Exercises."""
    if sum(map(len, files.values())) < LEAST_BYTES:
        return ""
    child = os.fork()
    if child == 0:
        _try(files, exercises, cpu_s)
    status = os.waitpid(child, 0)[1]
    if os.waitstatus_to_exitcode(status) == 0:
        return ""
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
        return ("the submission is not read: Python needs more than %d s of processor time for its programs; no "
                "program written by hand needs that" % cpu_s)
    return "the submission is not read: an expression in its programs is nested too deeply for Python"


def _try(files, exercises, cpu_s):
    """Do all that reads the programs of a submission, and end the process."""
    status = 1
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        programs.assign(files, exercises)
        for name, content in programs.with_notebooks_as_programs(files)[0].items():
            text = decoded(content)
            diagnosis.check_syntax(content, name)
            alike.fingerprints(text)
            similarity.opaque_calls(text)
            similarity.judges_own(text)
        status = 0
    finally:
        os._exit(status)
