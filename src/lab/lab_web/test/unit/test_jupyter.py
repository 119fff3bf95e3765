# SPDX-License-Identifier: BSD-3-Clause
"""JupyterLab itself at its socket: who may connect, the kernel's environment, and what its owner's end leaves."""
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from lab_testing.processes import is_alive
from lab_testing.waiting import stretched, wait_until
from processes.family import children_of

# Starts the server, says where it is, and waits to be ended.
OWNER = """import signal, sys
from pathlib import Path
from lab_web.jupyter import Server
server = Server(Path(sys.argv[1]), "/anna/notebook/")
server.wait()
print(server.socket, flush=True)
try:
    signal.pause()
except KeyboardInterrupt:
    server.close()
"""


def ask(path, method, uri, body=None):
    """(status, JSON) of JupyterLab's answer."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(stretched(90))
        connection.connect(str(path))
        text = json.dumps(body) if body else ""
        connection.sendall(("%s %s HTTP/1.0\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                            "Content-Length: %d\r\n\r\n%s" % (method, uri, len(text), text)).encode())
        data = b"".join(iter(lambda: connection.recv(65536), b""))
    head, _, rest = data.partition(b"\r\n\r\n")
    return int(head.split()[1]), json.loads(rest) if rest else None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL], ids=lambda number: number.name)
def test_it_ends_with_its_owner_in_any_way(tmp_path, number):
    owner = subprocess.Popen([sys.executable, "-c", OWNER, str(tmp_path)], stdout=subprocess.PIPE,
                             env={**os.environ, "ROS_MASTER_URI": "http://localhost:9"})
    family = set()
    try:
        path = Path(os.fsdecode(owner.stdout.readline().rstrip()))
        assert path.stat().st_mode & 0o777 == 0o600 and path.parent.stat().st_mode & 0o777 == 0o700
        assert ask(path, "GET", "/anna/notebook/api")[0] == 200
        status, kernel = ask(path, "POST", "/anna/notebook/api/kernels", {"name": "baxter"})
        assert status == 201 and kernel["name"] == "baxter"
        family = children_of([owner.pid]) - {owner.pid}
        kernels = [pid for pid in family if b"ipykernel_launcher" in Path("/proc/%d/cmdline" % pid).read_bytes()]
        # The kernel works with the lab of its owner.
        assert kernels and b"ROS_MASTER_URI=http://localhost:9" in Path("/proc/%d/environ" % kernels[0]).read_bytes()
        owner.send_signal(number)
        owner.wait(stretched(90))
        wait_until(lambda: not any(map(is_alive, family)), lambda: "the end of %s" % family, 90.0)
        assert not path.parent.exists()
        assert (tmp_path / ".baxter" / "jupyter" / "config").is_dir()
    finally:
        owner.stdout.close()
        owner.kill()
        owner.wait()
        for pid in filter(is_alive, family):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
