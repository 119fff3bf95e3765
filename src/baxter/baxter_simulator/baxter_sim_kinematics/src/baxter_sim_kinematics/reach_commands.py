# SPDX-License-Identifier: BSD-3-Clause
"""The commands of maps of reach: reach, reach_overlap and reach_place. They need no master."""
from __future__ import annotations

import argparse
import csv
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.errors import NoSolution
from arm_kinematics.ik import solve
from arm_kinematics.reach import MapParts, MapSettings, ReachError, compute
from arm_kinematics.reach_bounds import balls
from arm_kinematics.reach_map import ReachMap, overlap
from arm_kinematics.reach_places import Region, best_places, nearest_rotations, table_poses
from arm_kinematics.target import pose_from_quaternion
from baxter_sim_kinematics.commands import (
    chain_of,
    new_parser,
    run_command,
    self_collision_checker,
    tell,
    with_numbers,
)
from command_line.options import MAX_WORKERS, number
from command_line.user_files import PIPE_WAIT_S, read_text

if TYPE_CHECKING:
    from arm_kinematics.bullet_checker import BulletChecker
    from arm_kinematics.chain import Chain
    from urdf_model.model import Robot

# Of a file of poses.
MAX_BYTES = 100_000_000


def _reach_parser() -> argparse.ArgumentParser:
    parser = with_numbers(new_parser(
        "Map what an arm reaches: in each cell of a volume the share of orientations that the tip can have\n"
        "there, and the mean manipulability. Writes reach.csv, reach.npz and reach.png. If interrupted, it continues\n"
        "when called again.\n\n"
        "  rosrun baxter_sim_kinematics reach --volume 0.2 1.2 -0.4 1.0 -0.4 0.8 --tool 0 0 -1 --out map"))
    parser.add_argument("--volume", type=float, nargs=6, metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"),
                        help="[m] (default: all that the arm reaches)")
    parser.add_argument("--cell", type=float, default=0.1, help="edge of a cell [m] (default: 0.1)")
    parser.add_argument("--orientations", type=number(int, 1, 10**5), default=24,
                        help="tried in each cell (default: 24)")
    parser.add_argument("--tool", type=float, nargs=3, metavar=("X", "Y", "Z"),
                        help="the tip's z axis points there, and only turns about it are tried; 0 0 -1 is down")
    parser.add_argument("--starts", type=number(int, 1, 10**6), default=40,
                        help="random starts before a pose counts as out of reach")
    parser.add_argument("--self-collision", action="store_true",
                        help="only postures count in which the robot does not touch itself")
    parser.add_argument("--hdf5", action="store_true",
                        help="write reach.h5 and capability.h5 as well, in the layouts of Reuleaux")
    parser.add_argument("--out", type=Path, default=Path("reach"), help="folder (default: reach)")
    parser.add_argument("--jobs", type=number(int, 1, MAX_WORKERS), default=len(os.sched_getaffinity(0)),
                        help="processes (default: all cores)")
    return parser


def reach() -> int:
    """Entry point of ``rosrun baxter_sim_kinematics reach``."""
    parser = _reach_parser()
    return run_command(lambda: _reach(parser.parse_args()))


def map_of(words: list[str]) -> MapParts:
    """Return the reach.MapParts of the map that ``reach`` makes with the arguments ``words``."""
    options = _reach_parser().parse_args(words)
    robot, chain, settings = _settings(options)
    checker = self_collision_checker(robot, tell) if settings.self_collision else None
    return MapParts(chain, settings, options.out, checker)


def _settings(options: argparse.Namespace) -> tuple[Robot, Chain, MapSettings]:
    """Return (urdf_model.Robot, Chain, MapSettings). Raises ReachError, UrdfError."""
    robot, chain = chain_of(options)
    volume = _volume(options, chain)
    geometry = [*np.concatenate([part.ravel() for part in (*chain.arrays[:2], *chain.limit_arrays)]).round(6).tolist()]
    settings = MapSettings(tuple(volume[0::2]), tuple(volume[1::2]), options.cell, options.orientations,
                           None if options.tool is None else tuple(options.tool), options.starts,
                           "%s to %s, %s" % (chain.base, chain.tip, geometry), options.self_collision)
    if options.self_collision and not any(link.collisions for link in robot.links.values()):
        raise ReachError("no link of robot '%s' has a <collision> shape; leave --self-collision out" % robot.name)
    return robot, chain, settings


