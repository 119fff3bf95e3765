#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The commands that the project's pages mark with `run lab`, on Baxter's lab (the argument "baxter") or on those that
pages start ("own").
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import unittest
import xmlrpc.client
from pathlib import Path

import rostest

from lab_testing.waiting import wait_until
from processes.ports import free_port

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from lab_tests import page_blocks  # noqa: E402

LIMIT_S = 240
END_LIMIT_S = 30


def wait_for_service(master_uri, name, process=None):
    """Wait until a service is registered; ``process``: its process, which must not end before."""
    master = xmlrpc.client.ServerProxy(master_uri)

    def is_there():
        if process is not None and process.poll() is not None:
            raise AssertionError("the lab ended (%d) before %s was registered" % (process.returncode, name))
        with contextlib.suppress(OSError):
            return master.lookupService("/pages", name)[0] == 1

    wait_until(is_there, name, LIMIT_S, interval_s=0.1)


@contextlib.contextmanager
def started(block, folder):
    """The lab that a page starts itself, on a separate master; yields the master's address."""
    uri = "http://localhost:%d" % free_port()
    environment = page_blocks.environment(folder, ROS_MASTER_URI=uri)
    with open(folder / "lab.txt", "w+") as said:
        process = subprocess.Popen(page_blocks.command(block), cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                   stdout=said, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            try:
                wait_for_service(uri, "/gazebo/get_world_properties", process)
                yield uri
            except AssertionError as error:
                said.seek(0)
                raise AssertionError("%s\n%s:%d said:\n%s" % (error, block.page, block.line, said.read())) from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(END_LIMIT_S)
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)


def run_page(blocks, folder, master_uri):
    page_blocks.make_workspace(folder, ROOT)
    with contextlib.ExitStack() as labs:
        for block in blocks:
            if block.kind == "file":
                page_blocks.write_file(block, folder)
            elif block.kind == "start":
                labs.close()
                master_uri = labs.enter_context(started(block, folder))
            elif block.kind == "lab":
                page_blocks.run(block, folder, LIMIT_S, ROS_MASTER_URI=master_uri)


def starts_a_lab(blocks):
    return any(block.kind == "start" for block in blocks)


class Pages(unittest.TestCase):
    def run_pages(self, chosen):
        """Run the pages with commands for a lab of which ``chosen(blocks)`` is true; there must be some."""
        command = ["git", "-C", str(ROOT), "ls-files", "*.md"]
        listed = subprocess.run(command, capture_output=True, text=True, check=True)
        ran, wrong = 0, []
        for page in sorted(listed.stdout.split()):
            if not (ROOT / page).exists():
                continue
            blocks = page_blocks.marked_blocks(page, (ROOT / page).read_text(encoding="utf-8"))
            if any(block.kind == "lab" for block in blocks) and chosen(blocks):
                ran += 1
                with tempfile.TemporaryDirectory() as folder:
                    try:
                        run_page(blocks, Path(folder), os.environ["ROS_MASTER_URI"])
                    except AssertionError as error:
                        wrong.append(str(error))
        self.assertEqual("\n".join(wrong), "")
        self.assertGreater(ran, 0)


class OnBaxter(Pages):
    def test_marked_commands_run(self):
        wait_for_service(os.environ["ROS_MASTER_URI"], "/ExternalTools/left/PositionKinematicsNode/IKService")
        self.run_pages(lambda blocks: not starts_a_lab(blocks))


class OnTheirOwn(Pages):
    def test_marked_commands_run(self):
        self.run_pages(starts_a_lab)


SUITES = {"baxter": OnBaxter, "own": OnTheirOwn}

if __name__ == "__main__":
    suite = next(word for word in sys.argv[1:] if word in SUITES)
    rostest.rosrun("workspace_tests", "pages_" + suite, SUITES[suite])
