# SPDX-License-Identifier: BSD-3-Clause
"""The commands fk and ik, and what they share with those of reach_commands. They need no master."""
from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.chain import Chain
from arm_kinematics.errors import KinematicsError, NoSolution
from arm_kinematics.ik import solve_all
from arm_kinematics.reach import yoshikawa
from arm_kinematics.target import Target, pose_from_quaternion
from baxter_model import BASE_FRAME, SIDES, poses, tip_of
from command_line.options import counted, number
from urdf_model import UrdfError, description_text, parse_urdf
from urdf_model.transforms import quaternion_from_matrix, rigid, rpy_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable

    from arm_kinematics.bullet_checker import BulletChecker
    from urdf_model.model import Robot


def read_robot(path: str | Path | None) -> Robot:
    """Return the urdf_model.Robot in a URDF or xacro file, of Baxter where ``path`` is None."""
    if path is None:
        import rospkg
        path = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro"
    return parse_urdf(description_text(Path(path)), source=str(path))


def new_parser(description: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", choices=SIDES, default="left", help="arm of Baxter (default: left)")
    parser.add_argument("--urdf", type=Path, help="another robot's URDF or xacro file; give --tip with it")
    parser.add_argument("--base", default=None, help="link that poses are given in (default: base, or the root)")
    parser.add_argument("--tip", help="link that is put there (default: <side>_gripper)")
    return parser


def with_numbers(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Let negative numbers such as -1e-3 be values, not options."""
    import re
    parser._negative_number_matcher = re.compile(r"^-(\d|\.\d)\S*$")
    return parser


def chain_of(options: argparse.Namespace) -> tuple[Robot, Chain]:
    robot = read_robot(options.urdf)
    base = options.base or (BASE_FRAME if options.urdf is None else robot.root)
    if options.tip is None and options.urdf is not None:
        raise UrdfError("with --urdf say --tip too; the links are %s" % ", ".join(robot.links))
    return robot, Chain.from_robot(robot, base, options.tip or tip_of(options.side))


def run_command(main: Callable[[], int]) -> int:
    """Run a command; its own errors become one line and exit status 1."""
    try:
        return main()
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (KinematicsError, UrdfError, OSError, ValueError) as error:
        print("%s: %s" % (Path(sys.argv[0]).name, error), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 130


def _row(values: Iterable[float], number: str = "%.6f") -> str:
    return " ".join(number % value for value in values)


# -- fk --------------------------------------------------------------------------------------------------------------


def fk() -> int:
    """Entry point of ``rosrun baxter_sim_kinematics fk``."""
    neutral = poses().angles("neutral", SIDES[0]).values()
    parser = with_numbers(new_parser("Where the tip of an arm is for given joint values.\n\n"
                                     "  rosrun baxter_sim_kinematics fk %s" % _row(neutral, "%g")))
    parser.add_argument("q", type=float, nargs="+", metavar="Q", help="joint values, base to tip [rad, m]")
    parser.add_argument("--degrees", action="store_true", help="the joint values are in degrees")
    parser.add_argument("--jacobian", action="store_true", help="print the Jacobian as well")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return run_command(lambda: _fk(parser.parse_args()))


def _fk(options: argparse.Namespace) -> int:
    _, chain = chain_of(options)
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


def ik() -> int:
    """Entry point of ``rosrun baxter_sim_kinematics ik``."""
    parser = with_numbers(new_parser("Joint values that put the tip of an arm somewhere, or why there are none.\n\n"
                                     "  rosrun baxter_sim_kinematics ik 0.644 0 0.066 -0.381 0.923 -0.015 0.052"))
    parser.add_argument("pose", type=float, nargs="+", metavar="N",
                        help="x y z [m], then the quaternion x y z w or, with --rpy, roll pitch yaw [rad]; "
                             "x y z alone with --position-only")
    parser.add_argument("--rpy", action="store_true", help="the orientation is roll pitch yaw")
    parser.add_argument("--position-only", action="store_true", help="any orientation will do")
    parser.add_argument("--free-axis", type=float, nargs=3, metavar=("X", "Y", "Z"),
                        help="any turn about this axis of the tip will do")
    parser.add_argument("--seed", type=float, nargs="+", metavar="Q", help="start here (default: mid-range)")
    parser.add_argument("--solutions", type=number(int, 1, 1000), default=1, metavar="N",
                        help="up to N distinct ones (default: 1)")
    parser.add_argument("--clear", action="store_true", help="only postures where the robot does not touch itself")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return run_command(lambda: _ik(parser, parser.parse_args()))


def _ik(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    expected = 3 if options.position_only else 6 if options.rpy else 7
    if len(options.pose) != expected:
        parser.error("expected %s for the pose, got %d" % (counted(expected, "number"), len(options.pose)))
    position, turn = options.pose[:3], options.pose[3:]
    if options.position_only:
        target = rigid(np.eye(3), position)
    elif options.rpy:
        target = rigid(rpy_matrix(*turn), position)
    else:
        target = pose_from_quaternion(position, turn)
    robot, chain = chain_of(options)
    seed = chain.mid_range if options.seed is None else options.seed
    try:
        results = solve_all(chain, Target(target, options.position_only, options.free_axis), seed, options.solutions,
                            checker=self_collision_checker(robot, tell) if options.clear else None)
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


def self_collision_checker(robot: Robot, warn: Callable[[str], None]) -> BulletChecker:
    """Return a BulletChecker of ``robot`` alone; ``warn`` is called with a text where a mesh is missing."""
    from baxter_sim_kinematics.self_checker import self_checker
    from model_files.resources import ResourceFinder
    return self_checker(robot, ResourceFinder(), warn)


def tell(text: str) -> None:
    """Print a warning of this command."""
    print("%s: %s" % (Path(sys.argv[0]).name, text), file=sys.stderr)
