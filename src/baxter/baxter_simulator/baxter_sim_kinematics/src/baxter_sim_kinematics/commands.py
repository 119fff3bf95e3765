# SPDX-License-Identifier: BSD-3-Clause
"""The commands fk, ik and reach: their shared options, and each command. They need no master."""
import argparse
import csv
import json
import math
import os
import sys
from pathlib import Path

import numpy as np

from baxter_model import BASE_FRAME, SIDES, poses, tip_of
from baxter_sim_kinematics.chain import Chain
from baxter_sim_kinematics.errors import KinematicsError, NoSolution
from baxter_sim_kinematics.ik import solve_all
from baxter_sim_kinematics.reach import MapSettings, compute, yoshikawa
from baxter_sim_kinematics.target import Target, pose_from_quaternion
from urdf_model import UrdfError, parse_urdf
from urdf_model.transforms import quaternion_from_matrix, rigid, rpy_matrix


def _robot(path):
    """Return the urdf_model.Robot in a URDF or xacro file, of Baxter where ``path`` is None."""
    if path is None:
        import rospkg
        path = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro"
    path = Path(path)
    if path.suffix == ".xacro":
        import xacro
        try:
            text = xacro.process_file(str(path)).toxml()
        except Exception as error:  # its expressions are Python: they can raise anything
            raise UrdfError("xacro cannot expand %s: %s" % (path, " ".join(str(error).split()))) from None
        return parse_urdf(text, source=str(path))
    return parse_urdf(path.read_text(), source=str(path))


def _parser(description):
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", choices=SIDES, default="left", help="arm of Baxter (default: left)")
    parser.add_argument("--urdf", type=Path, help="another robot's URDF or xacro file; give --tip with it")
    parser.add_argument("--base", default=None, help="link that poses are given in (default: base, or the root)")
    parser.add_argument("--tip", help="link that is put there (default: <side>_gripper)")
    return parser


def _numbers(parser):
    """Let negative numbers such as -1e-3 be values, not options."""
    import re
    parser._negative_number_matcher = re.compile(r"^-(\d|\.\d)\S*$")
    return parser


def _chain(options):
    robot = _robot(options.urdf)
    base = options.base or (BASE_FRAME if options.urdf is None else robot.root)
    if options.tip is None and options.urdf is not None:
        raise UrdfError("with --urdf say --tip too; the links are %s" % ", ".join(robot.links))
    return robot, Chain.from_robot(robot, base, options.tip or tip_of(options.side))


