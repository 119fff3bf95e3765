# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh labs up N | list | start | pause | stop | renew | down | logs`: the command line."""
from __future__ import annotations

import argparse
import csv
import functools
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rospkg

from command_line.options import Parser
from command_line.user_files import PIPE_WAIT_S, read_file
from lab_class import control, control_groups, memory
from lab_class.disk import ENTRIES, entries_left, remove, room
from lab_class.labs import ClassError, ClassLabState
from lab_class.store import HOME, RUNTIME, ClassOptions, ClassRecord, Store, StoreError, default_folder
from lab_web.libraries import LibrariesError, fetched
from processes import isolation
from processes.family import is_running
from rf_checks import roster
from rf_checks.roster import INSTRUCTOR, RosterError

#: Time for the supervisor to open the front door, and to end all labs [s].
OPEN_S, DOWN_S = 30.0, 60.0
_LOOK_S = 0.2
#: A gradebook of 500 students has a hundred kilobytes.
MAX_ROSTER_BYTES = 20 << 20
_LOG = "supervisor.log"
_DONE, _FAILED, _WRONG_WORDS, _INTERRUPTED = 0, 1, 2, 130
_COLUMNS = "%-20s %-9s %5s %6s %8s %8s %8s  %s"


def main(arguments: list[str] | None = None) -> int:
    """Returns the exit code: 0, 1 for what failed, 2 for wrong words."""
    options = parse(arguments)
    store = Store(options.folder)
    try:
        return options.run(options, store)
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (RosterError, StoreError, ClassError, LibrariesError, OSError) as error:
        print("labs: %s" % error, file=sys.stderr)
        return _WRONG_WORDS if isinstance(error, RosterError) else _FAILED
    except KeyboardInterrupt:
        return _INTERRUPTED


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """The options; ``run`` is the command's function."""
    defaults = ClassOptions()
    parser = Parser(prog="./baxter.sh labs", description="Labs for a class on this machine, each behind walls, with "
                    "one address for each student; docs/class.md.")
    text = "of the class: roster, tokens, students' files (default: %s)" % default_folder()
    parser.add_argument("--folder", default=default_folder(), help=text)
    # Behind a command, too.
    folder = argparse.ArgumentParser(add_help=False)
    folder.add_argument("--folder", default=argparse.SUPPRESS, help=text)
    commands = parser.add_subparsers(required=True, metavar="up|list|start|pause|stop|renew|down|logs",
                                     # Any callable will do.
                                     parser_class=functools.partial(  # pyright: ignore[reportArgumentType]
                                         Parser, parents=[folder]))
    up = commands.add_parser("up", help="start a class, and print the addresses")
    up.add_argument("who", type=_number_or_file, nargs="?", help="a number of students, or a CSV file with their "
                    "names; without it the class of last time")
    up.add_argument("--launch", help="what runs in a lab (default: \"%s\")" % " ".join(defaults.launch))
    up.add_argument("--port", type=int, help="of the front door (default: %d)" % defaults.port)
    up.add_argument("--public", action="store_true", default=None, help="open the front door to other machines")
    up.add_argument("--address", type=_server, metavar="URL", help="of a server with TLS in front of the front door, "
                    "such as https://labs.example/robots (docs/class.md)")
    up.add_argument("--idle", type=_minutes, metavar="MINUTES", help="a lab that nobody uses for so long is paused; 0: "
                    "never (default: %g)" % ((defaults.idle_s or 0.0) / 60.0))
    up.add_argument("--keep-running", action=argparse.BooleanOptionalAction, help="do not pause labs that have started "
                    "until their first visitor comes")
    up.add_argument("--memory", type=_gigabytes, metavar="GB", help="limit of each lab (default: %g)"
                    % (defaults.memory_bytes / 2**30))
    up.add_argument("--disk", type=_gigabytes, metavar="GB", help="limit of each student's files (default: %g)"
                    % (defaults.disk_bytes / 2**30))
    up.add_argument("--at-once", type=_positive, metavar="N", help="labs that start at a time (default: half of the "
                    "cores)")
    up.add_argument("--trusted", action="store_true", default=None, help="without walls, where this machine allows "
                    "none: every student can then do what you can")
    up.add_argument("--no-wait", action="store_true", help="do not wait until the labs run")
    up.set_defaults(run=_up)
    labs = commands.add_parser("list", help="the labs, and what they use")
    shown = labs.add_mutually_exclusive_group()
    shown.add_argument("--addresses", action="store_true", help="the addresses of instructor and students instead")
    shown.add_argument("--csv", action="store_true", help="names and addresses of the students as CSV, to send each of "
                       "them one")
    labs.set_defaults(run=_list)
    for verb, help_text in (("start", "start stopped or failed labs, wake paused ones"),
                            ("pause", "pause labs; a click on its page wakes one"), ("stop", "end labs")):
        one = commands.add_parser(verb, help=help_text)
        one.add_argument("names", nargs="+", help="names of labs, or: all")
        one.set_defaults(run=_change, verb=verb)
    renew = commands.add_parser("renew", help="give students new addresses; the old ones open nothing any more")
    renew.add_argument("names", nargs="+", help="names of labs, all, or instructor")
    renew.set_defaults(run=_renew)
    down = commands.add_parser("down", help="end the class; the students' files, addresses and roster stay")
    down.add_argument("--delete", action="store_true", help="delete these, too")
    down.set_defaults(run=_down)
    logs = commands.add_parser("logs", help="what a lab has written, or the supervisor")
    logs.add_argument("name", nargs="?")
    logs.set_defaults(run=_logs)
    return parser.parse_args(arguments)


