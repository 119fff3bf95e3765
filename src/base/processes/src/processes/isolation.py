# SPDX-License-Identifier: BSD-3-Clause
"""A sandbox for programs, from bubblewrap and the kernel's namespaces. Free of ROS; Linux only.

A process and its children can move to a separate network namespace, with a loopback and nothing else (`enter_network`).
A sandbox (`command`) has own processes and own /dev/shm, a home and a /tmp of limited size that are deleted afterwards,
and only those parts of the machine that programs need, read-only. The caller names what of the workspace is hidden.
"""
from __future__ import annotations

import ctypes
import errno
import fcntl
import functools
import os
import shutil
import socket
import struct
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

HOME = "/home/student"
#: This variable says that a process is in the sandbox of its user's lab already: the user's own programs need no other.
WALLED = "LAB_WALLED"
#: The writable folders of a sandbox; of the first two a lab may have larger ones.
FOLDERS = ("/dev/shm", "/tmp", "/var/tmp", "/run", HOME)
#: Size limit of a writable folder of a sandbox [bytes].
FOLDER_BYTES = 64 << 20
# Files of /etc that programs need to start; none with passwords.
_ETC = ("alternatives", "fonts", "group", "host.conf", "hosts", "ld.so.cache", "ld.so.conf", "ld.so.conf.d",
        "localtime", "machine-id", "mime.types", "nsswitch.conf", "OpenCL", "passwd", "protocols", "python3", "ros",
        "services", "timezone", "vulkan", "glvnd", "catkin", "matplotlibrc")
_SYSTEM = ("/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32")
_PATHS = ("PYTHONPATH", "ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH")
# Variables that a program gets: those of ROS, of the language, and where programs and libraries are.
_VARIABLES = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "CMAKE_PREFIX_PATH", "PKG_CONFIG_PATH", "LAB_ROOT", "LANG",
              "LANGUAGE", "TZ", "TERM", "PYTHONUNBUFFERED", "PYTHONDONTWRITEBYTECODE", "SHELL", "GAZEBO_RESOURCE_PATH",
              "GAZEBO_MODEL_PATH")
_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 0x1
_PROBE_S = 20.0
_Path = str | os.PathLike

_network: str | None = None
_network_problem = ""


class NotIsolated(Exception):
    """This machine does not allow a sandbox; the text says why, and what can be done."""


def enter_network() -> None:
    """Move this process into a network namespace that has a loopback and nothing else. Raises NotIsolated.

    To be called before any thread starts; child processes that it starts later are in it, too.
    """
    global _network
    if _network is not None:
        return
    uid, gid = os.getuid(), os.getgid()
    libc = ctypes.CDLL(None, use_errno=True)
    # Root needs no user namespace for it.
    if libc.unshare(_CLONE_NEWNET) != 0 and libc.unshare(_CLONE_NEWUSER | _CLONE_NEWNET) != 0:
        raise NotIsolated(_reason(errno.errorcode.get(ctypes.get_errno(), "?")))
    try:
        if not Path("/proc/self/uid_map").read_text(encoding="ascii").strip():
            Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
            Path("/proc/self/uid_map").write_text("%d %d 1" % (uid, uid), encoding="ascii")
            Path("/proc/self/gid_map").write_text("%d %d 1" % (gid, gid), encoding="ascii")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            request = struct.pack("16sH14x", b"lo", 0)
            flags = struct.unpack("16sH14x", fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request))[1]
            fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", flags | _IFF_UP))
    except OSError as error:
        raise NotIsolated("the loopback of the separate network does not come up: %s. %s"
                          % (error.strerror, _REMEDY)) from error
    _network = os.readlink("/proc/self/ns/net")


def try_to_enter_network() -> None:
    """As `enter_network`; if that fails, `problem` returns the reason from then on."""
    global _network_problem
    try:
        enter_network()
    except NotIsolated as refusal:
        _network_problem = str(refusal)


def has_own_network() -> bool:
    """Whether `enter_network` has been called in this process."""
    return _network is not None


_REMEDY = ("In Docker, start the container with --security-opt seccomp=unconfined --security-opt apparmor=unconfined "
           "--cap-add SYS_ADMIN to have them")


