# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh notebook [NAME]`: JupyterLab on loopback with the labs' notebooks, until Ctrl-C."""
import argparse
import secrets
import signal
import subprocess
import sys
import time
import urllib.request
import uuid
from pathlib import Path

from command_line.options import Parser, did_you_mean
from lab_tests import processes
from lab_web import jupyter
from processes import ports

ROOT = Path(__file__).resolve().parent.parent
# Everything that Jupyter writes, so that nothing gets into the user's home.
STATE = ROOT / jupyter.STATE
FIRST_PORT = 8888
START_TIMEOUT_S = 60.0


class NotebookError(Exception):
    """The notebook cannot be opened; the text says why and lists valid ones."""


def notebooks() -> list[Path]:
    """The labs' notebooks, in the order of the course."""
    return jupyter.notebooks(ROOT)


def find(name: str) -> Path:
    """Return the only notebook whose name contains these letters; raises NotebookError for none or several."""
    wanted = name.removesuffix(".ipynb")
    exact = [path for path in notebooks() if path.stem == wanted]
    found = exact or [path for path in notebooks() if wanted in path.stem]
    if len(found) != 1:
        stems = [path.stem for path in found or notebooks()]
        what = "several notebooks; which of" if found else "no notebook; there are"
        raise NotebookError(f"'{name}' names {what}: {', '.join(stems)}{'' if found else did_you_mean(wanted, stems)}")
    return found[0]


def write_kernel() -> None:
    """Register the kernel, which runs in the workspace's environment wherever Jupyter has started: for editors, too."""
    jupyter.write_kernel(STATE, [str(ROOT / "tools" / "notebook_kernel.bash")])


def free_port(first: int) -> int:
    """The first free port from there on. Raises NotebookError."""
    try:
        return ports.free_port(range(first, first + 100))
    except OSError as error:
        raise NotebookError(f"{error.strerror}, or name another port by --port") from error


def command(port: int) -> list[str]:
    """JupyterLab on loopback."""
    return jupyter.command(ROOT, {"ServerApp.ip": "127.0.0.1", "ServerApp.port": port, "ServerApp.port_retries": 0})


def wait_for(url: str, server: subprocess.Popen) -> None:
    """Wait until the server answers; raises NotebookError when it does not."""
    deadline = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < deadline and server.poll() is None:
        try:
            urllib.request.urlopen(url, timeout=5.0).close()
            return
        except OSError:
            time.sleep(0.1)
    raise NotebookError("Jupyter did not start; its messages are above")


def serve(page: str, first_port: int) -> int:
    """Run JupyterLab until Ctrl-C or until it ends; all processes of its notebooks end with it."""
    port, token, run_id = free_port(first_port), secrets.token_urlsafe(24), uuid.uuid4().hex
    write_kernel()
    # In the environment and not on the command line, since every user of the machine can read the latter.
    marked = {**jupyter.environment(STATE, STATE), "JUPYTER_TOKEN": token, processes.NOTEBOOK_MARKER: run_id}
    # A separate session: Ctrl-C reaches only this process, which then ends the server once.
    server = subprocess.Popen(command(port), env=marked, stdin=subprocess.DEVNULL, start_new_session=True)
    try:
        wait_for(f"http://127.0.0.1:{port}/api?token={token}", server)
        print(f"Open in a browser:\n\n    http://127.0.0.1:{port}/lab{page}?token={token}\n\n"
              "Ctrl-C here ends it, with all notebooks and the simulators that they have started.", flush=True)
        return server.wait()
    except KeyboardInterrupt:
        print("ending ...", flush=True)
        return 0
    finally:
        # One Ctrl-C is enough; a second one must not interrupt the clean-up.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if server.poll() is None:
            server.send_signal(signal.SIGTERM)
        processes.wait_until_gone(run_id, jupyter.STOP_TIMEOUT_S, processes.NOTEBOOK_MARKER)
        processes.kill_all(run_id, processes.NOTEBOOK_MARKER)


def parse(argv: list[str]) -> argparse.Namespace:
    """The options; ``path`` is that of the notebook, None for all."""
    parser = Parser(prog="./baxter.sh notebook", description=__doc__)
    parser.add_argument("name", nargs="?", help="a part of a notebook's name; without it the list of all")
    parser.add_argument("--port", type=int, default=FIRST_PORT, help="the first port to try (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="print the notebooks and end")
    options = parser.parse_args(argv)
    try:
        options.path = find(options.name) if options.name and not options.list else None
    except NotebookError as error:
        parser.error(str(error))
    return options


def main() -> int:
    options = parse(sys.argv[1:])
    try:
        if options.list:
            print("\n".join(f"{path.stem:40} {path.relative_to(ROOT)}" for path in notebooks()))
            return 0
        page = f"/tree/{options.path.relative_to(ROOT)}" if options.path else ""
        return serve(page, options.port)
    except NotebookError as error:
        print(f"baxter.sh notebook: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    # SIGTERM ends it like Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