def _reach(options: argparse.Namespace) -> int:
    from arm_kinematics.reach_picture import draw

    robot, chain, settings = _settings(options)
    if settings.self_collision:
        # The worker processes make their own; this one tells once what they will lack.
        self_collision_checker(robot, tell).close()
    values = compute(chain, settings, options.out, options.jobs, _Bar(),
                     lambda: self_collision_checker(robot, lambda text: None))
    found = ReachMap(np.array(settings.lower), settings.cell_m, settings.rotations(),
                     values.reached.reshape(*settings.shape, -1), values.manipulability.reshape(settings.shape),
                     chain.base, chain.tip, settings.self_collision)
    share = found.share
    found.write(options.out / "reach.npz")
    found.write_csv(options.out / "reach.csv")
    if options.hdf5:
        found.write_hdf5(options.out / "reach.h5")
        found.write_capabilities(options.out / "capability.h5")
    draw(share, settings, options.out / "reach.png")
    print("%d of %d cells are reached, %.1f %% of all poses; see %s" % (
        (share > 0).sum(), share.size, 100.0 * share.mean(), options.out))
    return 0


def _volume(options: argparse.Namespace, chain: Chain) -> list[float]:
    """The bounds x0 x1 y0 y1 z0 z1 [m], by default of all that the arm reaches."""
    if options.volume is not None:
        return options.volume
    ball, cell = balls(chain)[0], options.cell if 0.0 < options.cell < math.inf else 1.0  # MapSettings refuses it
    if not math.isfinite(ball.radius):
        raise ReachError("a joint of the chain slides without limits; say --volume")
    # Whole cells about the base, so that maps of several arms of a robot can be compared.
    low, high = np.floor((ball.centre - ball.radius) / cell), np.ceil((ball.centre + ball.radius) / cell)
    low, high = low * cell, np.maximum(high, low + 1.0) * cell  # a tip on its only axis stays where it is
    return np.column_stack((low, high)).ravel().round(9).tolist()