def _switched_off(name: str, value: str) -> bool:
    try:
        return Path("/proc/sys/" + name).read_text(encoding="ascii").strip() == value
    except OSError:
        return False


def _reason(what: str) -> str:
    """Why namespaces are refused, and the remedy."""
    if _switched_off("kernel/apparmor_restrict_unprivileged_userns", "1"):
        return ("AppArmor of this Ubuntu forbids namespaces to ordinary users (%s). As root, once: sysctl -w "
                "kernel.apparmor_restrict_unprivileged_userns=0, or load AppArmor's profile bwrap-userns-restrict "
                "(package apparmor-profiles) and run this as root. %s" % (what, _REMEDY))
    if _switched_off("kernel/unprivileged_userns_clone", "0"):
        return ("this kernel forbids namespaces to ordinary users (%s). As root, once: sysctl -w "
                "kernel.unprivileged_userns_clone=1. %s" % (what, _REMEDY))
    if _switched_off("user/max_user_namespaces", "0"):
        return ("this kernel allows no user namespaces (%s). As root, once: sysctl -w user.max_user_namespaces=10000. "
                "%s" % (what, _REMEDY))
    return "the kernel refuses namespaces (%s), as it does in most containers. %s" % (what, _REMEDY)


def problem() -> str:
    """Why no sandbox can be made here: a sentence with the remedy, or "" without a problem."""
    return _network_problem or _bubblewrap_problem()


@functools.cache
def _bubblewrap_problem() -> str:
    if shutil.which("bwrap") is None:
        return "bubblewrap is not installed (apt install bubblewrap, or ./baxter.sh setup). " + _REMEDY
    probe = ["bwrap", *_base(), "--", "/bin/sh", "-c", "exit 0"]
    try:
        done = subprocess.run(probe, capture_output=True, text=True, timeout=_PROBE_S, stdin=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired) as error:
        return "bubblewrap does not run: %s. %s" % (error, _REMEDY)
    return "" if done.returncode == 0 else _reason(done.stderr.strip().replace("\n", "; ") or "bwrap failed")


@functools.cache
def _can_limit_size() -> bool:
    done = subprocess.run(["bwrap", "--help"], capture_output=True, text=True)
    return "--size" in done.stdout + done.stderr


def _folder(path: str, size: int) -> list[str]:
    return [*(("--size", str(size)) if _can_limit_size() else ()), "--perms", "0700", "--tmpfs", path]


def _base(scratch_bytes: int = FOLDER_BYTES) -> list[str]:
    """Options of every sandbox: namespaces, the system read-only, and folders of its own."""
    options = ["--unshare-pid", "--unshare-ipc", "--unshare-uts", "--unshare-cgroup-try", "--die-with-parent",
               "--cap-drop", "ALL", "--ro-bind", "/usr", "/usr"]
    for path in _SYSTEM:
        if os.path.islink(path):
            options += ["--symlink", os.readlink(path), path]
        elif os.path.isdir(path):
            options += ["--ro-bind", path, path]
    for path in ("/opt", *("/etc/" + name for name in _ETC), "/sys/devices/system/cpu", "/var/lib/fonts"):
        options += ["--ro-bind-try", path, path]
    # The settings of Linux belong to the superuser, who needs no privilege to write them, and may run a class.
    options += ["--proc", "/proc", "--ro-bind", "/proc/sys", "/proc/sys", "--dev", "/dev"]
    for path in FOLDERS:
        options += _folder(path, scratch_bytes if path in FOLDERS[:2] else FOLDER_BYTES)
    return options


def workspaces(environment: Mapping[str, str]) -> list[str]:
    """Folders outside the system that programs need: the workspace, Python's, sourced workspaces."""
    found = [environment.get("LAB_ROOT", ""), sys.prefix, sys.base_prefix, os.path.dirname(sys.executable)]
    for name in _PATHS:
        found += environment.get(name, "").split(":")
    real = {os.path.realpath(path) for path in found if path and os.path.isdir(path)}
    roots = {str(Path(path).parent) if os.path.basename(path) in ("src", "devel") else path for path in real}
    roots = {path for path in roots if not _is_system(path)}
    # Folders inside another one are included with it.
    return sorted(path for path in roots if not any(path != other and path.startswith(other + "/") for other in roots))


