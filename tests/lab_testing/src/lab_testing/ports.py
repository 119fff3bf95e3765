# SPDX-License-Identifier: BSD-3-Clause
"""Ports for masters of a test's own."""
import contextlib
import random
import socket

# Below those (32768 up) that the kernel gives to whoever connects: one of them could be taken before the master comes.
PORTS = range(20000, 30000)


def free_port():
    """Return a port of the loopback interface that nobody listens on."""
    while True:
        port = random.choice(PORTS)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
