# SPDX-License-Identifier: BSD-3-Clause
"""The process that a student's program runs in: its limits, its end, and what it cannot reach. No master."""
import os
import resource
import subprocess
import time

import pytest

from lab_testing.waiting import wait_until
from processes import family, isolation
from rf_checks import hidden_paths, pacing, sandbox
from rf_checks.sandbox import KEPT_BYTES, OUTPUT_BYTES, RunningProgram, Startup, adopt_orphans

# What a sandbox's home has where the workspace is below a folder of the same name.
BELOW_HOME = [os.path.relpath(root, isolation.HOME).split("/")[0] for root in isolation.workspaces(os.environ)
              if root.startswith(isolation.HOME + "/")]
WALLS = pytest.param(True, marks=pytest.mark.skipif(bool(isolation.problem()), reason=isolation.problem()))


@pytest.fixture
def starter(tmp_path, monkeypatch):
    """A function that starts a program (text), with walls if its `has_walls` is set to True; ended afterwards."""
    workspace = tmp_path / "workspace"
    for name in (*hidden_paths.SOLVED, *hidden_paths.JUDGE):
        path = workspace / name
        if path.suffix == ".py":
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("secret")
        else:
            path.mkdir(parents=True, exist_ok=True)
            (path / "secret").write_text("42")
    monkeypatch.setenv("LAB_ROOT", str(workspace))
    monkeypatch.setenv("A_TOKEN", "secret")
    adopt_orphans()
    students = []

    def run(text, *words):
        folder = tmp_path / ("submission_%d" % len(students))
        folder.mkdir()
        (folder / "program.py").write_text(text)
        students.append(RunningProgram(folder / "program.py", words, dict(os.environ), run.has_walls))
        return students[-1]

    run.workspace = workspace
    yield run
    for student in students:
        student.end()


@pytest.fixture(params=[False, WALLS], ids=["trusted", "walls"])
def start(request, starter):
    starter.has_walls = request.param
    return starter


@pytest.fixture(params=[WALLS], ids=["walls"])
def walled(request, starter):
    starter.has_walls = request.param
    return starter


def finished(student):
    wait_until(lambda: student.exit_code is not None, "the program's end")
    student.end()
    return student


def test_words_output_and_exit_code_come_through(start):
    student = finished(start("import sys; print(sys.argv[1:]); print('oh', file=sys.stderr); sys.exit(3)", "a", "b c"))
    assert student.exit_code == 3
    assert student.output == "['a', 'b c']\n"
    assert student.errors == "oh\n"
    assert student.survivors == 0
    assert not os.path.exists(student.folder)


def test_what_outlives_the_program_is_found_and_ended(start):
    # A separate session, and no environment that could give it away.
    child = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import signal; signal.pause()'], " \
            "env={}, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)"
    before = family.children_of([os.getpid()])
    student = finished(start(child))
    # In a sandbox the child dies with its parent.
    assert student.survivors == (0 if start.has_walls else 1)
    wait_until(lambda: family.children_of([os.getpid()]) - before == set(), "the end of what it left behind")


def test_endless_output_neither_fills_memory_nor_stops_the_judge(start):
    student = start("while True: print('x' * 1000)")
    wait_until(lambda: student.excess() == "output", "%d bytes" % OUTPUT_BYTES)
    student.end()
    assert len(student.output) <= 2 * KEPT_BYTES + 8192


def test_the_memory_of_a_judge_is_no_limit_of_the_program(start):
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (3 << 30, hard))
    try:
        student = finished(start("import resource; print(resource.getrlimit(resource.RLIMIT_DATA)[0])"))
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
    assert student.output == "%d\n" % hard


def test_memory_of_all_processes_together_has_a_limit(start, monkeypatch):
    monkeypatch.setattr(sandbox, "MEMORY_BYTES", 200 << 20)
    student = start("import os, signal\n[os.fork() for _ in range(2)]\nheld = b'x' * (60 << 20)\nsignal.pause()")
    wait_until(lambda: student.excess() == "memory", "four processes with 60 MB each")


