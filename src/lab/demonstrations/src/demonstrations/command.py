# SPDX-License-Identifier: BSD-3-Clause
"""Sets of demonstrations: record an expert's, replay, check, repair, describe, convert."""
from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from command_line.options import MAX_SEED, MAX_WORKERS, Parser, counted, number
from gym_baxter.core import CAMERAS
from lab_batch import JobError

from . import robomimic
from .card import write_card
from .collecting import CollectingWork, Views, collect, film
from .environment import PROFILES, Conditions, core_for, replay
from .experts import EXPERTS
from .frames import DemonstrationError
from .reading import DataSet, repair, survey


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line's options."""
    parser = Parser(prog="python3 -m demonstrations", description=__doc__,
                    epilog="Exit status: 0 done, 1 something is broken or differs, 2 wrong options.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    one = commands.add_parser("record", help="append an expert's episodes to a LeRobot data set")
    one.add_argument("task", choices=tuple(EXPERTS), metavar="TASK", help="one of %s" % ", ".join(EXPERTS))
    one.add_argument("folder", type=Path, metavar="FOLDER")
    one.add_argument("--episodes", type=number(int, 1, 10**6), default=50, metavar="N", help="default: %(default)s")
    one.add_argument("--first", type=number(int, 0, MAX_SEED), default=0, metavar="SEED", help="of the first episode")
    one.add_argument("--noise", type=number(float, 0.0, 1.0), default=0.0, metavar="SHARE",
                     help="disturb the actions; expert.action then has what the expert wanted (default: 0)")
    one.add_argument("--profile", choices=PROFILES, default=PROFILES[0],
                     help="of the robot: robot has the physical one's lag and noise (default: %(default)s)")
    one.add_argument("--randomised", action="store_true",
                     help="things have other weights and frictions in each episode")
    one.add_argument("--cameras", nargs="+", choices=CAMERAS, metavar="CAMERA",
                     help="with pictures, in one process: %s" % ", ".join(CAMERAS))
    one.add_argument("--size", type=number(int, 2, 1024), default=84, metavar="N",
                     help="of a picture's sides, even (default: %(default)s)")
    one.add_argument("--workers", type=number(int, 1, MAX_WORKERS), default=os.cpu_count() or 1, metavar="N",
                     help="processes at a time (default: one for each processor, %(default)s)")
    for name, text in (("replay", "do the recorded actions again, and compare what is observed to the last bit"),
                       ("check", "read a whole set, and name what is broken"),
                       ("repair", "copy the whole episodes of a broken set into a new one"),
                       ("card", "write README.md into a set's folder: what the set is"),
                       ("robomimic", "write a set as robomimic's HDF5")):
        one = commands.add_parser(name, help=text)
        one.add_argument("folder", type=Path, metavar="FOLDER")
        if name in ("repair", "robomimic"):
            one.add_argument("into", type=Path, metavar="INTO")
        if name == "replay":
            one.add_argument("--episode", type=number(int, 0, MAX_SEED), metavar="N", help="default: all")
    return parser.parse_args(argv)


def _record(options):
    seeds = range(options.first, options.first + options.episodes)
    conditions = Conditions.named(options.profile, options.randomised)

    def say(text: str) -> None:
        print(text, file=sys.stderr)

    if options.cameras:
        found = film(options.task, options.folder, seeds, Views(tuple(dict.fromkeys(options.cameras)), options.size),
                     options.noise, say, conditions)
    else:
        found = collect(options.task, options.folder, seeds, options.noise, CollectingWork(options.workers, say),
                        conditions=conditions)
    print("%s of %s are in %s; the expert failed %s" % (
        counted(found.kept, "demonstration"), options.task, options.folder, counted(found.failed, "time")))
    return 0


def _replay(options):
    data = DataSet(options.folder)
    core, differ = core_for(data.schema), 0
    try:
        for index in range(len(data)) if options.episode is None else [options.episode]:
            off = replay(core, data.episode(index))
            differ += any(off.values())
            print("episode %d: %s" % (index, "equal to the last bit" if not any(off.values()) else ", ".join(
                "%s differs by up to %.3g" % item for item in off.items() if item[1])))
    finally:
        core.close()
    return 1 if differ else 0


def _told(found):
    for why in found.faults:
        print(why)
    for index, why in found.broken.items():
        print("episode %d is broken: %s" % (index, why))
    for name in found.strays:
        print("%s belongs to no episode" % name)
    print("%s whole, %d broken" % (counted(len(found.good), "episode"), len(found.broken)))
    return 1 if found.broken or found.strays or found.faults else 0


def main(argv: Sequence[str] | None = None) -> int:
    """The program."""
    options = parse(argv)
    try:
        if options.command == "record":
            return _record(options)
        if options.command == "replay":
            return _replay(options)
        if options.command == "check":
            return _told(survey(options.folder))
        if options.command == "repair":
            _told(repair(options.folder, options.into))
            print("the whole ones are in %s" % options.into)
            return 0
        if options.command == "card":
            print(write_card(options.folder))
            return 0
        count = robomimic.write(DataSet(options.folder), options.into)
        print("%s in %s" % (counted(count, "episode"), options.into))
        return 0
    except (DemonstrationError, JobError, OSError) as error:
        print("demonstrations: %s" % error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("demonstrations: stopped; the episodes that were complete are kept", file=sys.stderr)
        return 130
