#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Two small labs of a class, from ./baxter.sh labs up to down."""
import contextlib
import ctypes
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest
import urllib.error
import urllib.request
from pathlib import Path
from unittest import mock

import rospkg
import rostest
import websocket

from lab_class import control
from lab_class.store import Store
from lab_testing.waiting import stretched, wait_until
from lab_web import libraries
from processes import isolation
from processes.family import children_of, is_running
from processes.ports import free_port
from rf_checks.handout import SOLUTION_TAG

NAMES = ("student-01", "student-02")
ABSTRACT = "lab-class-test-%d" % os.getpid()
_IPC_CREAT, _IPC_RMID = 0o1000, 0  # sys/ipc.h
_START_S, _LONG_S = 180.0, 60.0


def share(package):
    return Path(rospkg.RosPack().get_path(package))


def state_of(pid):
    with contextlib.suppress(OSError):
        return Path("/proc/%d/stat" % pid).read_text().rpartition(") ")[2][0]
    return "-"


class Bridge:
    """A rosbridge client of one lab that publishes and subscribes on /mark."""

    def __init__(self, address):
        self._socket = websocket.create_connection(address, timeout=stretched(1.0))
        self.heard = set()
        self._send(op="subscribe", topic="/mark", type="std_msgs/String")
        self._send(op="advertise", topic="/mark", type="std_msgs/String")

    def _send(self, **operation):
        self._socket.send(json.dumps(operation))

    def say(self, text):
        """Publish; returns whether the text has come back."""
        self._send(op="publish", topic="/mark", msg={"data": text})
        with contextlib.suppress(websocket.WebSocketTimeoutException):
            answer = json.loads(self._socket.recv())
            if answer["op"] == "publish":
                self.heard.add(answer["msg"]["data"])
        return text in self.heard

    def close(self):
        self._socket.close()