# Shared pages; pages that have been given back, but stay with the mapping; a mapping of two processes.
@pytest.mark.parametrize("text", [
    "held = mmap.mmap(-1, 300 << 20)\nheld.write(bytes(300 << 20))",
    "held = mmap.mmap(-1, 300 << 20)\nheld.write(bytes(300 << 20))\nheld.madvise(mmap.MADV_DONTNEED)",
    "held = [mmap.mmap(-1, 100 << 20) for _ in range(3)]\n[one.write(bytes(100 << 20)) for one in held]\nos.fork()"])
def test_shared_memory_counts(start, monkeypatch, text):
    monkeypatch.setattr(sandbox, "MEMORY_BYTES", 250 << 20)
    student = start("import mmap, os, signal\n%s\nprint('on', flush=True)\nsignal.pause()" % text)
    wait_until(lambda: student.excess() == "memory", "300 MB of shared memory")


def test_shared_memory_of_two_processes_counts_once(start, monkeypatch):
    monkeypatch.setattr(sandbox, "MEMORY_BYTES", 500 << 20)
    student = start("import mmap, os, signal\nheld = mmap.mmap(-1, 300 << 20)\nos.fork()\nprint('on', flush=True)\n"
                    "signal.pause()")
    wait_until(lambda: student.output.count("on") == 2, "both processes")
    assert student.excess() == ""


def test_memory_outside_of_processes_is_refused(walled):
    student = finished(walled(
        "import ctypes, errno, os\n"
        "try:\n    os.memfd_create('a')\n"
        "except OSError as error:\n    print(errno.errorcode[error.errno])\n"
        "libc = ctypes.CDLL(None, use_errno=True)\n"
        "for get in (libc.shmget, libc.semget, libc.msgget):\n"
        "    print(get(0, 4096, 0o1600), errno.errorcode[ctypes.get_errno()])"))
    assert student.output == "ENOSYS\n" + 3 * "-1 ENOSYS\n", student.errors


def test_no_namespace_in_which_it_may_mount(walled):
    student = finished(walled("import ctypes, errno, os, threading\n"
                              "libc = ctypes.CDLL(None, use_errno=True)\n"
                              "print(libc.unshare(0x10000000), errno.errorcode[ctypes.get_errno()])\n"
                              "print(libc.unshare(0))\n"
                              "thread = threading.Thread(target=print, args=('threads',))\n"
                              "thread.start()\n"
                              "thread.join()\n"
                              "os.system('echo processes')"))
    assert student.output.splitlines()[0] == "-1 ENOSYS", student.errors
    assert sorted(student.output.splitlines()[1:]) == ["0", "processes", "threads"]


def test_processes_have_a_limit(start, monkeypatch):
    monkeypatch.setattr(sandbox, "PROCESSES", 10)
    before = family.children_of([os.getpid()])
    student = start("import os, signal\nfor _ in range(12):\n    if os.fork() == 0: signal.pause()\nsignal.pause()")
    wait_until(lambda: student.excess() == "processes", "the thirteenth process")
    student.end()
    wait_until(lambda: family.children_of([os.getpid()]) - before == set(), "the end of all of them")


def test_threads_have_a_limit(start, monkeypatch):
    monkeypatch.setattr(sandbox, "THREADS", 10)
    student = start("import threading\ngate = threading.Event()\nfor _ in range(12):\n"
                    "    threading.Thread(target=gate.wait).start()\n")
    wait_until(lambda: student.excess() == "threads", "the eleventh thread")


@pytest.mark.parametrize(("pairs", "excess"), [(4, ""), (6, "sockets")])
def test_sockets_have_a_limit_and_those_that_processes_share_count_once(start, monkeypatch, pairs, excess):
    monkeypatch.setattr(sandbox, "SOCKETS", 10)
    student = start("import os, resource, signal, socket\nheld = [socket.socketpair() for _ in range(%d)]\n"
                    "for _ in range(3):\n    if os.fork() == 0: signal.pause()\n"
                    "print(resource.getrlimit(resource.RLIMIT_NOFILE)[1], flush=True)\nsignal.pause()\n" % pairs)
    wait_until(lambda: student.output, "its first line")
    assert (student.output.strip(), student.excess()) == ("1024", excess)


