# SPDX-License-Identifier: BSD-3-Clause
"""A roslaunch that a signal interrupts in its start, at whatever moment, leaves no process and no traceback."""
import json
import os
import re
import signal
import subprocess
import sys
import uuid
from pathlib import Path
from types import SimpleNamespace

import pytest
from rosmaster.master import Master

from processes.ports import free_port
from rospy_fixes import launch_end

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
DEADLINE_S = 300.0  # only keeps a test from hanging
MOMENTS = 16
NODES = {"node": "#!/bin/sh\nexec sleep 600\n", "deaf": "#!/bin/sh\ntrap '' INT\nsleep 600\n",
         # Where Ctrl-C comes while Python starts, it is no fatal error.
         "python": "#!/usr/bin/env python3\nimport os\nos.execlp('sleep', 'sleep', '600')\n",
         "short": "#!/bin/sh\nexit 3\n"}
# A program in Python that Ctrl-C interrupts says so itself.
INTERRUPTED_STUB = re.compile(r'Traceback \(most recent call last\):\n  File "\S*/stubs/python".*?'
                              r'\nKeyboardInterrupt\n', re.S)
# Loads a launch file once, and runs it once for each of `cases`, in a separate process: `sign` comes at the `moment`-th
# call of a Python function in the start of the processes (None: once all of them run), and once more 50 calls later.
# Prints for each case how it ended, the calls that there were and what it wrote.
PROGRAM = """
import json, os, signal, sys, tempfile, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # tests may run in a background job, which ignores it
import roslaunch, roslaunch.parent
sys.modules["__main__"].__file__ = "/usr/bin/roslaunch"
file, cases = sys.argv[1], json.loads(sys.argv[2])
roslaunch.configure_logging = lambda uuid: None
launch = roslaunch.parent.ROSLaunchParent
config = roslaunch.config.load_config_default([file], None)
launch._load_config = lambda self: setattr(self, "config", config)
begin, spin, register = roslaunch.launch.ROSLaunchRunner._setup, launch.spin, roslaunch.pmon.ProcessMonitor.register
def run(moment, sign, count):
    calls = 0
    def profile(frame, event, argument):
        nonlocal calls
        if event == "call":
            calls += 1
            if moment and calls in (moment, moment + 50):
                os.kill(os.getpid(), sign)
    def setup(self):
        roslaunch.pmon._init_signal_handlers()  # done by the first process
        sys.setprofile(profile)
        begin(self)
    def wait(self):
        sys.setprofile(None)
        if moment is None and sign:
            os.kill(os.getpid(), sign)
        spin(self)
    def after_the_end(self, process):
        deadline = time.monotonic() + 60
        while len(self.procs) == 2 and not self.is_shutdown and time.monotonic() < deadline:
            time.sleep(0.01)
        register(self, process)
    roslaunch.launch.ROSLaunchRunner._setup, launch.spin = setup, wait
    if not sign:  # a required node ends in the start
        roslaunch.pmon.ProcessMonitor.register = after_the_end
    try:
        roslaunch.main(["roslaunch", "--skip-log-check", "--disable-title", "--sigint-timeout=1", file])
    finally:
        os.write(count, b"%d" % calls)
for moment, sign in cases:
    read, write = os.pipe()
    text = tempfile.TemporaryFile("w+")
    if os.fork() == 0:
        os.dup2(text.fileno(), 1), os.dup2(text.fileno(), 2)
        run(moment, sign, write)
        break
    os.close(write)
    code = os.waitstatus_to_exitcode(os.wait()[1])
    text.seek(0)
    print(json.dumps([code, int(os.read(read, 20) or 0), text.read()]), flush=True)
"""