def _is_system(path: str) -> bool:
    return path == "/" or any(path == top or path.startswith(top + "/") for top in ("/usr", "/opt", *_SYSTEM))


def _hide(roots: Iterable[str], names: Iterable[str]) -> list[str]:
    options: list[str] = []
    for root in roots:
        for name in names:
            path = os.path.join(root, name)
            if not path.startswith(root + "/"):
                continue  # an absolute name elsewhere, which no sandbox shows
            if os.path.isdir(path):
                options += ["--tmpfs", path, "--remount-ro", path]
            elif os.path.exists(path):
                options += ["--ro-bind", "/dev/null", path]
    return options


def command(environment: Mapping[str, str], binds: Iterable[tuple[_Path, _Path, bool]] = (), hidden: Iterable[str] = (),
            own_network: bool = False, further: Iterable[str] = (), scratch_bytes: int = FOLDER_BYTES) -> list[str]:
    """The command prefix that starts a command in a separate sandbox.

    environment: of the command; it shows which workspace is needed. binds: (source, target, writable) of further files
    and folders. hidden: names below the workspace, or absolute paths, that are not shown. own_network: for a process
    that has not called `enter_network`. further: more options of bubblewrap. Raises NotIsolated.
    """
    if problem():
        raise NotIsolated(problem())
    roots = workspaces(environment)
    around, inside = [], []
    for source, target, writable in binds:
        # A workspace may be in the folder that a home stands for, as in the container's /home/student.
        is_around = any(root.startswith("%s/" % target) for root in roots)
        (around if is_around else inside).extend(["--bind" if writable else "--ro-bind", str(source), str(target)])
    options = _base(scratch_bytes) + around
    for root in roots:
        options += ["--ro-bind", root, root]
    options += _hide(roots, hidden) + inside
    # Parent folders that bubblewrap makes are in memory, without a size limit.
    options += ["--remount-ro", "/dev", "--remount-ro", "/", "--chdir", HOME]
    return ["bwrap", *options, *(("--unshare-net",) if own_network else ()), *further, "--"]


def environment_of(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables of an environment that a sandboxed program gets: no token or agent of the user."""
    kept = {name: value for name, value in environment.items()
            if name in _VARIABLES or name.startswith(("ROS_", "ROSCONSOLE_", "LC_"))}
    return {**kept, "HOME": HOME, "TMPDIR": "/tmp", "ROS_HOME": HOME + "/.ros", "ROS_LOG_DIR": HOME + "/log",
            "XDG_RUNTIME_DIR": "/run", "USER": "student", "LOGNAME": "student"}


def caches(environment: Mapping[str, str], folder: _Path) -> list[tuple[Path, Path, bool]]:
    """Copies of what numba has compiled and of spheres that stand for robots' links, as `binds` for `command`: they are
    used only where they could be written, beside the source.

    folder: folder of the copies, used by nothing else, so that a sandbox cannot change the originals. Raises OSError.
    """
    binds: list[tuple[Path, Path, bool]] = []
    for root in workspaces(environment):
        for path, names, _ in os.walk(os.path.join(root, "src")):
            names[:] = [name for name in names if not name.startswith(".") and name not in ("meshes", "node_modules")]
            if "__pycache__" in names:
                names.remove("__pycache__")
                cache = Path(path) / "__pycache__"
                if any(next(cache.rglob(kind), None) for kind in ("*.nbi", "*.npy")):
                    copy = Path(folder) / ("cache-%d" % len(binds))
                    _copy(cache, copy)
                    binds.append((copy, cache, True))
    return binds


def _copy(source: Path, target: Path) -> None:
    try:
        shutil.copytree(source, target)
    except shutil.Error as error:
        # It lists each file, hundreds on a full disk, mostly with one reason.
        reasons = {str(reason).partition(": '")[0] for _, _, reason in error.args[0]}
        raise OSError("%s cannot be copied to %s: %s" % (source, target, "; ".join(sorted(reasons)[:3]))) from error
