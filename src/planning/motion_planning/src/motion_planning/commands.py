# SPDX-License-Identifier: BSD-3-Clause
"""The commands of this package. They need no master."""
from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from command_line.options import MAX_SEED, number
from model_files.resources import ResourceFinder
from motion_planning.collision_pairs import ALWAYS_SHARE, TRIALS, disabled_pairs, summary
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import prepare, sphere_model_of
from motion_planning.srdf import element_of, with_disabled_pairs
from urdf_model import description_text

# Most random states of an SRDF, which take a day.
MAX_TRIALS = 10**8


def collisions_updater(arguments: Sequence[str] | None = None) -> int:
    """``collisions_updater``: compute the disabled pairs of an SRDF. Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="collisions_updater", description="Compute which pairs of links need not be checked against each other: "
        "neighbours, what touches at rest or always, and what never does in many random states.")
    parser.add_argument("--urdf", type=Path, required=True, help="the robot: URDF or xacro file")
    parser.add_argument("--srdf", type=Path, required=True, help="SRDF file to be changed; or xacro, with --output")
    parser.add_argument("--output", type=Path, help="file to write in place of --srdf")
    parser.add_argument("--lines", action="store_true", help="print the elements and write nothing")
    parser.add_argument("--trials", type=number(int, 1, MAX_TRIALS), default=TRIALS,
                        help="random states (default: %(default)s)")
    parser.add_argument("--min-collision-fraction", type=number(float, 0, 1, above=True), default=ALWAYS_SHARE,
                        dest="share",
                        help="share of random states in which what touches always does (default: %(default)s)")
    parser.add_argument("--seed", type=number(int, 0, MAX_SEED), default=0,
                        help="of the random states (default: %(default)s)")
    options = parser.parse_args(arguments)
    if options.srdf.suffix == ".xacro" and options.output is None and not options.lines:
        parser.error("%s is xacro; name the SRDF file to write with --output" % options.srdf)
    try:
        text = description_text(options.srdf)
        model = PlanningModel.from_xml(description_text(options.urdf), text)
        for warning in model.srdf.warnings:
            print("warning: " + warning, file=sys.stderr)
        pairs = disabled_pairs(model, MeshReader(ResourceFinder()), trials=options.trials, share=options.share,
                               seed=options.seed)
        if options.lines:
            print("\n".join(map(element_of, pairs)))
        else:
            (options.output or options.srdf).write_text(with_disabled_pairs(text, pairs), encoding="utf-8")
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (ValueError, OSError) as error:
        print("collisions_updater: %s" % error, file=sys.stderr)
        return 1
    print(summary(pairs), file=sys.stderr)
    return 0


def prepare_robots(arguments: Sequence[str] | None = None) -> int:
    """``prepare_robots``: make the spheres of robots, which planning then loads from disk. Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="prepare_robots", description="Make all that planning needs to know of a robot's shape, so that the "
        "first start of move_group does not wait for it.")
    parser.add_argument("urdf", type=Path, nargs="+", help="a robot: URDF or xacro file")
    files = parser.parse_args(arguments).urdf
    with ProcessPoolExecutor(min(len(files), os.cpu_count() or 1)) as workers:
        failures = [text for text in workers.map(_prepare_one, files) if text]
    for text in failures:
        print("prepare_robots: " + text, file=sys.stderr)
    return 1 if failures else 0


def _prepare_one(path: Path) -> str | None:
    """Prepare the robot of a file; return None, or the reason of a failure."""
    try:
        model = PlanningModel.from_xml(description_text(path), "")
        exact = ExactChecker(model, MeshReader(ResourceFinder()))
        prepare(exact)
        left = sphere_model_of(exact).not_kept()
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (ValueError, OSError) as error:
        return "%s: %s" % (path, error)
    if left:
        return "%s: the spheres of %d links cannot be kept on disk, '%s' is the first; make room or let the cache be " \
               "written" % (path, len(left), left[0])
    return None
