#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics on random reachable poses: ours beside TRAC-IK, in one run on one machine, with ratios.

    ./baxter.sh sim tests/bench/ik_bench.py [--poses 10000] [--side left] [--urdf FILE]

Every pose is the forward kinematics of a posture drawn evenly between the limits; both start at mid-range. A pose
counts as solved when our forward kinematics confirms it to 2e-5 m and 2e-5 rad inside the limits. TRAC-IK is optional:
`pip install pytracik` into the workspace's .venv; it gets its usual limit of 5 ms a pose.
"""
import argparse
import sys
import time
from pathlib import Path

import numpy as np

from baxter_sim_kinematics import Chain, NoSolution, solve, warm_up
from urdf_model import parse_urdf
from urdf_model.transforms import rotation_angle

TOLERANCE = 1e-5  # m and rad, as TRAC-IK's own tables use; each of the six components
CONFIRMED = 2e-5  # the length of three such components, and a little
LIMIT_SLACK = 1e-6  # rad; pytracik keeps limits in single precision
TRAC_IK_LIMIT_S = 0.005
MODEL = Path(__file__).resolve().parents[2] / "src/baxter/baxter_common/baxter_description/urdf/baxter.urdf"


def confirmed(chain, q, target):
    if q is None or (q < chain.lower - LIMIT_SLACK).any() or (q > chain.upper + LIMIT_SLACK).any():
        return False
    tip = chain.fk(q)
    return (np.linalg.norm(tip[:3, 3] - target[:3, 3]) <= CONFIRMED
            and rotation_angle(tip[:3, :3].T @ target[:3, :3]) <= CONFIRMED)


def measure(name, chain, targets, answer):
    """Time ``answer(target)`` -> q or None over all targets; print and return (share solved, mean time [ms])."""
    times, solved = [], 0
    for target in targets:
        start = time.perf_counter()
        q = answer(target)
        times.append(time.perf_counter() - start)
        solved += confirmed(chain, q, target)
    milliseconds = 1e3 * np.array(times)
    share, mean = solved / len(targets), milliseconds.mean()
    print("%-24s %7.2f %% solved   mean %7.4f ms   median %7.4f   p99 %7.4f   max %8.4f"
          % (name, 100.0 * share, mean, *np.percentile(milliseconds, (50, 99)), milliseconds.max()))
    return share, mean


def ours(chain, candidates):
    seed = chain.mid_range

    def answer(target):
        try:
            return solve(chain, target, seed, candidates=candidates).q
        except NoSolution:
            return None

    return answer


def trac_ik(chain, urdf):
    """Return a function like :func:`ours`, or None where pytracik is not installed."""
    try:
        from trac_ik import TracIK
    except ImportError:
        return None
    solver = TracIK(base_link_name=chain.base, tip_link_name=chain.tip, urdf_path=str(urdf), timeout=TRAC_IK_LIMIT_S,
                    epsilon=TOLERANCE)
    seed = chain.mid_range
    return lambda target: solver.ik(target[:3, 3], target[:3, :3], seed_jnt_values=seed)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=10000)
    parser.add_argument("--side", choices=("left", "right"), default="left")
    parser.add_argument("--urdf", type=Path, default=MODEL)
    options = parser.parse_args()
    if not options.urdf.exists():
        sys.exit("%s is missing: run ./baxter.sh setup, or name another model with --urdf" % options.urdf)
    chain = Chain.from_robot(parse_urdf(options.urdf.read_text(), source=str(options.urdf)), "base",
                             options.side + "_gripper")
    warm_up(chain)
    rng = np.random.default_rng(0)
    targets = [chain.fk(q) for q in rng.uniform(chain.lower, chain.upper, (options.poses, len(chain)))]
    print("%d random reachable poses, %s arm, seed at mid-range" % (options.poses, options.side))
    measure("ours, first arrival", chain, targets, ours(chain, 1))
    share, mean = measure("ours", chain, targets, ours(chain, 2))
    other = trac_ik(chain, options.urdf)
    if other is None:
        print("TRAC-IK is not installed; for the comparison: .venv/bin/pip install --no-deps pytracik==0.0.3")
        return
    other_share, other_mean = measure("TRAC-IK, 5 ms limit", chain, targets, other)
    print("ours to TRAC-IK: time x %.3f, unsolved poses %d to %d"
          % (mean / other_mean, round((1 - share) * options.poses), round((1 - other_share) * options.poses)))


if __name__ == "__main__":
    main()
