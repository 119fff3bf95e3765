# SPDX-License-Identifier: BSD-3-Clause
"""The start-up module of the lab's Python amends rospy, does not slow others down, and hides no other sitecustomize."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from rospy_fixes.table import FIXES

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))


def run(program, *folders):
    path = ":".join(str(folder) for folder in (OURS, *folders))
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          env={"PYTHONPATH": path, "PATH": "/usr/bin:/bin"})


def a_rospy(folder):
    """A fake rospy with the attributes that the hook uses."""
    (folder / "rospy").mkdir()
    (folder / "rospy/__init__.py").write_text("from .client import init_node\n")
    (folder / "rospy/client.py").write_text("def init_node(name):\n    return name\n")
    return folder


def test_programs_without_rospy_load_nothing_of_ours():
    done = run("import sys; print([name for name in sys.modules if name.startswith('rospy')])")
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_init_node_is_amended_wherever_it_is_taken_from(tmp_path):
    program = "import rospy; from rospy import init_node; print(rospy.init_node is init_node, init_node.__wrapped__)"
    done = run(program, a_rospy(tmp_path))
    assert done.stdout.startswith("True <function init_node") and done.stderr == ""


def test_every_amendment_is_applied_to_the_installed_module():
    # The workspace's messages are not in the path of this Python; their amendment has its own test.
    program = ("import importlib, sitecustomize, sys; from rospy_fixes import table; "
               "rows = [row for row in table.FIXES if row.where == table.EVERYWHERE and row.fix != 'former_fields']; "
               "[importlib.import_module(row.module) for row in rows]; "
               "print({row.module.partition('.')[0] for row in table.FIXES} - set(sitecustomize.AMENDED), "
               "[row for row in rows if 'rospy_fixes.' + row.fix not in sys.modules])")
    done = run(program)
    assert (done.stdout, done.stderr) == ("set() []\n", "")


def test_each_row_of_the_table_names_its_fix_and_a_test_of_it():
    package = Path(__file__).resolve().parents[2]
    for row in FIXES:
        assert (package / "src/rospy_fixes" / (row.fix.replace(".", "/") + ".py")).is_file()
        tests = [folder / row.test for folder in (package / "test/unit", package.parents[2])]
        assert any(path.is_file() for path in tests), row


def test_an_amendment_that_fails_leaves_the_module_as_it_is(tmp_path):
    a_rospy(tmp_path)
    (tmp_path / "rospy/client.py").write_text("def start():\n    pass\n")
    (tmp_path / "rospy/__init__.py").write_text("from .client import start\n")
    done = run("import rospy; print(rospy.start)", tmp_path)
    assert done.stdout.startswith("<function start") and "not amended" in done.stderr


def test_the_sitecustomize_that_is_hidden_runs_once(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("print('the next,', __name__, __file__)\n")
    done = run("pass", tmp_path)
    assert done.stdout == f"the next, sitecustomize {tmp_path}/sitecustomize.py\n"


def of_system_python(first_in_path, *words):
    done = subprocess.run(["/usr/bin/python3", *words], capture_output=True, text=True,
                          env={"PYTHONPATH": OURS, "PATH": "%s:/usr/bin:/bin" % first_in_path})
    return done.stdout, done.stderr


def test_a_users_script_for_debians_python_finds_what_python3_finds(tmp_path):
    found = tmp_path / ("lib/python%d.%d/site-packages" % sys.version_info[:2])
    found.mkdir(parents=True)
    (found / "numpy.py").write_text("FROM = 'the workspace'")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/python3").write_text("")
    script = tmp_path / "script.py"
    script.write_text("import numpy, yaml; print(getattr(numpy, 'FROM', 'Debian'))")
    assert of_system_python(tmp_path / "bin", script) == ("Debian\n", "")  # a folder, no virtual environment
    (tmp_path / "pyvenv.cfg").write_text("")
    for words in ((script,), ("-u", script), ("-W", "ignore", script), ("-X", "utf8", "-uc", script.read_text())):
        assert of_system_python(tmp_path / "bin", *words) == ("the workspace\n", "")
    assert of_system_python("/usr/bin", script) == ("Debian\n", "")


def test_the_systems_programs_keep_debians_packages():
    # They would find parts of cffi from both: the package of one version, its extension module of another.
    path = os.environ["PATH"].split(":")[0]
    done = of_system_python(path, "-W", "ignore", "/usr/bin/rosbag", "-h")
    assert "Traceback" not in done[1] and "play" in done[0]
    assert path.removesuffix("/bin") not in of_system_python(path, "-um", "site")[0]


def without_reader(program, *options):
    """(exit code, errors) of a program whose output nobody reads."""
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run([sys.executable, *options, "-c", program], stdout=write, stderr=subprocess.PIPE,
                              text=True, env={"PYTHONPATH": OURS, "PATH": "/usr/bin:/bin"})
    finally:
        os.close(write)
    return done.returncode, done.stderr


def test_a_program_whose_output_nobody_reads_any_more_ends_without_a_word():
    # At once, at the end, and by argparse's way out.
    assert without_reader("while True: print('line')") == (1, "")
    assert without_reader("print('line')") == (0, "")
    assert without_reader("import sys; print('line'); sys.exit(3)") == (3, "")
    assert without_reader("while True: print('line')", "-u") == (1, "")


def test_other_errors_are_reported_as_python_does():
    broken = "import socket; one, two = socket.socketpair(); two.close(); one.send(b'x')"
    for program in (broken, "1 / 0"):
        errors = run(program).stderr
        plain = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True)
        assert errors == plain.stderr != "" and plain.returncode == 1
    assert "ZeroDivisionError" in without_reader("print(1, flush=False); 1 / 0")[1]


def interrupted(program, *folders):
    """(how it ended, errors) of a program that gets Ctrl-C once it has printed a line."""
    path = ":".join(str(folder) for folder in (OURS, *folders))
    # A background job, as which tests may run, ignores Ctrl-C.
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + program
    started = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, env={"PYTHONPATH": path, "PATH": "/usr/bin:/bin"})
    started.stdout.readline()
    started.send_signal(signal.SIGINT)
    errors = started.communicate()[1]
    return started.returncode, errors


def test_ctrl_c_before_a_program_has_begun_leaves_no_traceback(tmp_path):
    wait = "print('here', flush=True)\nimport time; time.sleep(60)\n"
    (tmp_path / "slow.py").write_text(wait)
    (tmp_path / "nodes.py").write_text("def init_node():\n    " + wait.replace("\n", "\n    "))
    for program in ("import slow", "import nodes; nodes.init_node()"):
        assert interrupted(program, tmp_path) == (-signal.SIGINT, "")
    # A program that has imported rospy, before its node is ready.
    core = "import sys, types; sys.modules['rospy.core'] = types.SimpleNamespace(is_initialized=lambda: %s)\n"
    assert interrupted(core % False + wait) == (-signal.SIGINT, "")
    assert "KeyboardInterrupt" in interrupted(core % True + wait)[1]
    # A program of the system's, such as roslaunch while it reads its files.
    assert interrupted("__file__ = '/usr/bin/roslaunch'\n" + wait) == (-signal.SIGINT, "")
    # In the program itself the line where it was is of use.
    code, errors = interrupted(wait)
    assert code == -signal.SIGINT and "KeyboardInterrupt" in errors


def test_ctrl_c_that_was_held_back_in_pythons_start_ends_it_then(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import os; os.kill(os.getpid(), 2)")
    prefix = ("import signal, subprocess, sys; signal.signal(2, signal.default_int_handler); "
              "signal.pthread_sigmask(signal.SIG_BLOCK, {2}); print(subprocess.run([sys.executable, '-c', 'print(1)'], "
              "env={'PYTHONPATH': %r}))")
    done = subprocess.run([sys.executable, "-I", "-c", prefix % ("%s:%s" % (OURS, tmp_path))], capture_output=True,
                          text=True)
    assert "returncode=-2" in done.stdout and done.stderr == ""


def test_a_closed_output_is_no_error():
    for program in ("import sys; sys.stdout.close()", "import sys; sys.stdout = None"):
        done = run(program)
        assert (done.returncode, done.stderr) == (0, "")