def test_files_and_folders_have_a_limit_even_empty_ones(walled, monkeypatch):
    monkeypatch.setattr(sandbox, "ENTRIES", 100)
    text = ("import os, signal\nfor number in range(%d):\n    for top in ('/tmp', '/run', os.path.expanduser('~')):\n"
            "        os.mkdir('%%s/%%d' %% (top, number))\nprint('on', flush=True)\nsignal.pause()")
    for count, excess in ((10, ""), (50, "files")):
        student = walled(text % count)
        wait_until(lambda student=student: student.output or student.exit_code is not None, "its folders")
        assert student.excess() == excess, student.errors


def test_a_program_that_loops_says_where_it_is(start):
    student = start("print('on', flush=True)\nn = 0\nwhile True:\n    n += 1\n")
    wait_until(lambda: student.output, "its first line")
    before = pacing.cpu_time_s(student.family())
    wait_until(lambda: pacing.cpu_time_s(student.family()) > before + 0.1, "it to be in its loop")
    student.dump()
    assert "line 4" in student.errors or "line 3" in student.errors
    student.end()
    assert student.exit_code is not None


def test_files_have_a_limit(start):
    student = finished(start("open('big', 'wb').write(bytes(50 << 20))"))
    assert "File too large" in student.errors


def test_modules_beside_the_program_come_along_and_nothing_else(start, tmp_path):
    folder = tmp_path / "submission_0"
    program = "import helper, os\nfrom parts import wheel\nprint(helper.NAME, wheel.NAME, sorted(os.listdir(" \
              "os.path.dirname(os.path.abspath(__file__)))))"
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wheel.py").write_text("NAME = 'wheel'")
    (tmp_path / "helper.py").write_text("import hub\nNAME = hub.NAME")
    (tmp_path / "hub.py").write_text("NAME = 'hub'")
    (tmp_path / "another_students.py").write_text("NAME = 'secret'")
    (tmp_path / "program.py").write_text(program)
    assert not folder.exists()
    student = finished(RunningProgram(tmp_path / "program.py", [], dict(os.environ), start.has_walls))
    beside = ["helper.py", "hub.py", "parts", "program.py", *(BELOW_HOME if start.has_walls else [])]
    assert student.output == "hub wheel %s\n" % sorted(beside), student.errors


def test_the_judge_its_files_and_the_solutions_are_out_of_sight(walled, tmp_path):
    (tmp_path / "planted").write_text("42")
    student = finished(walled(
        "import os\nfound = []\n"
        "for folder, _, files in os.walk(os.environ['LAB_ROOT']):\n"
        "    for name in files:\n"
        "        try:\n"
        "            found += [name] if open(os.path.join(folder, name)).read() else []\n"
        "        except OSError:\n"
        "            pass\n"
        "print(found)\n"
        "print(os.path.exists(%r), os.path.exists('/etc/shadow'), os.listdir('/dev/shm'))\n"
        "print('A_TOKEN' in os.environ)\n"
        "print(sorted(int(n) for n in os.listdir('/proc') if n.isdigit()))" % str(tmp_path / "planted")))
    assert student.output.splitlines() == ["[]", "False False []", "False", "[1, 2]"], student.errors


def test_other_submissions_in_the_workspace_are_out_of_sight(walled, tmp_path):
    submissions, archive = walled.workspace / "class", walled.workspace / "class.zip"
    (submissions / "li").mkdir(parents=True)
    for path in (submissions / "li" / "wave.py", archive, walled.workspace / "handed_out.py"):
        path.write_text("42")
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "program.py").write_text(
        "import os\n"
        "for name in ('class/li/wave.py', 'class', 'class.zip', 'handed_out.py'):\n"
        "    path = os.path.join(os.environ['LAB_ROOT'], name)\n"
        "    try:\n"
        "        print(os.listdir(path) if os.path.isdir(path) else open(path).read())\n"
        "    except OSError as error:\n"
        "        print(type(error).__name__)\n")
    startup = Startup(folder, {}, hidden=(str(submissions), str(archive), str(tmp_path / "elsewhere")))
    student = finished(RunningProgram(folder / "program.py", [], dict(os.environ), True, startup))
    assert student.output.splitlines() == ["FileNotFoundError", "[]", "PermissionError", "42"], student.errors
    student.end()


