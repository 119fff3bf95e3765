# SPDX-License-Identifier: BSD-3-Clause
"""JupyterLab beside the robot, at the page's address below /notebook/; started for the first page that wants it. No
ROS.

Its server listens on a Unix socket. Requests reach it only with the operator's token, because Jupyter runs any code;
a page that has shown the token goes on with a cookie.
"""
from __future__ import annotations

import hmac
import secrets
import shutil
import threading
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlencode

from lab_web import jupyter
from web_bridge import http_text
from web_bridge.errors import RequestForbidden
from web_bridge.passing import PassingHandler
from web_bridge.websocket import token_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from tornado.httputil import HTTPHeaders

    from web_bridge.access import Access

#: The path of the notebooks at the page's address.
PATH = "/notebook/"
# A browser without the page asks again after this time [s].
_AGAIN_S = 2


def labs_notebooks(folders: Mapping[str, Path], root: str | Path) -> list[str]:
    """Copies of the labs' notebooks below ``root``/notebooks, made where they are missing: paths below ``root``.

    ``folders``: {package: its folder "notebooks" [Path]}. Raises OSError.
    """
    found = []
    for package, folder in sorted(folders.items()):
        target = Path(root) / "notebooks" / package
        target.mkdir(parents=True, exist_ok=True)
        for source in sorted(folder.glob("*.ipynb")):
            copy = target / source.name
            if not copy.exists():
                shutil.copyfile(source, copy)
            found.append(copy.relative_to(root).as_posix())
    return found


class Notebooks:
    """One JupyterLab for all pages.

    start: makes a `jupyter.Server`; files: paths of the labs' notebooks; changed(state): is called with what pages are
    told, from any thread; below: the path at which a front door shows this page, "" or "/anna".
    """

    def __init__(self, start: Callable[[], jupyter.Server], files: list[str],
                 changed: Callable[[dict[str, Any]], object], below: str = "") -> None:
        self.below = below
        self._start, self._files, self._changed = start, files, changed
        self._lock = threading.Lock()
        self._thread = self._server = None
        self._ends = False
        self._tell("off")

    @property
    def socket(self) -> Path | None:
        """The socket of the running server [Path], or None."""
        server = self._server
        return None if server is None or server.has_ended else server.socket

    def ask(self, *_: Any) -> None:
        """Start the server if it does not run."""
        with self._lock:
            if self._ends or self._thread is not None and self._thread.is_alive():
                return
            self._thread = threading.Thread(target=self._run)
            self._thread.start()

    def close(self) -> None:
        """End the server and everything that runs in it."""
        with self._lock:
            self._ends = True
            server, thread = self._server, self._thread
        if server is not None:
            server.close()
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        self._tell("starting")
        try:
            server = self._start()
            with self._lock:
                self._server = server
                ends = self._ends
            if ends:
                server.close()
                return
            server.wait()
            self._tell("running", number=secrets.token_hex(4))
            server.join()
            self._tell("failed", "JupyterLab has ended")
        except (OSError, jupyter.JupyterError) as error:
            self._tell("failed", str(error))
        finally:
            if self._server is not None:
                self._server.close()

    def _tell(self, state: str, why: str = "", number: str = "") -> None:
        self._changed({"state": state, "why": why, "number": number, "files": self._files})


class NotebookDoor:
    """Access control of the notebooks. ``access``: web_bridge.access.Access."""

    def __init__(self, access: Access, notebooks: Notebooks) -> None:
        self.notebooks = notebooks
        self._access = access
        # A browser has one cookie of a name for all ports of a host, where other labs may be.
        self.cookie = "lab_notebook_" + secrets.token_hex(4)
        self.secret = secrets.token_urlsafe(24)

    def refusal(self, token: str, cookie: str) -> str:
        """Why a request may not go on, or ""."""
        if token:
            try:
                return "" if self._access.may_act(token) else "this address only watches; notebooks run any code"
            except RequestForbidden as error:
                return str(error)
        known = hmac.compare_digest(cookie.encode("utf-8", "surrogateescape"), self.secret.encode())
        return "" if known else "Open the notebook on the lab's page, whose address ./baxter.sh web has printed."


class NotebookHandler(PassingHandler):
    """Everything below PATH."""

    SERVER = "JupyterLab"

    def initialize(self, door: NotebookDoor) -> None:
        super().initialize()
        self._door = door
        self.OWN_COOKIE = door.cookie

    async def prepare(self) -> None:
        token, notebooks = token_of(self.request), self._door.notebooks
        refusal = self._door.refusal(token, self.get_cookie(self._door.cookie, ""))
        if refusal:
            self.refuse(403, refusal)
        # Of a page on another port of this host a browser sends the cookie, and with some requests no Origin.
        elif not token and self.request.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            self.refuse(403, "a page of another address may not use the notebooks")
        elif not self.takes_request():
            pass
        elif {".", ".."} & set(unquote(self.request.path).replace("\\", "/").split("/")):
            self.refuse(404, "there is no such path")
        elif self.request.query_arguments.get("token") and not self.is_upgrade:
            self._go_on_with_cookie()
        elif notebooks.socket is None:
            notebooks.ask()
            self.set_header("Retry-After", str(_AGAIN_S))
            self.set_header("Refresh", str(_AGAIN_S))
            self.refuse(503, "JupyterLab is starting.")
        else:
            await self.pass_to(str(notebooks.socket), notebooks.below + self.request.uri)

    def _go_on_with_cookie(self) -> None:
        """The same address without the token, which would get into histories."""
        self.set_cookie(self._door.cookie, self._door.secret, path=self._door.notebooks.below + PATH, httponly=True,
                        samesite="Strict")
        rest = [(name, value) for name, values in self.request.query_arguments.items() if name != "token"
                for value in values]
        self.redirect(self.request.path + ("?" + urlencode(rest) if rest else ""))

    def answer_headers(self, headers: HTTPHeaders) -> list[tuple[str, str]]:
        return http_text.passed_on(headers, "", self._door.notebooks.below, self._door.cookie)
