# SPDX-License-Identifier: BSD-3-Clause
"""Ports for private masters."""
import errno
import socket

import pytest

from processes.ports import PORTS, free_port


def test_a_port_that_somebody_listens_on_is_passed_over():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        other = free_port()
        assert free_port([number, other]) == other
        with pytest.raises(OSError, match="no port from %d to %d is free" % (number, number)) as caught:
            free_port([number])
        assert caught.value.errno == errno.EADDRINUSE


def test_without_a_choice_the_port_is_one_that_no_connection_takes():
    with open("/proc/sys/net/ipv4/ip_local_port_range", encoding="utf-8") as file:
        lowest = int(file.read().split()[0])
    assert free_port() in PORTS and PORTS[-1] < lowest
