# SPDX-License-Identifier: BSD-3-Clause
"""System calls that a student's program does not get: a seccomp filter for bubblewrap. Free of ROS; Linux only.

They hold memory outside of every process, where no limit counts it, or make a user namespace, in which a program may
mount file systems without a limit of size. They fail with ENOSYS, as on a kernel that does not have them: libraries
then use other ways.
"""
import contextlib
import errno
import os
import platform
import struct

# Machine -> its number in linux/audit.h, and the numbers of calls in its asm/unistd.h.
_MACHINES = {
    "x86_64": (0xC000003E, {"memfd_create": 319, "memfd_secret": 447, "shmget": 29, "io_uring_setup": 425,
                            "clone3": 435, "setns": 308, "unshare": 272, "clone": 56}),
    "aarch64": (0xC00000B7, {"memfd_create": 279, "memfd_secret": 447, "shmget": 194, "io_uring_setup": 425,
                             "clone3": 435, "setns": 268, "unshare": 97, "clone": 220})}
# Refused only where their first argument has this bit; of clone3 a filter cannot see the flags.
_BY_FLAG = ("unshare", "clone")
_CLONE_NEWUSER = 0x10000000
# x86_64 has a second table of calls, for programs with pointers of 32 bits.
_SECOND_TABLE = 0x40000000
# Fields of struct seccomp_data (linux/seccomp.h); the lower half of the first argument.
_NUMBER, _ARCHITECTURE, _ARGUMENT = 0, 4, 16
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000 | errno.ENOSYS
# Instructions (linux/bpf_common.h): load a word; jump if equal, if not less, if a bit is set; return.
_LOAD, _EQUAL, _NOT_LESS, _BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06


def filter_program(machine=None):
    """The filter for this machine (as `platform.machine` names it) as bytes, b"" for a machine that is not known."""
    if (machine or platform.machine()) not in _MACHINES:
        return b""
    architecture, numbers = _MACHINES[machine or platform.machine()]
    always = [number for name, number in numbers.items() if name not in _BY_FLAG]
    tests = [(_NOT_LESS, _SECOND_TABLE), *((_EQUAL, number) for number in always)]
    # Each jump leads over the tests behind it, and over what stands between them and its end.
    by_flag = [(_EQUAL, numbers[name]) for name in _BY_FLAG]
    count = len(tests) + len(by_flag)
    steps = [(_LOAD, 0, 0, _ARCHITECTURE), (_EQUAL, 0, count + 4, architecture), (_LOAD, 0, 0, _NUMBER)]
    steps += [(code, count - place + 2, 0, value) for place, (code, value) in enumerate(tests)]
    steps += [(code, len(by_flag) - place, 0, value) for place, (code, value) in enumerate(by_flag)]
    steps += [(_RETURN, 0, 0, _ALLOW), (_LOAD, 0, 0, _ARGUMENT), (_BIT, 0, 1, _CLONE_NEWUSER), (_RETURN, 0, 0, _REFUSE),
              (_RETURN, 0, 0, _ALLOW)]
    return b"".join(struct.pack("=HBBI", *step) for step in steps)


@contextlib.contextmanager
def refused():
    """The options of bubblewrap that refuse these calls, and the descriptors that it must inherit; for one start."""
    program = filter_program()
    if not program:
        yield [], ()
        return
    read, write = os.pipe()
    try:
        os.write(write, program)
        os.close(write)
        yield ["--seccomp", str(read)], (read,)
    finally:
        os.close(read)