def _run_command(main):
    """Run a command; its own errors become one line and exit status 1."""
    try:
        return main()
    except (KinematicsError, UrdfError, OSError, ValueError) as error:
        print("%s: %s" % (Path(sys.argv[0]).name, error), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 130


def _row(values, number="%.6f"):
    return " ".join(number % value for value in values)


# -- fk --------------------------------------------------------------------------------------------------------------


def fk():
    """Entry point of ``rosrun baxter_sim_kinematics fk``."""
    neutral = poses().angles("neutral", SIDES[0]).values()
    parser = _numbers(_parser("Where the tip of an arm is for given joint values.\n\n"
                              "  rosrun baxter_sim_kinematics fk %s" % _row(neutral, "%g")))
    parser.add_argument("q", type=float, nargs="+", metavar="Q", help="joint values, base to tip [rad, m]")
    parser.add_argument("--degrees", action="store_true", help="the joint values are in degrees")
    parser.add_argument("--jacobian", action="store_true", help="print the Jacobian as well")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return _run_command(lambda: _fk(parser.parse_args()))


def _fk(options):
    _, chain = _chain(options)
    q = chain.posture(np.radians(options.q) if options.degrees else options.q)
    pose, jacobian = chain.fk_and_jacobian(q)
    beyond = [name for name, value, low, high in zip(chain.joint_names, q, chain.lower, chain.upper, strict=True)
              if not low <= value <= high]
    result = {"frame": chain.base, "tip": chain.tip, "position": pose[:3, 3].tolist(),
              "quaternion_xyzw": quaternion_from_matrix(pose).tolist(), "manipulability": yoshikawa(jacobian),
              "beyond_limits": beyond}
    if options.jacobian:
        result["jacobian"] = jacobian.tolist()
    if options.json:
        print(json.dumps(result))
        return 0
    print("%s in %s" % (chain.tip, chain.base))
    print("position    %s m" % _row(result["position"]))
    print("quaternion  %s (x y z w)" % _row(result["quaternion_xyzw"]))
    print("manipulability %.4f" % result["manipulability"])
    if options.jacobian:
        print("Jacobian (linear rows first)\n" + "\n".join(_row(row) for row in jacobian))
    if beyond:
        print("beyond its limits: %s" % ", ".join(beyond))
    return 0


# -- ik --------------------------------------------------------------------------------------------------------------


def ik():
    """Entry point of ``rosrun baxter_sim_kinematics ik``."""
    parser = _numbers(_parser("Joint values that put the tip of an arm somewhere, or why there are none.\n\n"
                              "  rosrun baxter_sim_kinematics ik 0.644 0 0.066 -0.381 0.923 -0.015 0.052"))
    parser.add_argument("pose", type=float, nargs="+", metavar="N",
                        help="x y z [m], then the quaternion x y z w or, with --rpy, roll pitch yaw [rad]; "
                             "x y z alone with --position-only")
    parser.add_argument("--rpy", action="store_true", help="the orientation is roll pitch yaw")
    parser.add_argument("--position-only", action="store_true", help="any orientation will do")
    parser.add_argument("--free-axis", type=float, nargs=3, metavar=("X", "Y", "Z"),
                        help="any turn about this axis of the tip will do")
    parser.add_argument("--seed", type=float, nargs="+", metavar="Q", help="start here (default: mid-range)")
    parser.add_argument("--solutions", type=int, default=1, metavar="N", help="up to N distinct ones (default: 1)")
    parser.add_argument("--clear", action="store_true", help="only postures where the robot does not touch itself")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return _run_command(lambda: _ik(parser, parser.parse_args()))


def _ik(parser, options):
    expected = 3 if options.position_only else 6 if options.rpy else 7
    if len(options.pose) != expected:
        parser.error("expected %d numbers for the pose, got %d" % (expected, len(options.pose)))
    position, turn = options.pose[:3], options.pose[3:]
    if options.position_only:
        target = rigid(np.eye(3), position)
    elif options.rpy:
        target = rigid(rpy_matrix(*turn), position)
    else:
        target = pose_from_quaternion(position, turn)
    robot, chain = _chain(options)
    seed = chain.mid_range if options.seed is None else options.seed
    try:
        results = solve_all(chain, Target(target, options.position_only, options.free_axis), seed, options.solutions,
                            checker=_self_checker(robot) if options.clear else None)
    except NoSolution as failure:
        if options.json:
            print(json.dumps({"solutions": [], "reason": failure.reason.value, "detail": failure.detail,
                              "joints": list(failure.joints), "excess": list(failure.excess),
                              "links": list(failure.pair), "short_m": failure.residual_m,
                              "short_rad": failure.residual_rad, "nearest_position": failure.nearest[:3, 3].tolist(),
                              "nearest_q": failure.best.tolist()}))
        else:
            print("no solution: %s" % failure)
        return 1
    if options.json:
        print(json.dumps({"joints": list(chain.joint_names), "solutions": [result.q.tolist() for result in results]}))
        return 0
    print(" ".join(chain.joint_names))
    for result in results:
        print(_row(result.q))
    return 0


def _self_checker(robot):
    from baxter_sim_kinematics.bullet_checker import self_checker
    from model_files.resources import ResourceFinder
    return self_checker(robot, ResourceFinder())


# -- reach -----------------------------------------------------------------------------------------------------------


def reach():
    """Entry point of ``rosrun baxter_sim_kinematics reach``."""
    parser = _numbers(_parser(
        "Map what an arm reaches: in each cell of a volume the share of orientations that the tip can have\n"
        "there, and the mean manipulability. Writes reach.csv, reach.npz and reach.png. If interrupted, it continues\n"
                    "when called again.\n\n"
        "  rosrun baxter_sim_kinematics reach --volume 0.2 1.2 -0.4 1.0 -0.4 0.8 --tool 0 0 -1 --out map"))
    parser.add_argument("--volume", type=float, nargs=6, default=(-0.4, 1.3, -0.8, 1.4, -0.6, 1.3),
                        metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"), help="[m] (default: all of Baxter's left arm)")
    parser.add_argument("--cell", type=float, default=0.1, help="edge of a cell [m] (default: 0.1)")
    parser.add_argument("--orientations", type=int, default=24, help="tried in each cell (default: 24)")
    parser.add_argument("--tool", type=float, nargs=3, metavar=("X", "Y", "Z"),
                        help="the tip's z axis points there, and only turns about it are tried; 0 0 -1 is down")
    parser.add_argument("--starts", type=int, default=40, help="random starts before a pose counts as out of reach")
    parser.add_argument("--self-collision", action="store_true",
                        help="only postures count in which the robot does not touch itself")
    parser.add_argument("--out", type=Path, default=Path("reach"), help="folder (default: reach)")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes (default: all cores)")
    return _run_command(lambda: _reach(parser.parse_args()))


def _reach(options):
    from baxter_sim_kinematics.reach_picture import draw

    robot, chain = _chain(options)
    volume = options.volume
    geometry = [*np.concatenate([part.ravel() for part in (*chain.arrays[:2], *chain.limit_arrays)]).round(6).tolist()]
    settings = MapSettings(tuple(volume[0::2]), tuple(volume[1::2]), options.cell, options.orientations,
                        None if options.tool is None else tuple(options.tool), options.starts,
                        "%s to %s, %s" % (chain.base, chain.tip, geometry), options.self_collision)
    if options.jobs < 1:
        raise ValueError("--jobs must be at least 1, got %d" % options.jobs)
    share, manipulability = compute(chain, settings, options.out, options.jobs, _Bar(),
                                    lambda: _self_checker(robot))
    np.savez_compressed(options.out / "reach.npz", share=share, manipulability=manipulability, lower=settings.lower,
                        upper=settings.upper, cell_m=settings.cell_m, orientations=settings.orientations,
                        self_collision=settings.self_collision)
    with open(options.out / "reach.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("x_m", "y_m", "z_m", "reached_percent", "mean_manipulability"))
        for centre, part, value in zip(settings.centres(), share.ravel(), manipulability.ravel(), strict=True):
            writer.writerow((*("%.4f" % c for c in centre), "%.2f" % (100.0 * part),
                             "" if math.isnan(value) else "%.5f" % value))
    draw(share, settings, options.out / "reach.png")
    print("%d of %d cells are reached, %.1f %% of all poses; see %s" % (
        (share > 0).sum(), share.size, 100.0 * share.mean(), options.out))
    return 0


class _Bar:
    """A progress bar on a terminal, a line every tenth elsewhere."""

    def __init__(self):
        self._last = -1

    def __call__(self, done, total):
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
