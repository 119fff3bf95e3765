# SPDX-License-Identifier: BSD-3-Clause
"""Run by every Python that starts in the lab's environment: amends some modules when they are imported, and lets a
program whose output nobody reads any more end without an error. Debian's Python gets the workspace's packages as well.

It imports only what Python has loaded or built in, so other programs are not slowed down. docs/decisions/0008 says why
it is done this way.
"""
import _signal  # pyright: ignore[reportMissingImports]
import atexit
import os
import site
import sys

#: The packages of which modules are amended: rospy_fixes.table has the rows, and is read when one of them is imported.
AMENDED = ("rospy", "rosgraph", "roslaunch", "actionlib", "catkin", "moveit_msgs", "gazebo_msgs")

#: Folders of the system's programs.
SYSTEM_FOLDERS = ("/usr/bin/", "/usr/sbin/", "/usr/lib/", "/usr/share/", "/bin/", "/sbin/", "/opt/ros/")


class AmendingFinder:
    """A finder for sys.meta_path: it finds nothing itself, but amends modules after they are loaded."""

    done = set()

    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition(".")[0] not in AMENDED or name in cls.done:
            return None
        cls.done.add(name)
        try:
            from rospy_fixes.table import on_import
        except ImportError:  # Python without the rest of the workspace
            return None
        fixes = on_import(name)
        for finder in sys.meta_path if fixes else ():
            spec = None if finder is AmendingFinder else finder.find_spec(name, path, target)
            if spec is not None:
                _amend_when_loaded(spec.loader, fixes)
                return spec
        return None


def _amend_when_loaded(loader, fixes):
    load = loader.exec_module

    def exec_module(module):
        load(module)
        # A program must not fail because of an amendment; without it, it runs as in plain ROS.
        for fix in fixes:
            try:
                fix.amend(module)
            except Exception as error:
                sys.stderr.write("%s: not amended by %s: %r\n" % (module.__name__, fix.fix, error))

    loader.exec_module = exec_module


def _add_the_workspaces_packages() -> None:
    """Let a user's script that begins with `#!/usr/bin/python3` import what `python3` does.

    The virtual environment is the one that comes first in PATH. Its packages come before Debian's, as for its own
    Python: a package's parts from both would not fit each other. The system's programs keep Debian's alone.
    """
    # Python 3.9 and older, whose packages are others, do not say what they run.
    if sys.prefix != "/usr" or not _is_a_users(_program(getattr(sys, "orig_argv", ["", "-m"])[1:])):
        return
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        if os.path.isfile(os.path.join(folder, "python3")):
            environment = os.path.dirname(folder)
            packages = "%s/lib/python%d.%d/site-packages" % (environment, *sys.version_info[:2])
            if os.path.isfile(os.path.join(environment, "pyvenv.cfg")) and os.path.isdir(packages):
                debians = [place for place, entry in enumerate(sys.path) if entry in site.getsitepackages()]
                sys.path.insert(min(debians, default=len(sys.path)), packages)
            return


def _program(words: list) -> str:
    """The program that Python runs when called with `words`: a file, "-c" or "-m"; "" where its user types."""
    rest = iter(words)
    for word in rest:
        if not word.startswith("-"):
            return word
        option = "" if word.startswith("--") else next((sign for sign in word if sign in "cmWX"), "")
        if option in ("c", "m"):
            return "-" + option
        if word == "--check-hash-based-pycs" or (option and word.endswith(option)):
            next(rest, "")  # the option's value
    return ""


def _is_a_users(program: str) -> bool:
    """Whether a program is something else than a module or a program of the system."""
    return program != "-m" and not program.startswith(SYSTEM_FOLDERS)


def _run_the_next():
    """Run the sitecustomize that this one hides: the system's, or one that the user has put in PYTHONPATH."""
    for folder in sys.path:
        path = os.path.join(folder, "sitecustomize.py")
        if not os.path.isdir(os.path.join(folder, "rospy_fixes")) and os.path.isfile(path):
            with open(path, "rb") as file:
                exec(compile(file.read(), path, "exec"), {"__name__": "sitecustomize", "__file__": path})
            return


def _report(kind, error, trace):
    """An uncaught exception: as Python does, but `program | head` ends without one, as other programs of Unix do, and
    so does a program that Ctrl-C ends before it has begun."""
    is_early = issubclass(kind, KeyboardInterrupt) and not hasattr(sys, "ps1") and _is_starting(trace)
    if not is_early and not (issubclass(kind, BrokenPipeError) and _has_lost_reader()):
        sys.__excepthook__(kind, error, trace)


def _is_starting(trace):
    """Whether a program was interrupted before it had begun: while it imported a module, or, if it has imported rospy,
    before its node was ready. The system's programs have no line of their user's to tell at all."""
    core = sys.modules.get("rospy.core")
    program = getattr(sys.modules.get("__main__"), "__file__", None) or ""
    if program.startswith(SYSTEM_FOLDERS) or not getattr(core, "is_initialized", lambda: True)():
        return True
    while trace is not None:
        code, name = trace.tb_frame.f_code, trace.tb_frame.f_globals.get("__name__", "")
        # Python leaves its own frames of an import out of most traces; the module's remains.
        if code.co_name == "init_node" or name.startswith("importlib.") or (
                code.co_name == "<module>" and name != "__main__"):
            return True
        trace = trace.tb_next
    return False


def _has_lost_reader():
    """Whether nobody reads the standard output any more; what is still to be written is then dropped."""
    from rospy_fixes import lost_reader
    return lost_reader.is_lost()


def _flush():
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _has_lost_reader()
    except (AttributeError, OSError, ValueError):
        pass  # there is none, or it is closed; Python itself reports what else is wrong with it


def _let_ctrl_c_through():
    """Ctrl-C in Python's start is told as a fatal error, so a roslaunch of the lab's (launch_end) holds it back until
    now. If it has come, the process ends as other programs do."""
    if _signal.SIGINT in _signal.sigpending() and _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    _signal.pthread_sigmask(_signal.SIG_UNBLOCK, {_signal.SIGINT})


_add_the_workspaces_packages()
sys.meta_path.insert(0, AmendingFinder)
sys.excepthook = _report
# The first function that is registered is the last one that runs.
atexit.register(_flush)
try:
    _run_the_next()
finally:
    _let_ctrl_c_through()