class _Bar:
    """A progress bar on a terminal, a line every tenth elsewhere."""

    def __init__(self) -> None:
        self._last = -1

    def __call__(self, done: int, total: int) -> None:
        tenth, terminal = 10 * done // total, sys.stderr.isatty()
        if terminal:
            full = 40 * done // total
            print("\r[%s%s] %d of %d cells" % ("#" * full, "." * (40 - full), done, total), end="", file=sys.stderr)
            if done == total:
                print(file=sys.stderr)
        elif tenth != self._last:
            print("%d %% of %d cells" % (100 * done // total, total), file=sys.stderr)
        self._last = tenth
        sys.stderr.flush()


def reach_overlap() -> int:
    """Entry point of ``rosrun baxter_sim_kinematics reach_overlap``."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Where two arms can meet: in each cell of both maps the less of their shares.\n"
                    "Writes overlap.csv, overlap.npz and overlap.png.\n\n"
                    "  rosrun baxter_sim_kinematics reach_overlap left_map right_map --out both")
    parser.add_argument("maps", nargs=2, type=Path, metavar="MAP", help="folder that reach wrote, or its reach.npz")
    parser.add_argument("--out", type=Path, default=Path("overlap"), help="folder (default: overlap)")
    return run_command(lambda: _overlap(parser.parse_args()))


def _overlap(options: argparse.Namespace) -> int:
    from arm_kinematics.reach_picture import draw

    first, second = (ReachMap.read(path) for path in options.maps)
    both = overlap(first, second)
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(options.out / "overlap.npz", share=both.share, lower=both.lower, upper=both.upper,
                        cell_m=both.cell_m)
    centres = both.lower + both.cell_m * (0.5 + np.moveaxis(np.indices(both.share.shape), 0, -1).reshape(-1, 3))
    with open(options.out / "overlap.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("x_m", "y_m", "z_m", "both_reach_percent"))
        writer.writerows((*("%.4f" % c for c in centre), "%.2f" % (100.0 * part))
                         for centre, part in zip(centres, both.share.ravel(), strict=True))
    draw(both.share, both, options.out / "overlap.png")
    cells = both.share > 0
    print("%d cells, %.3f m^3, are reached by both (%d by %s, %d by %s); see %s" % (
        cells.sum(), cells.sum() * both.cell_m ** 3, first.reached.any(axis=3).sum(), first.tip,
        second.reached.any(axis=3).sum(), second.tip, options.out))
    return 0


def reach_place() -> int:
    """Entry point of ``rosrun baxter_sim_kinematics reach_place``."""
    parser = with_numbers(new_parser(
        "Where to put a table, or any task, before an arm: the places at which most of its poses are reached.\n"
        "Poses are looked up in a map; for the best place each one is solved as well.\n\n"
        "  rosrun baxter_sim_kinematics reach_place map --table 0.6 0.4 --region 0.4 1.0 0 0.6 -0.3 0.1"))
    parser.add_argument("map", type=Path, metavar="MAP", help="folder that reach wrote, or its reach.npz")
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--table", type=float, nargs=2, metavar=("WIDTH", "DEPTH"),
                      help="of its top [m], along y and x; the tip is put all over it with the map's orientations "
                           "(a map made with --tool 0 0 -1: from above)")
    task.add_argument("--poses", type=Path, metavar="FILE",
                      help="CSV, a pose a line: x y z [m], quaternion x y z w, in the frame of the task")
    parser.add_argument("--region", type=float, nargs=6, required=True, metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"),
                        help="where the origin of the task (the middle of the table's top) may be [m]")
    parser.add_argument("--step", type=float, default=0.05, help="between places, and between points of a table [m]")
    parser.add_argument("--yaws", type=float, nargs="+", default=[0.0], metavar="DEGREES",
                        help="turns of the task about z that are tried (default: 0)")
    parser.add_argument("--most", type=number(int, 1, 10**6), default=5, help="places that are printed (default: 5)")
    return run_command(lambda: _place(parser.parse_args()))


def _place(options: argparse.Namespace) -> int:
    found = ReachMap.read(options.map)
    if options.poses:
        poses = _task_poses(options.poses)
    else:
        width_m, depth_m = options.table
        poses = table_poses(width_m, depth_m, options.step, found.rotations)
    region = Region(tuple(options.region[0::2]), tuple(options.region[1::2]), options.step,
                    tuple(np.radians(options.yaws)))
    places = best_places(found, poses, region, options.most)
    off = max(nearest_rotations(found, place.pose[:3, :3] @ poses[:, :3, :3])[1].max() for place in places)
    if off > 0.1:
        tell("the map's orientations are up to %.0f degrees from those of the task; a map with more of them, or with "
             "--tool, tells more" % math.degrees(off))
    print("    x       y       z     yaw  reached  (%d poses of %s in %s)" % (len(poses), found.tip, found.base))
    for place in places:
        print("%7.3f %7.3f %7.3f %5.0f  %5.1f %%" % (*place.position, math.degrees(place.yaw), 100.0 * place.share))
    if not places[0].share:
        print("no pose of the task is reached anywhere in the region")
        return 1
    options.base, options.tip = options.base or found.base, options.tip or found.tip
    robot, chain = chain_of(options)
    checker = self_collision_checker(robot, tell) if found.self_collision else None
    solved = sum(_is_solved(chain, places[0].pose @ pose, checker) for pose in poses)
    print("at the first place %d of %d poses are solved exactly" % (solved, len(poses)))
    return 0


def _is_solved(chain: Chain, pose: np.ndarray, checker: BulletChecker | None) -> bool:
    try:
        solve(chain, pose, chain.mid_range, checker=checker)
    except NoSolution:
        return False
    return True


def _task_poses(path: Path) -> np.ndarray:
    poses = []
    for row, line in enumerate(read_text(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S).splitlines(), 1):
        words = line.replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            values = [float(word) for word in words]
            if len(values) != 7:
                raise ValueError("expected 7 numbers, got %d" % len(values))
            poses.append(pose_from_quaternion(values[:3], values[3:]))
        except ValueError as error:
            raise ReachError("%s, line %d: %s" % (path, row, error)) from None
    if not poses:
        raise ReachError("%s has no poses" % path)
    return np.array(poses)
