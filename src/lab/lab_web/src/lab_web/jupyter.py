# SPDX-License-Identifier: BSD-3-Clause
"""JupyterLab with the labs' notebooks: its settings, and a server at a Unix socket that ends with its owner. No ROS.

`python3 -m lab_web.jupyter ROOT BASE_URL`: runs it until standard input ends; its first line is the socket.
"""
from __future__ import annotations

import argparse
import contextlib
import http.client
import json
import os
import shutil
import signal
import socket
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from disk_cache.files import replace_text
from lab_web.child import HeardChild
from processes import keeper

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

#: The kernel that the labs' notebooks name.
KERNEL = "baxter"
#: Where Jupyter writes, below the folder that its users see as the topmost one.
STATE = Path(".baxter") / "jupyter"
#: Time limit for the end of simulators that notebooks have started: as long as roslaunch may need [s].
STOP_TIMEOUT_S = 40.0
#: Time limit for the start, on a busy machine [s].
START_TIMEOUT_S = 120.0
# Default settings of JupyterLab: without them it asks each new user whether to fetch news.
_SETTINGS = {"@jupyterlab/apputils-extension:notification": {"fetchNews": "false", "checkForUpdates": False}}
_LOOK_S = 0.1
_SOCKET = "jupyter"


class JupyterError(Exception):
    """JupyterLab does not run; the text says why."""


def notebooks(root: str | Path) -> list[Path]:
    """The labs' notebooks below a workspace, in the order of the course [list of Path]."""
    return sorted(path for path in Path(root).glob("src/*/*/notebooks/*.ipynb")
                  if ".ipynb_checkpoints" not in path.parts)


def write_kernel(folder: str | Path, command: Iterable[str]) -> None:
    """Register the kernel `Baxter lab` by a file below ``folder``; ``command``: its first words."""
    kernel = Path(folder) / "kernels" / KERNEL
    kernel.mkdir(parents=True, exist_ok=True)
    spec = {"argv": [*command, "-f", "{connection_file}"], "display_name": "Baxter lab", "language": "python"}
    # Another server, or its kernel, may just be reading it.
    replace_text(kernel / "kernel.json", json.dumps(spec, indent=1) + "\n")


def environment(state: Path, kernels: str | Path) -> dict[str, str]:
    """The environment of Jupyter: its files in the folder ``state``; the kernel of ``kernels`` beside its own."""
    folders = {"JUPYTER_CONFIG_DIR": "config", "JUPYTER_DATA_DIR": "data", "JUPYTER_RUNTIME_DIR": "runtime",
               "IPYTHONDIR": "ipython", "MPLCONFIGDIR": "matplotlib"}
    made = {**os.environ, "JUPYTER_PATH": str(kernels)}
    for variable, name in folders.items():
        (state / name).mkdir(parents=True, exist_ok=True)
        made[variable] = str(state / name)
    defaults = state / "config" / "labconfig" / "default_setting_overrides.json"
    defaults.parent.mkdir(exist_ok=True)
    replace_text(defaults, json.dumps(_SETTINGS, indent=1) + "\n")
    return made


def command(root: str | Path, options: Mapping[str, Any]) -> list[str]:
    """JupyterLab with the topmost folder ``root`` and further ``options``. It checks for no updates, asks no questions,
    and prints only warnings.
    """
    common = {"ServerApp.open_browser": False, "ServerApp.root_dir": str(root), "ServerApp.answer_yes": True,
              "ServerApp.allow_root": os.geteuid() == 0, "Application.log_level": "WARN",
              "KernelManager.shutdown_wait_time": 10.0,
              "LabApp.check_for_updates_class": "jupyterlab.NeverCheckForUpdate", "LabApp.news_url": ""}
    return [sys.executable, "-m", "jupyterlab", *("--%s=%s" % pair for pair in {**common, **options}.items())]


class Server:
    """JupyterLab, from the constructor on, without a password: only its user may connect to its socket. It ends with
    `close`, and with the process that has made it.

    root: its topmost folder; base_url: path of its pages, "/notebook/". Raises OSError.
    """

    def __init__(self, root: str | Path, base_url: str) -> None:
        self._process = HeardChild([sys.executable, "-P", "-m", "lab_web.jupyter", str(root), base_url])
        self._base_url = base_url
        self._deadline = time.monotonic() + START_TIMEOUT_S
        self.socket: Path | None = None

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until it answers at ``socket`` [Path]. Raises JupyterError."""
        with self._process.stdout as lines:
            path = Path(os.fsdecode(lines.readline().rstrip(b"\n")))
        while not self.has_ended and time.monotonic() < self._deadline:
            with contextlib.suppress(OSError, http.client.HTTPException):
                if _answers(path, self._base_url + "api"):
                    self.socket = path
                    return
            time.sleep(_LOOK_S)
        raise JupyterError("JupyterLab has ended; its messages are in the terminal of this page" if self.has_ended
                           else "JupyterLab did not start within %g s" % START_TIMEOUT_S)

    def join(self) -> None:
        """Wait until it has ended."""
        self._process.wait()

    def close(self) -> None:
        """End it, with all of its kernels, terminals and simulators."""
        self._process.end()
        self._process.wait()


def _answers(path: Path, url: str) -> bool:
    """Does the server at a socket answer? Raises OSError, http.client.HTTPException."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(5.0)
        connection.connect(str(path))
        connection.sendall(b"GET %s HTTP/1.0\r\nHost: localhost\r\n\r\n" % url.encode())
        answer = http.client.HTTPResponse(connection)
        answer.begin()
        return answer.status == http.client.OK


def main() -> int:
    """Run JupyterLab until standard input ends; returns the exit code."""
    parser = argparse.ArgumentParser(prog="lab_web.jupyter")
    parser.add_argument("root", type=Path)
    parser.add_argument("base_url")
    options = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)
    # Short: the address of a socket has 107 bytes at most. Only its user can enter it.
    runtime = Path(tempfile.mkdtemp(prefix="lab-notebook-"))
    try:
        print(runtime / _SOCKET, flush=True)
        # From here on all output goes where the messages of the owner go.
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        # The kernel has the environment of the owner, and so its lab.
        write_kernel(runtime, [sys.executable, "-m", "ipykernel_launcher", "--IPKernelApp.log_level=ERROR"])
        os.environ.update(environment(options.root / STATE, runtime))
        return keeper.keep(runtime / "state", command(options.root, {
            "ServerApp.sock": runtime / _SOCKET, "ServerApp.sock_mode": "0600", "ServerApp.base_url": options.base_url,
            "IdentityProvider.token": "", "Application.log_level": "ERROR",
            # The page around it closes the list of files on a telephone.
            "LabApp.expose_app_in_browser": True,
            # The owner lets no foreign page in, and hides from it who asks.
            "ServerApp.disable_check_xsrf": True}), grace_s=STOP_TIMEOUT_S)
    finally:
        shutil.rmtree(runtime, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