def _number(text: str, words: str, least: float = 0.0):
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not least < value < 1e6:
        raise argparse.ArgumentTypeError("%r; expected %s" % (text, words))
    return value


def _minutes(text: str):
    return 60.0 * _number(text, "minutes, 0 or more", -1e-9)


def _gigabytes(text: str) -> int:
    return int(_number(text, "a number of GB above 0") * 2**30)


def _positive(text: str) -> int:
    return int(_number(text, "a whole number from 1", 0.5))


def _server(text: str) -> str:
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.query or parts.fragment or \
            not re.fullmatch(r"[A-Za-z0-9/._~-]*", parts.path):
        raise argparse.ArgumentTypeError("%r; expected an address such as https://labs.example or "
                                         "https://labs.example/robots" % text)
    return text.rstrip("/")


def _launch(text: str) -> tuple[str, ...]:
    """The words of a launch line. A file of this folder gets its whole path: labs run in another folder."""
    words = text.split()
    if words and Path(words[0]).is_file():
        words[0] = str(Path(words[0]).resolve())
    return tuple(words)


def _number_or_file(text: str) -> str:
    """Raises ArgumentTypeError for the name of nothing."""
    if not text.isdecimal() and not Path(text).exists():
        raise argparse.ArgumentTypeError("%s is neither a number of students nor a file with their names" % text)
    return text


def _students(who: str) -> list[roster.Student]:
    if who.isdecimal():
        return roster.numbered(int(who))
    try:
        data = read_file(who, MAX_ROSTER_BYTES, pipe_wait_s=PIPE_WAIT_S)
    except OSError as error:
        raise RosterError("%s is neither a number of students nor a file that can be read: %s"
                          % (who, error.strerror)) from error
    try:
        text = roster.text_of(data)
    except RosterError as error:
        raise RosterError("%s %s" % (who, error)) from error
    return roster.read(text)