@pytest.fixture
def start(tmp_path):
    """A function ``start(nodes, cases, master_uri)``: [exit code, calls, output] for each [moment, signal] of
    ``cases``; it makes sure that none has left a process."""
    (tmp_path / "stubs").mkdir()
    (tmp_path / "stubs/package.xml").write_text("<package><name>stubs</name></package>")
    for name, text in NODES.items():
        (tmp_path / "stubs" / name).write_text(text)
        (tmp_path / "stubs" / name).chmod(0o755)

    def run(nodes, cases, master_uri):
        file, mark = tmp_path / "stubs/start.launch", "LAUNCH_END_TEST=%s" % uuid.uuid4()
        file.write_text("<launch>%s</launch>" % "".join(
            '<node pkg="stubs" name="n%d" type="%s" %s/>' % (number, *node.partition(" ")[::2])
            for number, node in enumerate(nodes)))
        paths = {"ROS_PACKAGE_PATH": tmp_path, "PYTHONPATH": OURS}
        environment = {**os.environ, **{name: "%s:%s" % (path, os.environ[name]) for name, path in paths.items()},
                       **dict([mark.split("=")]), "ROS_MASTER_URI": master_uri, "ROS_LOG_DIR": str(tmp_path)}
        done = subprocess.run([sys.executable, "-c", PROGRAM, file, json.dumps(cases)], capture_output=True, text=True,
                              timeout=DEADLINE_S, env=environment)
        left = marked(mark)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        assert not left and done.returncode == 0, done.stderr + done.stdout
        ends = [json.loads(line) for line in done.stdout.splitlines()]
        assert len(ends) == len(cases)
        return [(code, calls, INTERRUPTED_STUB.sub("", text)) for code, calls, text in ends]
    return run


def marked(mark):
    """Numbers of the living processes that have this entry in their environment."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
        except OSError:
            pass
    return found


@pytest.fixture
def earlier_master():
    """The address of a master that no launch has started."""
    master = Master(port=0)
    master.start()
    yield master.uri
    master.stop()


def test_a_signal_at_any_moment_of_the_start_ends_all_processes(start, earlier_master):
    nodes = ["node", "python", "node"]
    (code, calls, text), = start(nodes, [[None, signal.SIGINT]], earlier_master)
    assert code == 0 and "Traceback" not in text and calls > 10 * MOMENTS
    cases = [[1 + number * calls // MOMENTS, (signal.SIGINT, signal.SIGTERM)[number % 2]] for number in range(MOMENTS)]
    for case, (code, _, text) in zip(cases, start(nodes, cases, earlier_master), strict=True):
        assert code == 0 and "Traceback" not in text and "Exception" not in text, (case, code, text)


def test_the_master_of_the_launch_ends_with_it(start):
    (code, calls, _), = start(["node"], [[None, signal.SIGINT]], "http://localhost:%d" % free_port())
    cases = [[calls // 4, signal.SIGINT], [calls // 2, signal.SIGTERM]]
    for code, _, text in start(["node"], cases, "http://localhost:%d" % free_port()):
        assert code == 0 and "Traceback" not in text and "Exception" not in text, text


def test_a_node_that_heeds_no_ctrl_c_is_ended_otherwise(start, earlier_master):
    (_, calls, _), = start(["node", "node"], [[None, signal.SIGINT]], earlier_master)
    (code, _, text), = start(["deaf", "node"], [[calls - 20, signal.SIGINT]], earlier_master)
    assert code == 0 and "Traceback" not in text


def test_errors_of_the_start_are_told_and_leave_no_process(start, earlier_master):
    """A required node ends before the last one begins."""
    (code, _, text), = start(["node", 'short required="true"', "node"], [[None, 0]], earlier_master)
    assert code == 1 and "REQUIRED process [n1" in text


def test_a_generator_is_not_interrupted():
    """Python prints and drops an exception in one that is being thrown away."""
    end, seen = launch_end._End(None), []

    def look():
        seen.append(end._is_in_start(sys._getframe()))
        return True

    def start():
        look()
        all(look() for _ in range(1))

    end.starts = {start.__code__}
    start()
    assert seen == [True, False]


@pytest.mark.parametrize(("monitors", "is_signalled", "is_stopped"), [
    ([False], False, False), ([True], False, True), ([False], True, True),
    ([True, False], False, False)])  # an earlier launch has ended, as that of a rostest's first test
def test_a_process_that_begins_after_the_end_of_its_launch_is_stopped(monitors, is_signalled, is_stopped):
    pmon = SimpleNamespace(_pmons=[SimpleNamespace(is_shutdown=one) for one in monitors], _shutting_down=is_signalled)
    stops = []
    process = SimpleNamespace(env={}, args=["/bin/true"], stop=stops.append)
    assert launch_end._End(pmon).of_process(lambda process: True)(process)
    assert bool(stops) == is_stopped
