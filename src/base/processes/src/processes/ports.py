# SPDX-License-Identifier: BSD-3-Clause
"""Free ports of this machine for private ROS masters."""
from __future__ import annotations

import contextlib
import errno
import random
import socket
from collections.abc import Sequence

# Below those (32768 up) that the kernel gives to clients: a client could get such a port before the master starts.
PORTS = range(20000, 30000)


def free_port(ports: Sequence[int] | None = None) -> int:
    """Return a free port of the loopback interface: the first free one of `ports` if given, else any of PORTS.

    Raises OSError (EADDRINUSE) if none is free.
    """
    candidates = random.sample(PORTS, len(PORTS)) if ports is None else ports
    for port in candidates:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError(errno.EADDRINUSE, "no port from %d to %d is free; end a program that holds one"
                  % (min(candidates), max(candidates)))
