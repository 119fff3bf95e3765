#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs in a lab and tries to reach what lies outside of it; writes the results to ~/report.json.

The file has {attempt: result}; a result is "reached" or the error.
"""
import ctypes
import json
import os
import socket
import sys
from pathlib import Path

_CLONE_NEWUSER = 0x10000000


def connect(family, address):
    with socket.socket(family) as connection:
        connection.settimeout(5.0)
        connection.connect(address)


def new_namespace():
    if ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWUSER) != 0:
        raise OSError(ctypes.get_errno(), "unshare")


def mount(folder):
    if ctypes.CDLL(None, use_errno=True).mount(b"none", bytes(folder), b"tmpfs", 0, None) != 0:
        raise OSError(ctypes.get_errno(), "mount")


def write_and_remove(path):
    path.write_text("x")
    path.unlink()


def find_process(word):
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if entry.parent.name != str(os.getpid()) and word.encode() in entry.read_bytes():
                return
        except OSError:
            continue
    raise LookupError("no process has %s in its command" % word)


def add_key():
    """To the keys of this user, which all of its processes on the machine share."""
    numbers = {"x86_64": 248, "aarch64": 217}  # add_key in asm/unistd.h
    user_keyring = -4  # KEY_SPEC_USER_KEYRING of linux/keyctl.h
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(numbers[os.uname().machine], b"user", b"intruder", b"x", 1, user_keyring) < 0:
        raise OSError(ctypes.get_errno(), "add_key")


def open_queue(key):
    """A message queue of System V (sys/msg.h) that another process has made."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.msgget(key, 0) < 0:
        raise OSError(ctypes.get_errno(), "msgget")


def reserve_space():
    """On the disk of all, without writing."""
    path = Path.home() / "reserved"
    with open(path, "wb") as stream:
        try:
            if ctypes.CDLL(None, use_errno=True).fallocate(stream.fileno(), 0, ctypes.c_long(0), ctypes.c_long(1)) < 0:
                raise OSError(ctypes.get_errno(), "fallocate")
        finally:
            path.unlink()


def connect_to_any(folder, pattern):
    found = list(Path(folder).glob(pattern))
    if not found:
        raise LookupError("there is no socket %s in %s" % (pattern, folder))
    connect(socket.AF_UNIX, str(found[0]))


def open_another(path):
    """Whether any open file of a process of this lab lies in this folder of the machine."""
    for entry in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if os.readlink(entry).startswith(path) and os.listdir(entry):
                return
        except OSError:
            continue
    raise LookupError("no process has a folder open below " + path)


def read_solution(workspace):
    """Whether a finished node that is an exercise, a solved cell of a notebook or the judge's solutions can be read."""
    lab = Path(workspace, "src/courses/rf_lab2")
    nodes = [lab / "nodes/wave.py", lab / "nodes/tf_listener.py"]
    notebooks = list(lab.glob("notebooks/*.ipynb"))
    if not all("is yours to write" in node.read_text() for node in nodes) or not notebooks or \
            any('"solution"' in notebook.read_text() for notebook in notebooks):
        return
    if not any(Path(workspace, "src/courses/rf_checks/exercises/solutions").glob("*")):
        raise LookupError("nodes and notebooks are unsolved, and there are no solutions")


def attempts(targets):
    """name -> function that raises where it does not succeed."""
    found = {"file " + path: lambda path=path: Path(path).read_bytes() for path in targets["files"]}
    found.update({"folder " + path: lambda path=path: os.listdir(path) for path in targets["folders"]})
    found.update({"port %d" % port: lambda port=port: connect(socket.AF_INET, ("127.0.0.1", port))
                  for port in targets["ports"]})
    return {**found, "another network": lambda: connect(socket.AF_INET, ("192.0.2.1", 80)),
            "abstract socket": lambda: connect(socket.AF_UNIX, "\0" + targets["abstract"]),
            "workspace": lambda: write_and_remove(Path(targets["workspace"], "intruder")),
            "solution": lambda: read_solution(os.environ["LAB_ROOT"]),
            "supervisor": lambda: find_process("lab_class.supervisor"), "namespace": new_namespace,
            "the machine's host": lambda: socket.socket(socket.AF_VSOCK).close(), "keys": add_key,
            "message queue": lambda: open_queue(targets["queue"]),
            "control socket": lambda: connect_to_any(targets["temporary"], "lab-class-*/control"),
            "socket of a lab": lambda: connect_to_any(targets["temporary"], "lab-class-*/student-*"),
            "open folder": lambda: open_another(targets["folders"][0]),
            "setting of Linux": lambda: Path("/proc/sys/kernel/core_pattern").write_text("core"),
            "keys of Linux": lambda: Path("/proc/sysrq-trigger").write_text("h"),
            "control groups": lambda: os.listdir("/sys/fs/cgroup"),
            "space without writing": reserve_space, "mount": lambda: mount(Path.home())}


def main():
    report = {}
    for name, attempt in attempts(json.loads(bytes.fromhex(sys.argv[1]))).items():
        try:
            attempt()
            report[name] = "reached"
        except (OSError, LookupError) as error:
            report[name] = "%s: %s" % (type(error).__name__, error)
    partial = Path.home() / "report.part"
    partial.write_text(json.dumps(report))
    partial.rename(Path.home() / "report.json")


if __name__ == "__main__":
    main()
