# SPDX-License-Identifier: BSD-3-Clause
"""The keeper ends its command when its owner is gone, in any way."""
import signal
import subprocess
import sys

import pytest

from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from processes import keeper

DEADLINE_S = 90.0
# A child that ignores SIGINT and SIGTERM, of a command that ends on Ctrl-C.
STUBBORN = """import signal, sys
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
open(sys.argv[1], "w").write("up")
signal.pause()
"""
COMMAND = """import signal, subprocess, sys
folder = sys.argv[1]
child = subprocess.Popen([sys.executable, folder + "/stubborn.py", folder + "/up"])
open(folder + "/pid", "w").write(str(child.pid))
try:
    signal.pause()
except KeyboardInterrupt:
    open(folder + "/ended", "w").write("ended")
"""


def keep(state, *command):
    return subprocess.Popen([sys.executable, keeper.__file__, str(state), *command], stdin=subprocess.PIPE,
                            start_new_session=True)


@pytest.fixture
def kept(tmp_path):
    """A running keeper, its state file, and the folder that its command writes to."""
    (tmp_path / "stubborn.py").write_text(STUBBORN)
    (tmp_path / "command.py").write_text(COMMAND)
    process = keep(tmp_path / "state", sys.executable, str(tmp_path / "command.py"), str(tmp_path))
    try:
        wait_until(lambda: (tmp_path / "up").exists() and (tmp_path / "pid").exists(), "the command does not start")
        yield process, tmp_path / "state", tmp_path
    finally:
        process.stdin.close()
        process.wait(DEADLINE_S)


def test_state_is_locked_while_it_runs(kept):
    process, state, _ = kept
    assert keeper.is_held(state) and state.read_text().startswith("running\n" + sys.executable)
    process.stdin.close()
    assert process.wait(DEADLINE_S) == 0
    assert not keeper.is_held(state) and not state.exists()


def test_command_gets_ctrl_c_and_what_it_leaves_is_killed(kept):
    process, _, folder = kept
    child = int((folder / "pid").read_text())
    process.stdin.close()
    process.wait(DEADLINE_S)
    assert (folder / "ended").read_text() == "ended"
    assert not is_alive(child)


def test_ctrl_c_and_kill_of_the_keeper_itself_change_nothing(kept):
    process, state, folder = kept
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        process.send_signal(number)
    process.stdin.write(b"a word\n")
    process.stdin.flush()
    wait_until(lambda: keeper.is_held(state), "the keeper has gone")
    assert process.poll() is None and is_alive(int((folder / "pid").read_text()))


def test_command_that_ends_by_itself_hands_its_status_on(tmp_path):
    assert keep(tmp_path / "state", "sh", "-c", "exit 7").wait(DEADLINE_S) == 7