class TwoLabs(unittest.TestCase):
    """In one go, because a class takes a while to start."""

    def setUp(self):
        self.top = Path(tempfile.mkdtemp(prefix="two-labs-"))
        self.addCleanup(shutil.rmtree, self.top, ignore_errors=True)
        # The variable is for trying what a machine without namespaces gets.
        self.walls = not isolation.problem() and "LAB_TEST_NO_WALLS" not in os.environ
        self.port = free_port()
        self.store = Store(self.top / "class")
        # The page's library, which no network is needed for here.
        with mock.patch.object(libraries.shutil, "which", return_value="npm"):
            libraries.fetched(share("lab_web") / "page", self.top / "cache" / "lab_web",
                              lambda *_, cwd, **__: (cwd / "node_modules" / "three").mkdir(parents=True))
        self.environment = {**os.environ, "XDG_CACHE_HOME": str(self.top / "cache")}
        self.addCleanup(self.labs, "down", "--delete")

    def labs(self, *words):
        """Run the command; (exit code, output)."""
        done = subprocess.run([sys.executable, "-P", "-m", "lab_class", "--folder", str(self.store.folder), *words],
                              env=self.environment, capture_output=True, text=True, timeout=stretched(_START_S))
        return done.returncode, done.stdout + done.stderr

    def up(self, *words):
        code, output = self.labs("up", *words, *(() if self.walls else ("--trusted",)))
        self.assertEqual(code, 0, output + "".join(self.labs("logs", name)[1][-3000:] for name in NAMES))
        return output

    def state(self, name):
        return next(lab for lab in control.call(self.store, "GET", "/labs")["labs"] if lab["name"] == name)["state"]

    def get(self, path):
        try:
            with urllib.request.urlopen("http://127.0.0.1:%d%s" % (self.port, path),
                                        timeout=stretched(_LONG_S)) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read()

    def socket_address(self, name, path):
        return "ws://127.0.0.1:%d/%s%s?token=%s" % (self.port, name, path, self.tokens[name].act)

    def test_a_class(self):
        targets = self.prepare_targets()
        launch = "%s targets:=%s" % (Path(__file__).resolve().parent / "small_lab.launch",
                                     json.dumps(targets).encode().hex())
        output = self.up("2", "--port", str(self.port), "--launch", launch, "--idle", "0", "--at-once", "2")
        self.record = self.store.read()
        self.tokens = self.record.tokens
        for name in NAMES:
            self.assertIn("http://localhost:%d/%s/?token=%s" % (self.port, name, self.tokens[name].act), output)
        self.supervisor = self.store.running()["pid"]
        self.check_who_gets_in()
        self.check_that_labs_are_apart()
        if self.walls:
            self.check_walls()
        self.check_notebook()
        self.check_pause()
        self.check_end_by_force()
        self.check_second_start()

    def prepare_targets(self):
        secret = self.top / "secret"
        secret.write_text("x")
        listener = socket.socket(socket.AF_UNIX)
        self.addCleanup(listener.close)
        listener.bind("\0" + ABSTRACT)
        listener.listen()
        memory = Path("/dev/shm/lab-class-test-%d" % os.getpid())
        memory.touch()
        self.addCleanup(memory.unlink)
        master = int(os.environ["ROS_MASTER_URI"].rstrip("/").rpartition(":")[2])
        return {"files": [str(secret), str(self.store.folder / "class.json"), str(memory)],
                "folders": [str(self.store.folder)], "ports": [self.port, master], "abstract": ABSTRACT,
                "workspace": str(share("lab_class")), "queue": self.message_queue(),
                "temporary": tempfile.gettempdir()}

    def message_queue(self):
        """The key of a new message queue of System V, which is removed afterwards (sys/msg.h)."""
        libc, key = ctypes.CDLL(None), os.getpid()
        queue = libc.msgget(key, 0o600 | _IPC_CREAT)
        self.assertGreaterEqual(queue, 0)
        self.addCleanup(libc.msgctl, queue, _IPC_RMID, None)
        return key

    def check_who_gets_in(self):
        first, second = (self.tokens[name] for name in NAMES)
        for name, token, expected in (
                (NAMES[0], first.act, 200), (NAMES[0], first.view, 200), (NAMES[1], first.act, 403),
                (NAMES[1], second.act, 200), (NAMES[1], "", 403), ("student-03", first.act, 403),
                (NAMES[0], self.record.instructor, 403)):
            self.assertEqual(self.get("/%s/?token=%s" % (name, token))[0], expected, (name, expected))
        self.assertEqual(self.get("/instructor/labs?token=" + first.act)[0], 403)
        request = urllib.request.Request("http://127.0.0.1:%d/instructor/labs" % self.port,
                                         headers={"Authorization": "Bearer " + self.record.instructor})
        with urllib.request.urlopen(request, timeout=stretched(_LONG_S)) as answer:
            self.assertEqual([lab["name"] for lab in json.load(answer)["labs"]], list(NAMES))
        with self.assertRaises(websocket.WebSocketBadStatusException):
            websocket.create_connection(self.socket_address(NAMES[0], "/rosbridge"), origin="http://elsewhere.example")

    def check_that_labs_are_apart(self):
        bridges = [Bridge(self.socket_address(name, "/rosbridge")) for name in NAMES]
        for bridge, text in zip(bridges, ("one", "two"), strict=True):
            wait_until(lambda bridge=bridge, text=text: bridge.say(text), "%s to come back" % text, _LONG_S)
        # The second lab would have heard the first one's text before its own.
        self.assertEqual([bridge.heard for bridge in bridges], [{"one"}, {"two"}])
        for bridge in bridges:
            bridge.close()

    def check_walls(self):
        for name in NAMES:
            report = self.store.lab(name) / "home" / "report.json"
            wait_until(report.exists, "the intruder's report", _LONG_S)
            results = json.loads(report.read_text())
            self.assertEqual(len(results), 23, results)
            self.assertEqual([attempt for attempt, result in results.items() if result == "reached"], [], results)

    def ask(self, path, body=None, **headers):
        """The JSON that the first lab's JupyterLab answers; None while it starts."""
        address = "http://127.0.0.1:%d/%s/notebook/%s" % (self.port, NAMES[0], path)
        request = urllib.request.Request(address, body, headers)
        try:
            with urllib.request.urlopen(request, timeout=stretched(_LONG_S)) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            with error:
                if error.code == 503:
                    return None
                raise

    def check_notebook(self):
        """A cell runs in the student's lab, and writes into the student's folder."""
        own, other = (self.tokens[name] for name in NAMES)
        for token in (own.view, other.act, ""):
            self.assertEqual(self.get("/%s/notebook/api?token=%s" % (NAMES[0], token))[0], 403)
        opened = {}

        class Cookies(urllib.request.HTTPRedirectHandler):
            def redirect_request(self, request, answer, code, message, headers, address):
                cookies = [text.partition(";")[0] for text in headers.get_all("Set-Cookie")]
                opened.update(address=address, Cookie="; ".join(cookies))

        with contextlib.suppress(urllib.error.HTTPError):
            urllib.request.build_opener(Cookies).open("http://127.0.0.1:%d/%s/notebook/api?token=%s"
                                                      % (self.port, NAMES[0], own.act), timeout=stretched(_LONG_S))
        self.assertEqual(opened.pop("address"), "http://127.0.0.1:%d/%s/notebook/api" % (self.port, NAMES[0]))
        wait_until(lambda: self.ask("api", **opened), "the lab's JupyterLab", _START_S)
        kernel = self.ask("api/kernels", json.dumps({"name": "baxter"}).encode(), **opened)
        address = "ws://127.0.0.1:%d/%s/notebook/api/kernels/%s/channels" % (self.port, NAMES[0], kernel["id"])
        channel = websocket.create_connection(address, timeout=stretched(_LONG_S), header=opened)
        self.addCleanup(channel.close)
        code = "import os, pathlib; pathlib.Path.home().joinpath('cell.txt').write_text(os.environ['ROS_MASTER_URI'])"
        channel.send(json.dumps({
            "header": {"msg_id": "1", "username": "", "session": "1", "msg_type": "execute_request", "version": "5.3"},
            "parent_header": {}, "metadata": {}, "channel": "shell",
            "content": {"code": code, "silent": False, "store_history": False, "user_expressions": {},
                        "allow_stdin": False}}))
        home = self.store.lab(NAMES[0]) / "home"
        wait_until((home / "cell.txt").exists, "a cell that runs in the lab", _LONG_S)
        wait_until((home / "cell.txt").read_text, "its text", _LONG_S)
        if self.walls:
            self.assertEqual((home / "cell.txt").read_text(), "http://localhost:11311")
        waving = home / "notebooks" / "rf_lab2" / "7_waving.ipynb"
        self.assertTrue(waving.is_file())
        if self.walls:
            self.assertNotIn(SOLUTION_TAG, [tag for cell in json.loads(waving.read_text())["cells"]
                                            for tag in cell["metadata"].get("tags", ())])

    def family(self):
        return children_of([self.supervisor]) - {self.supervisor}

    def check_pause(self):
        name = NAMES[0]
        page = websocket.create_connection(self.socket_address(name, "/lab"), timeout=stretched(_LONG_S))
        self.addCleanup(page.close)
        self.assertEqual(self.labs("pause", name), (0, ""))
        stopped = [pid for pid in self.family() if state_of(pid) == "T"]
        self.assertGreater(len(stopped), 4)
        self.assertGreater(sum(state_of(pid) in "RS" for pid in self.family()), 4, "the other lab goes on")
        page.send("beat")
        self.assertEqual(self.state(name), "paused")
        page.send(json.dumps({"op": "stop"}))
        wait_until(lambda: self.state(name) == "running", "an operation to wake the lab")
        wait_until(lambda: not any(state_of(pid) == "T" for pid in self.family()), "its processes to go on")
        self.assertEqual(self.labs("pause", name)[0], 0)
        self.assertEqual(self.get("/%s/?token=%s" % (name, self.tokens[name].view))[0], 200)
        self.assertEqual(self.state(name), "running")
        code, output = self.labs("stop", "student-03")
        self.assertEqual((code, "there are: student-01, student-02" in output), (1, True), output)

    def check_end_by_force(self):
        # One of them paused: stopped processes do not notice the end of anything.
        self.assertEqual(self.labs("pause", NAMES[1])[0], 0)
        family = self.family()
        os.kill(self.supervisor, signal.SIGKILL)
        wait_until(lambda: not any(map(is_running, family)), "all labs to end with their supervisor", _LONG_S)
        self.assertEqual(self.labs("list")[0], 1)

    def check_second_start(self):
        left_over = Path(self.store.running()["runtime"])
        note = self.store.lab(NAMES[0]) / "home" / "note.txt"
        note.write_text("mine")
        output = self.up("--no-wait", "--idle", "15")
        self.assertFalse(left_over.exists())
        self.assertIn(self.tokens[NAMES[0]].act, output)
        # The second one has a visitor: before it starts, and on a busy machine after that.
        first, second = ("/%s/?token=%s" % (name, self.tokens[name].act) for name in NAMES)
        self.assertIn(self.get(second)[0], (503, 200))
        self.supervisor = self.store.running()["pid"]
        wait_until(lambda: self.state(NAMES[0]) == "paused", "a lab that has started to wait for its visitor", _START_S)
        wait_until(lambda: sum(state_of(pid) == "T" for pid in self.family()) > 4, "its processes to stand")
        self.assertEqual(self.get(first)[0], 200)
        wait_until(lambda: self.get(second)[0] == 200 and self.state(NAMES[1]) == "running",
                   "a lab with a visitor to run", _START_S)
        runtime, family = Path(self.store.running()["runtime"]), self.family()
        self.assertEqual(self.labs("down"), (0, ""))
        self.assertFalse(any(map(is_running, {*family, self.supervisor})))
        self.assertFalse(runtime.exists())
        self.assertEqual(sorted(path.name for path in self.store.lab(NAMES[0]).iterdir()), ["home"])
        self.assertEqual(note.read_text(), "mine")
        self.assertEqual(sorted(path.name for path in self.store.folder.iterdir()), ["class.json", "labs"])


if __name__ == "__main__":
    rostest.rosrun("lab_class", "two_labs", TwoLabs)
