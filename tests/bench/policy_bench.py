# SPDX-License-Identifier: BSD-3-Clause
"""A policy over ROS, in lock-step, beside the same policy in its environment with the simulator's tick: twenty seeds a
round, other ones in each. The policy is that of `./baxter.sh learn PickPlace`."""
import re
import subprocess
from pathlib import Path

from labs import Lab

from robot_learning.evaluation import core_for, play
from robot_learning.policy import load

POLICY = Path(__file__).resolve().parents[2] / ".baxter/learned/PickPlace/policy.npz"
SEEDS = 20
# A tick of /gazebo [s]; environments have a longer one by default.
STEP_S = 0.002
_TOLD = re.compile(r"succeeded \(seed (\d+): (\w+)\)")


def measure(report, quick, number):
    if not POLICY.is_file():
        raise SystemExit("there is no %s; ./baxter.sh learn PickPlace makes it" % POLICY)
    count = SEEDS // 10 if quick else SEEDS
    seeds = range(number * SEEDS, number * SEEDS + count)
    over_ros = {int(seed): said == "success" for seed, said in _TOLD.findall(played(POLICY, seeds))}
    if sorted(over_ros) != list(seeds):
        raise SystemExit("the node played the seeds %s, not %s" % (sorted(over_ros), list(seeds)))
    policy = load(POLICY)
    core = core_for(policy.contract, physics_step_s=STEP_S)
    here = {seed: play(core, policy, seed)["success"] for seed in seeds}
    core.close()
    alike = sum(here[seed] == over_ros[seed] for seed in seeds)
    report.add("PickPlace by a policy over ROS", 100.0 * sum(over_ros.values()) / count, "%",
               ("in the environment", 100.0 * sum(here.values()) / count), samples=count, pooled=True)
    report.add("seeds with the same end", 100.0 * alike / count, "%", samples=count, pooled=True)


def played(policy, seeds):
    """The lines of the node, which plays these seeds in a new lab."""
    with Lab(gui="false", enable="true", pose="neutral") as lab:
        subprocess.run(["rosservice", "call", "/gazebo/pause_physics"], check=True, env=lab.environment,
                       stdout=subprocess.DEVNULL)
        node = lab.start("rosrun", "robot_learning", "policy", "_policy:=%s" % policy, "_episode_seed:=%d" % seeds[0],
                         "_episodes:=%d" % len(seeds), "_lock_step:=true", "_without_switch:=true",
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        return node.communicate()[0]
