# SPDX-License-Identifier: BSD-3-Clause
"""System calls that a student's program does not get: a seccomp filter for bubblewrap. Free of ROS; Linux only.

They hold memory outside of every process, where no limit counts it; make a user namespace, in which a program may mount
file systems without a limit of size; reach the keys that Linux keeps for all processes of one user; or open sockets of
families that no network namespace holds back, such as the one between a virtual machine and its host. They fail with
ENOSYS, as on a kernel that does not have them: libraries then use other ways. So do those that reserve space on a disk
without writing to it, which fill any disk in less than a second: they fail with EOPNOTSUPP, as on a file system that
does not have them.
"""
from __future__ import annotations

import contextlib
import errno
import os
import platform
import struct
from collections.abc import Iterator

# Machine -> its number in linux/audit.h, and the numbers of calls in its asm/unistd.h.
_MACHINES = {
    "x86_64": (0xC000003E, {"memfd_create": 319, "memfd_secret": 447, "shmget": 29, "semget": 64, "msgget": 68,
                            "io_uring_setup": 425, "clone3": 435, "setns": 308, "add_key": 248,
                            "request_key": 249, "keyctl": 250, "unshare": 272, "clone": 56, "socket": 41,
                            "fallocate": 285, "ioctl": 16}),
    "aarch64": (0xC00000B7, {"memfd_create": 279, "memfd_secret": 447, "shmget": 194, "semget": 190, "msgget": 186,
                             "io_uring_setup": 425, "clone3": 435, "setns": 268, "add_key": 217,
                             "request_key": 218, "keyctl": 219, "unshare": 97, "clone": 220, "socket": 198,
                             "fallocate": 47, "ioctl": 29})}
# Refused only where their first argument has this bit; of clone3 a filter cannot see the flags.
_BY_FLAG = ("unshare", "clone")
_CLONE_NEWUSER = 0x10000000
#: The families of sockets that programs get, by their numbers (linux/socket.h): local, IPv4, IPv6, netlink.
FAMILIES = (1, 2, 10, 16)
# The other way to fallocate: FS_IOC_RESVSP, FS_IOC_RESVSP64 and FS_IOC_ZERO_RANGE (linux/falloc.h).
_RESERVATIONS = (0x40305828, 0x4030582A, 0x40305839)
# x86_64 has a second table of calls, for programs with pointers of 32 bits.
_SECOND_TABLE = 0x40000000
# Fields of struct seccomp_data (linux/seccomp.h); the lower halves of the first two arguments.
_NUMBER, _ARCHITECTURE, _ARGUMENT, _SECOND_ARGUMENT = 0, 4, 16, 24
_ALLOW, _REFUSE, _UNSUPPORTED = 0x7FFF0000, 0x00050000 | errno.ENOSYS, 0x00050000 | errno.EOPNOTSUPP
# Instructions (linux/bpf_common.h): load a word; jump if equal, if not less, if a bit is set; return.
_LOAD, _EQUAL, _NOT_LESS, _BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06


def filter_program(machine: str | None = None) -> bytes:
    """The filter for this machine (as `platform.machine` names it) as bytes, b"" for a machine that is not known."""
    if (machine or platform.machine()) not in _MACHINES:
        return b""
    architecture, numbers = _MACHINES[machine or platform.machine()]
    always = [number for name, number in numbers.items() if name not in (*_BY_FLAG, "socket", "fallocate", "ioctl")]
    # (instruction, place to go to if so, else, value); without a place, the next one.
    steps = [(_LOAD, None, None, _ARCHITECTURE), (_EQUAL, None, "refuse", architecture), (_LOAD, None, None, _NUMBER),
             (_NOT_LESS, "refuse", None, _SECOND_TABLE), *((_EQUAL, "refuse", None, number) for number in always),
             *((_EQUAL, "flag", None, numbers[name]) for name in _BY_FLAG),
             (_EQUAL, "unsupported", None, numbers["fallocate"]), (_EQUAL, "request", None, numbers["ioctl"]),
             (_EQUAL, None, "allow", numbers["socket"]), (_LOAD, None, None, _ARGUMENT),
             *((_EQUAL, "allow", None, family) for family in FAMILIES)]
    places = {"refuse": len(steps)}
    steps.append((_RETURN, None, None, _REFUSE))
    places["request"] = len(steps)
    steps += [(_LOAD, None, None, _SECOND_ARGUMENT),
              *((_EQUAL, "unsupported", None, value) for value in _RESERVATIONS[:-1]),
              (_EQUAL, "unsupported", "allow", _RESERVATIONS[-1])]
    places["flag"] = len(steps)
    steps += [(_LOAD, None, None, _ARGUMENT), (_BIT, "refuse_flag", None, _CLONE_NEWUSER)]
    places["allow"] = len(steps)
    steps.append((_RETURN, None, None, _ALLOW))
    # Jumps go forward alone.
    places["refuse_flag"] = len(steps)
    steps.append((_RETURN, None, None, _REFUSE))
    places["unsupported"] = len(steps)
    steps.append((_RETURN, None, None, _UNSUPPORTED))
    jumps = [[0 if to is None else places[to] - place - 1 for to in step[1:3]] for place, step in enumerate(steps)]
    return b"".join(struct.pack("=HBBI", step[0], *jump, step[3]) for step, jump in zip(steps, jumps, strict=True))


@contextlib.contextmanager
def refused() -> Iterator[tuple[list[str], tuple[int, ...]]]:
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
