# SPDX-License-Identifier: BSD-3-Clause
"""Ports of this machine for ROS masters of one's own."""
import contextlib
import errno
import random
import socket

# Below those (32768 up) that the kernel gives to clients: one of them could be taken before the master comes.
PORTS = range(20000, 30000)


def free_port(ports=None):
    """Return a port of the loopback interface that nobody listens on: of `ports` the first, else any of PORTS.

    Raises OSError (EADDRINUSE) where none is free.
    """
    candidates = random.sample(PORTS, len(PORTS)) if ports is None else ports
    for port in candidates:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError(errno.EADDRINUSE, "no port from %d to %d is free; end a program that holds one"
                  % (min(candidates), max(candidates)))