def test_nothing_but_its_own_folders_can_be_written(walled):
    student = finished(walled(
        "import os, sys\n"
        "for path in (os.environ['LAB_ROOT'], '/usr', '/etc', '/', '/dev', '/opt', sys.prefix, '/proc/sys/kernel'):\n"
        "    try:\n"
        "        open(path + '/planted', 'w')\n"
        "        print('wrote below', path)\n"
        "    except OSError:\n"
        "        pass\n"
        "for path in ('.bashrc', '.profile', '.local/lib/python3/site-packages/usercustomize.py'):\n"
        "    path = os.path.expanduser('~/' + path)\n"
        "    os.makedirs(os.path.dirname(path), exist_ok=True)\n"
        "    open(path, 'w').write('planted')\n"
        "print('done')"))
    assert student.output == "done\n", student.errors
    listed = finished(walled("import os; print(sorted(os.listdir(os.path.expanduser('~'))))")).output
    assert listed == "%s\n" % sorted(["program.py", *BELOW_HOME])


def test_what_it_writes_has_a_limit(walled):
    student = finished(walled(
        "import os\n"
        "for folder in (os.path.expanduser('~'), '/tmp', '/dev/shm', '/var/tmp', '/run'):\n"
        "    total = 0\n"
        "    try:\n"
        "        for k in range(40):\n"
        "            total += open('%s/%d' % (folder, k), 'wb', buffering=0).write(bytes(10 << 20))\n"
        "    except OSError as error:\n"
        "        pass\n"
        "    print(total <= 64 << 20)"))
    assert student.output == "True\n" * 5, student.errors


def test_no_capability_and_no_way_to_more(walled):
    student = finished(walled(
        "import ctypes, os, subprocess\n"
        "status = dict(line.split(':', 1) for line in open('/proc/self/status'))\n"
        "print(status['CapEff'].strip(), status['CapPrm'].strip(), status['NoNewPrivs'].strip())\n"
        "libc = ctypes.CDLL(None, use_errno=True)\n"
        "print(libc.mount(b'none', b'/usr', b'tmpfs', 0, None), libc.umount(b'/usr'), libc.chroot(b'/tmp'))"))
    assert student.output == "0000000000000000 0000000000000000 1\n-1 -1 -1\n", student.errors


def test_settings_of_the_kernel_keys_of_the_user_and_the_hosts_sockets_are_out_of_reach(walled):
    # The superuser needs no capability to write the first one, with which a crash would start a program outside.
    student = finished(walled(
        "import ctypes, os, socket\n"
        "def add_key():\n"
        "    number = {'x86_64': 248, 'aarch64': 217}[os.uname().machine]\n"
        "    if ctypes.CDLL(None).syscall(number, b'user', b'name', b'x', 1, -4) < 0:\n"
        "        raise OSError\n"
        "for attempt in (lambda: open('/proc/sys/kernel/core_pattern', 'w').write('core'), add_key,\n"
        "                lambda: socket.socket(socket.AF_VSOCK)):\n"
        "    try:\n"
        "        attempt()\n"
        "        print('reached')\n"
        "    except OSError:\n"
        "        print('refused')"))
    assert student.output == "refused\n" * 3, student.errors


def test_a_program_that_stops_its_own_sandbox_is_ended(walled):
    before = family.children_of([os.getpid()])
    student = walled("import ctypes\nctypes.CDLL(None).ptrace(16, 1, 0, 0)\nprint('attached', flush=True)\n"
                     "import signal\nsignal.pause()")
    wait_until(lambda: student.output, "the first process of the sandbox to be stopped")
    student.end()
    wait_until(lambda: family.children_of([os.getpid()]) - before == set(), "the end of the sandbox")


def test_its_network_ends_at_the_loopback(walled):
    student = finished(walled(
        "import errno, socket\nprint(sorted(name for _, name in socket.if_nameindex()))\n"
        "try:\n    socket.create_connection(('192.0.2.1', 80), 5)\n"
        "except OSError as error:\n    print(errno.errorcode.get(error.errno))"))
    assert student.output == "['lo']\nENETUNREACH\n", student.errors