def _record(options: argparse.Namespace, store: Store) -> ClassRecord:
    """The ClassRecord of this `up`. Raises RosterError, StoreError."""
    earlier = store.read()
    if options.who is None and earlier is None:
        raise RosterError("there is no class of last time in %s; say how many students: %s, or a CSV file "
                          "with their names" % (store.folder, store.command("up N")))
    given = {"launch": _launch(options.launch) if options.launch else None, "port": options.port,
             "public": options.public, "trusted": options.trusted, "memory_bytes": options.memory,
             "disk_bytes": options.disk, "at_once": options.at_once, "keep_running": options.keep_running,
             "address": options.address}
    values = {name: value for name, value in given.items() if value is not None}
    if options.idle is not None:
        values["idle_s"] = options.idle or None
    if options.who is None and earlier is not None:
        kept = {**vars(earlier.options), **values}
        return ClassRecord.made(ClassOptions(**kept), earlier.students, earlier)
    values.setdefault("at_once", max(1, (os.cpu_count() or 1) // 2))
    return ClassRecord.made(ClassOptions(**values), _students(options.who or ""), earlier)


def _is_up(store: Store) -> bool:
    try:
        control.call(store, "GET", "/labs")
    except control.NoClass:
        return False
    return True


def _up(options: argparse.Namespace, store: Store):
    if _is_up(store):
        raise ClassError("a class runs in %s already; %s ends it" % (store.folder, store.command("down")))
    store.make()
    _remove_left_over(store)
    record = _record(options, store)
    if not record.options.trusted and isolation.problem():
        raise ClassError("students are not let into labs without walls around them, and this machine allows none: %s. "
                         "A class whose students may do all that you can needs no walls: add --trusted"
                         % isolation.problem())
    _refuse_launch_outside(record.options)
    packages = rospkg.RosPack()
    libraries = fetched(Path(packages.get_path("lab_web")) / "page").parents[1]
    _say_who_has_left(store.read(), record)
    store.write(record)
    log = store.folder / _LOG
    with open(log, "wb") as output:
        supervisor = subprocess.Popen(
            [*control_groups.way_in(), sys.executable, "-P", "-m", "lab_class.supervisor", str(store.folder),
             str(libraries), str(Path(packages.get_path("lab_class")) / "page")],
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True, cwd="/")
    try:
        _await_door(store, supervisor, log)
    except KeyboardInterrupt:
        # Nobody knows an address yet.
        supervisor.terminate()
        supervisor.wait(DOWN_S)
        raise
    _print_addresses(record, store)
    print("Limits: %s.\n" % control.call(store, "GET", "/labs")["limits"], flush=True)
    needed, free = len(record.students) * record.options.disk_bytes, room(store.folder)
    if free < needed:
        print("The disk has %.1f GB free, and the students' files may have %.1f GB (--disk). Labs that fill it are "
              "ended.\n" % (free / 2**30, needed / 2**30), flush=True)
    short = memory.forecast(len(record.students), memory.available_bytes(), record.options.memory_bytes)
    if short:
        print(short + "\n", flush=True)
    files = entries_left(store.folder)
    if files is not None and files < len(record.students) * ENTRIES:
        print("The disk has room for %d more files and folders, and each student may have %d.\n" % (files, ENTRIES),
              flush=True)
    return _DONE if options.no_wait else _await_labs(store)


def _refuse_launch_outside(options: ClassOptions) -> None:
    """Labs behind walls see the workspace, and no other folder of this user."""
    file = Path(options.launch[0])
    seen = [*isolation.workspaces(os.environ), "/usr", "/opt"]
    if not options.trusted and file.is_absolute() and not any(file.is_relative_to(root) for root in seen):
        raise ClassError("labs do not see %s; put the launch file into one of these folders: %s"
                         % (file, ", ".join(seen)))


def _say_who_has_left(earlier: ClassRecord | None, record: ClassRecord) -> None:
    names = {student.name for student in record.students}
    for student in earlier.students if earlier else ():
        if student.name not in names:
            print("%s (%s) is not in the class any more, and the address opens nothing; the files stay in labs/%s/%s."
                  % (student.full_name, student.name, student.name, HOME), flush=True)


def _await_door(store: Store, supervisor: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + OPEN_S
    while not _is_up(store):
        if supervisor.poll() is not None or time.monotonic() > deadline:
            last = log.read_text(errors="replace").strip().rpartition("\n")[2].removeprefix("labs: ")
            raise ClassError("the class did not start: %s" % (last or "its log is empty, %s" % log))
        time.sleep(_LOOK_S)


def _print_addresses(record: ClassRecord, store: Store) -> None:
    print("The instructor's page:\n\n    %s\n\nThe students' addresses:\n" % _address(record, store, INSTRUCTOR))
    for student in record.students:
        print("    %-24s %s" % (student.full_name, _address(record, store, student.name)))
    if record.options.address:
        print("\nThe server at %s is expected to pass requests on to port %d of this machine, with their whole path."
              % (record.options.address, _port(record, store)))
    if record.options.public:
        print("\nPort %d is open to every machine of the network. The connection is not encrypted (docs/security.md)."
              % _port(record, store))
    if record.options.trusted:
        print("\nThere are no walls: every student can do what you can on this machine.")
    print("\n%s ends the class.\n" % store.command("down"), flush=True)


def _address(record: ClassRecord, store: Store, name: str) -> str:
    """Of a student's lab, or of the instructor's page."""
    host = os.environ.get("ROS_IP") or socket.gethostname() if record.options.public else "localhost"
    server = record.options.address or "http://%s:%d" % (host, _port(record, store))
    token = record.instructor if name == INSTRUCTOR else record.tokens[name].act
    return "%s/%s/?token=%s" % (server, name, token)


def _port(record: ClassRecord, store: Store) -> int:
    return store.running().get("port", record.options.port)


def _await_labs(store: Store) -> int:
    """Print each lab that has finished starting; Ctrl-C only ends the watching. Returns the exit code."""
    shown = set()
    try:
        while True:
            labs = control.call(store, "GET", "/labs")["labs"]
            for lab in labs:
                is_waiting = lab["state"] == ClassLabState.WAITING.value and not lab["reason"]
                if lab["name"] not in shown and not lab["is_starting"] and not is_waiting:
                    shown.add(lab["name"])
                    print("%s is %s%s" % (lab["name"], lab["state"], ": " + lab["reason"] if lab["reason"] else ""),
                          flush=True)
            if len(shown) == len(labs):
                if any(lab["state"] == ClassLabState.PAUSED.value for lab in labs):
                    print("A paused lab goes on as soon as its page is opened.", flush=True)
                return _FAILED if any(lab["state"] == ClassLabState.FAILED.value for lab in labs) else _DONE
            time.sleep(_LOOK_S)
    except KeyboardInterrupt:
        print("\nThe class goes on; %s shows it." % store.command("list"))
        return _DONE


def _stored(store: Store) -> ClassRecord:
    """The class of a folder. Raises ClassError where there is none."""
    record = store.read()
    if record is None:
        raise ClassError("there is no class in %s" % store.folder)
    return record


def _list(options: argparse.Namespace, store: Store) -> int:
    overview = control.call(store, "GET", "/labs")
    if options.addresses:
        _print_addresses(_stored(store), store)
        return _DONE
    if options.csv:
        record, table = _stored(store), csv.writer(sys.stdout, lineterminator="\n")
        table.writerow(("name", "id", "address"))
        table.writerows((student.full_name, student.name, _address(record, store, student.name))
                        for student in record.students)
        return _DONE
    print(_COLUMNS % ("LAB", "STATE", "PAGES", "FACTOR", "MEMORY", "FILES", "UNUSED", "NAME"))
    for lab in overview["labs"]:
        print((_COLUMNS % (lab["name"], lab["state"], lab["pages"], _shown(lab["factor"], "%.2f"),
                           _shown(lab["memory_bytes"], "%.0f MB", 2**20), _shown(lab["disk_bytes"], "%.0f MB", 2**20),
                           _shown(lab["unused_s"], "%.0f min", 60.0),
                           lab["full_name"] + (": " + lab["reason"] if lab["reason"] else ""))).rstrip())
    return _DONE


def _shown(value: Any, form: str, unit: float = 1.0):
    return "-" if value is None else form % (value / unit)


def _change(options: argparse.Namespace, store: Store):
    names = options.names
    if names == ["all"]:
        wanted = {"pause": (ClassLabState.RUNNING.value,)}.get(options.verb)
        names = [lab["name"] for lab in control.call(store, "GET", "/labs")["labs"]
                 if wanted is None or lab["state"] in wanted]
    for name in names:
        if roster.slug(name) != name:
            raise ClassError("%r is no name of a lab; %s shows them" % (name, store.command("list")))
        control.call(store, "POST", "/labs/%s/%s" % (name, options.verb))
    return _DONE


def _renew(options: argparse.Namespace, store: Store) -> int:
    record = _stored(store)
    names = list(record.tokens) if options.names == ["all"] else options.names
    for name in names:
        record = record.renewed(name)
    if _is_up(store):
        for name in names:
            control.call(store, "POST", "/renew/" + name)
        record = _stored(store)
    else:
        store.write(record)
    for name in names:
        print("%-24s %s" % (name, _address(record, store, name)))
    return _DONE


def _down(options: argparse.Namespace, store: Store) -> int:
    try:
        supervisor = store.running().get("pid", 0)
        control.call(store, "POST", "/down")
        deadline = time.monotonic() + DOWN_S
        while store.running() or is_running(supervisor):
            if time.monotonic() > deadline:
                raise ClassError("the class did not end within %d s; its log: %s"
                                 % (DOWN_S, store.folder / _LOG))
            time.sleep(_LOOK_S)
    except control.NoClass as error:
        _remove_left_over(store)
        if not options.delete:
            print(error)
    (store.folder / _LOG).unlink(missing_ok=True)
    if options.delete:
        # Nothing is removed under a supervisor that is just starting.
        with store.locked():
            remove(store.folder)
    return _DONE


def _remove_left_over(store: Store) -> None:
    """The files of a supervisor that was killed, or whose host lost power: it may have left any part of them. Raises
    StoreError where one is just starting or ending."""
    if not store.folder.is_dir():
        return
    with store.locked():
        for folder in store.running().get("groups", ()):
            control_groups.remove_left_over(folder)
        runtime = Path(store.running().get("runtime", ""))
        # After a restart of the host the name may be another user's.
        if runtime.name.startswith(RUNTIME) and runtime.is_dir() and runtime.stat().st_uid == os.geteuid():
            shutil.rmtree(runtime, ignore_errors=True)
        store.remove_run()


def _logs(options: argparse.Namespace, store: Store):
    if options.name is None:
        path = store.folder / _LOG
    elif roster.slug(options.name) == options.name:
        path = store.folder / "labs" / options.name / "output.txt"
    else:
        raise ClassError("%r is no name of a lab; %s shows them" % (options.name, store.command("list")))
    if not path.exists():
        record = store.read()
        names = [student.name for student in record.students] if record else []
        if names and options.name not in (None, *names):
            raise ClassError("there is no lab %s; there are: %s" % (options.name, ", ".join(names)))
        raise ClassError("there is no %s; only a class that runs has logs" % path)
    with open(path, "rb") as stream:
        shutil.copyfileobj(stream, sys.stdout.buffer)
    return _DONE
