# SPDX-License-Identifier: BSD-3-Clause
"""The filter of system calls, run by an interpreter for its few instructions; the sandbox's tests try it on the
kernel.
"""
import errno
import socket
import struct

import pytest

from processes import system_calls

ALLOW, REFUSE = 0x7FFF0000, 0x00050000 | errno.ENOSYS
# Numbers of linux/audit.h, and of read(2) and clone(2).
MACHINES = {"x86_64": (0xC000003E, 0, 56), "aarch64": (0xC00000B7, 63, 220)}
NEW_USER, NEW_THREAD = 0x10000000, 0x3D0F00


UNSUPPORTED = 0x00050000 | errno.EOPNOTSUPP


def outcome(program, number, architecture, argument=0, second=0):
    steps = [struct.unpack_from("=HBBI", program, place) for place in range(0, len(program), 8)]
    place, word = 0, None
    while True:
        code, if_so, if_not, value = steps[place]
        place += 1
        if code == 0x06:
            return value
        if code == 0x20:
            word = {0: number, 4: architecture, 16: argument & 0xFFFFFFFF, 24: second & 0xFFFFFFFF}[value]
        else:
            place += if_so if {0x15: word == value, 0x35: word >= value, 0x45: word & value}[code] else if_not


@pytest.mark.parametrize("machine", MACHINES)
def test_calls_that_hide_memory_are_refused_and_others_allowed(machine):
    architecture, read, clone = MACHINES[machine]
    program = system_calls.filter_program(machine)
    numbers = system_calls._MACHINES[machine][1]
    for name in ("memfd_create", "memfd_secret", "shmget", "semget", "msgget", "io_uring_setup", "clone3", "setns",
                 "add_key", "request_key", "keyctl"):
        assert outcome(program, numbers[name], architecture) == REFUSE, name
    assert outcome(program, read, architecture) == ALLOW
    for name in ("clone", "unshare"):
        assert outcome(program, numbers[name], architecture, NEW_THREAD) == ALLOW
        assert outcome(program, numbers[name], architecture, NEW_USER | NEW_THREAD) == REFUSE
    assert numbers["clone"] == clone


@pytest.mark.parametrize("machine", MACHINES)
def test_sockets_are_those_that_a_network_namespace_holds_back(machine):
    architecture, program = MACHINES[machine][0], system_calls.filter_program(machine)
    number = system_calls._MACHINES[machine][1]["socket"]
    for family in (socket.AF_UNIX, socket.AF_INET, socket.AF_INET6, socket.AF_NETLINK):
        assert outcome(program, number, architecture, family) == ALLOW
    for family in (socket.AF_VSOCK, socket.AF_ALG, socket.AF_BLUETOOTH, socket.AF_PACKET):
        assert outcome(program, number, architecture, family) == REFUSE


@pytest.mark.parametrize("machine", MACHINES)
def test_no_space_is_reserved_on_disks(machine):
    architecture, program = MACHINES[machine][0], system_calls.filter_program(machine)
    numbers = system_calls._MACHINES[machine][1]
    assert outcome(program, numbers["fallocate"], architecture) == UNSUPPORTED
    # The command is an int: its upper half does not count.
    for command in (0x40305828, 0x4030582A, 0x40305839, 0x40305828 + (1 << 32)):
        assert outcome(program, numbers["ioctl"], architecture, 0, command) == UNSUPPORTED
    for command in (0x5413, 0x40305829):
        assert outcome(program, numbers["ioctl"], architecture, 0, command) == ALLOW


@pytest.mark.parametrize("machine", MACHINES)
def test_calls_of_other_tables_are_refused(machine):
    architecture, read, _ = MACHINES[machine]
    program = system_calls.filter_program(machine)
    assert outcome(program, read, 0x40000003) == REFUSE
    assert outcome(program, 0x40000000 + read, architecture) == REFUSE


def test_a_machine_without_numbers_has_no_filter(monkeypatch):
    assert system_calls.filter_program("riscv64") == b""
    monkeypatch.setattr(system_calls.platform, "machine", lambda: "riscv64")
    with system_calls.refused() as refused:
        assert refused == ([], ())