def test_a_watch_tells_work_from_rest(start):
    student = start("import signal\nprint('on', flush=True)\nsignal.pause()")
    wait_until(lambda: student.output, "its first line")
    watch = pacing.Watch()
    watch.program.roots = (student.pid,)
    wait_until(watch.wait_until_rest, "a program that sleeps to rest")
    busy = start("print('on', flush=True)\nwhile True: pass")
    wait_until(lambda: busy.output, "its first line")
    watch.program.roots = (busy.pid,)
    for _ in range(3):
        before = pacing.cpu_time_s(busy.family())
        assert not watch.wait_until_rest()
        # Waiting for a processor does not count: only the used processor time counts.
        assert pacing.cpu_time_s(busy.family()) - before > 0.9 * pacing.PROGRAM_ALLOWANCE_S
    watch.close()


def test_a_wait_that_looks_like_one_for_a_disk_holds_the_world_no_longer_than_its_allowance(start, monkeypatch):
    monkeypatch.setattr(pacing, "DISK_ALLOWANCE_S", 0.3)
    # The child opens a pipe that nobody writes to, before it becomes another program: until then its parent waits.
    student = start("import os\nos.mkfifo('pipe')\nprint('on', flush=True)\n"
                    "os.posix_spawn('/bin/true', ['true'], {}, file_actions=[(os.POSIX_SPAWN_OPEN, 5, 'pipe', 0, 0)])")
    wait_until(lambda: student.output, "its first line")
    watch = pacing.Watch()
    watch.program.roots = (student.pid,)
    watch.program.renew()
    wait_until(lambda: watch.program.runs() and watch.program.waits_for_disk, "the wait")
    deadline = time.monotonic() + 20.0
    watch.gives_up = lambda: time.monotonic() > deadline
    assert watch.wait_until_rest()
    assert watch.program.disk_s >= 0.3
    assert watch.wait_until_rest()
    watch.close()


def test_a_process_that_got_the_number_of_an_ended_program_is_a_stranger(start):
    with subprocess.Popen(["sleep", "1000"]) as stranger:
        student = start("")
        wait_until(lambda: student.exit_code is not None, "the program's end")
        student._process.pid = stranger.pid
        student.end()
        assert student.survivors == 0
        assert stranger.poll() is None
        stranger.kill()


def test_a_walled_program_does_not_outlive_a_judge_that_is_killed(walled):
    code = "import os, sys\nfrom rf_checks.sandbox import RunningProgram\n" \
           "s = RunningProgram(sys.argv[1], [], dict(os.environ))\n" \
           "print(s.pid, flush=True)\nimport signal; signal.pause()"
    program = walled.workspace / "sleeps.py"
    program.write_text("import signal\nsignal.pause()")
    # The killed judge leaves its folder.
    own = {**os.environ, "TMPDIR": str(walled.workspace)}
    with subprocess.Popen([sandbox.python(), "-c", code, str(program)], env=own, stdout=subprocess.PIPE,
                          text=True) as judge:
        root = int(judge.stdout.readline())
        wait_until(lambda: any(_command(pid).startswith("python") for pid in family.children_of([root]) - {root}),
                   "the program to run")
        processes = family.children_of([root])
        judge.kill()
    wait_until(lambda: not any(_lives(pid) for pid in processes), "the end of %s" % processes)


def _command(pid):
    try:
        with open("/proc/%d/comm" % pid, encoding="utf-8") as file:
            return file.read()
    except OSError:
        return ""


def _lives(pid):
    try:
        with open("/proc/%d/stat" % pid, encoding="ascii") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_a_refusal_says_why_and_what_to_do(monkeypatch):
    for name, words in (("kernel/apparmor_restrict_unprivileged_userns", "apparmor_restrict_unprivileged_userns=0"),
                        ("kernel/unprivileged_userns_clone", "unprivileged_userns_clone=1"),
                        ("user/max_user_namespaces", "max_user_namespaces=10000"), ("", "most containers")):
        monkeypatch.setattr(isolation, "_switched_off", lambda asked, _, name=name: asked == name)
        reason = isolation._reason("Operation not permitted")
        assert words in reason
        assert "Operation not permitted" in reason
        assert "seccomp=unconfined" in reason


def test_a_machine_without_walls_is_asked_for_trust(monkeypatch, tmp_path):
    from rf_checks.judge import Judge

    monkeypatch.setattr(isolation, "problem", lambda: "this kernel refuses")
    with pytest.raises(isolation.NotIsolated, match="--trusted"):
        Judge()
