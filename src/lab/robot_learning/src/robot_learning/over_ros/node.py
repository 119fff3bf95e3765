# SPDX-License-Identifier: BSD-3-Clause
"""Run a policy file on a robot of a ROS master, simulated or physical."""
from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rospy
from bullet_sim_msgs.srv import AdvanceTicks
from std_msgs.msg import Bool, String, UInt16

from baxter_lab import Mode
from baxter_model import SIDES, poses
from demonstrations.frames import DemonstrationError
from gazebo_ros.gazebo_interface import GazeboInterfaceError, call
from gym_baxter.controls import ArmControl
from gym_baxter.core import Core
from gym_baxter.names import action_names, robot_names
from gym_baxter.tasks import STAGE_TASKS, robosuite_start
from rospy_nodes.start import limit_ports

from ..driving import ACTING, FAILED, STOPPED, SUCCEEDED, WAITING, DrivingLimits, Situation, limited, reason_to_wait
from ..policy import Acting, PolicyError, Runner, load
from .robot import RosRobot
from .scene import RosLab

_DESCRIPTION = """Run a policy file on /robot. Subscribes: ~hold (std_msgs/Bool): the dead-man's switch; the robot moves
only while true comes again and again. Publishes: ~state (std_msgs/String): waiting, acting, success, failure, stopped,
with the reason; /steering/mark: success or failure at an episode's end. Parameters: ~policy (the file), ~episode_seed
(the arms go to the start, the things of the task are put in the simulator; -1: all stay), ~episodes (how many, with
this seed and those after it), ~hold_s, ~seen_s, ~speed_rad_s, ~off_rad (limits), ~lock_step (advance a paused simulator
instead of waiting for the clock; joint states then come at each tick, and at 100 Hz when the node ends),
~without_switch (only with ~lock_step). Ends with 0 if all episodes succeeded."""
#: Set-points between two actions, as in the environments [Hz].
_STREAM_HZ = 100
#: Wall time that is waited for messages, and between two looks [s].
_FOUND_WITHIN_S, _POLL_S = 20.0, 0.005
#: Of the simulator in lock-step: its rate, and wall time for an answer [s].
_TICKS_HZ, _ADVANCE_S = 500, 10.0
#: Joint states come at each tick then, else at the robot's usual rate [Hz]; and wall time in which that begins [s].
_USUAL_HZ, _TRY_S = 100, 0.2
#: At the start an arm is so near [rad], within so much time [s]; commands are repeated as often [s].
_START_RAD, _START_S, _REPEAT_S = 0.02, 20.0, 0.1


class PolicyNode:
    """A policy, its robot and its task's things. Raises PolicyError, GazeboInterfaceError."""

    sides = SIDES
    agent_pos = Core.agent_pos  # the same numbers as in the environments, from `lab.robot`

    def __init__(self, policy: Acting, limits: DrivingLimits, lock_step: bool, without_switch: bool):
        self._policy, self._limits, self._lock_step = policy, limits, lock_step
        contract = policy.contract
        self.sides = SIDES[::-1] if contract.robosuite_order else SIDES
        if contract.task not in STAGE_TASKS:
            raise PolicyError("the policy is for %s; on a ROS master there are %s"
                              % (contract.task, ", ".join(STAGE_TASKS)))
        if _STREAM_HZ % contract.rate_hz:
            raise PolicyError("the policy's rate, %d Hz, does not divide %d" % (contract.rate_hz, _STREAM_HZ))
        self._held, self._always = float("-inf"), lock_step and without_switch
        self._states = rospy.Publisher("~state", String, queue_size=10, latch=True)
        self._marks = rospy.Publisher("/steering/mark", String, queue_size=10)
        self._kept = rospy.Subscriber("~hold", Bool, self._on_hold, queue_size=1)
        self.lab = RosLab(RosRobot())
        self.task = STAGE_TASKS[contract.task](self.lab)
        named = (*robot_names(self.sides), *self.task.OBSERVED)
        contract.require(observation=[name for name, _ in named], units=[unit for _, unit in named],
                         action=[name for name, _ in action_names(contract.control, self.sides)])
        self._wait(lambda: self._age_s() < limits.seen_s or lock_step, "joint states, grippers and models of the robot")
        self._controls = [ArmControl(self.lab.robot.arms[side], contract.control) for side in self.sides]
        self._told = ""
        if lock_step:
            self._see_every_tick()

    def _on_hold(self, message: Bool) -> None:
        self._held = time.monotonic() if message.data else float("-inf")

    def _wait(self, condition: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + _FOUND_WITHIN_S
        while not condition():
            if rospy.is_shutdown() or time.monotonic() > end:
                raise PolicyError("not there within %g s: %s" % (_FOUND_WITHIN_S, what))
            time.sleep(_POLL_S)

    def _see_every_tick(self) -> None:
        """Have joint states come at each tick, until the node ends: at the usual rate they are up to 10 ms old, and in
        an environment they are of the present tick."""
        rate = rospy.Publisher("/robot/joint_state_publish_rate", UInt16, queue_size=1)
        self._wait(rate.get_num_connections, "a subscriber of %s" % rate.name)
        rospy.on_shutdown(lambda: rate.publish(_USUAL_HZ))
        rate.publish(_TICKS_HZ)

        def is_seen() -> bool:
            now = self._advance(1)
            end = time.monotonic() + _TRY_S
            while time.monotonic() < end and not self._sees(now):
                time.sleep(_POLL_S)
            return self._sees(now)
        self._wait(is_seen, "joint states at each tick")

    def _sees(self, now: float) -> bool:
        """Whether the joint states of the tick at `now` [s] are there."""
        return self.lab.robot.stamp > now - 0.5 / _TICKS_HZ

    def _age_s(self) -> float:
        return max(self.lab.robot.age_s, float("inf") if self.lab.seen is None else rospy.get_time() - self.lab.seen)

    def _tell(self, state: str, reason: str = "") -> None:
        text = "%s: %s" % (state, reason) if reason else state
        if text != self._told:
            self._told = text
            self._states.publish(text)
            rospy.loginfo("policy: %s", text)

    def _situation(self) -> Situation:
        robot = self.lab.robot
        off = max(float(np.abs(control.target - robot.arms[side].angles).max())
                  for control, side in zip(self._controls, self.sides, strict=True))
        held_s = 0.0 if self._always else time.monotonic() - self._held
        return Situation(held_s, 0.0 if self._lock_step else self._age_s(), robot.enabled, robot.stopped, off)

    def episode(self, seed: int | None) -> bool:
        """Act until the task is done, for as many actions as in the environment; returns whether it is. seed: where the
        things are put first, None: where they are. Time in which the switch is not held does not count."""
        if seed is not None:
            self._go_to_start()
            self.task.begin(np.random.default_rng(seed))
            self._pass(_REPEAT_S)
        runner, steps, acts = Runner(self._policy), 0, False
        self._begin(runner)
        while steps < self.task.STEPS and not rospy.is_shutdown():
            if reason := reason_to_wait(self._limits, self._situation()):
                self._tell(STOPPED if acts else WAITING, reason)
                acts = False
                time.sleep(_POLL_S)
                self._begin(runner)
                continue
            acts = True
            self._tell(ACTING)
            self._act(runner.act(np.concatenate([self.agent_pos(), self.task.observed()])))
            steps += 1
            if self.task.succeeded():
                self._end(SUCCEEDED)
                return True
        self._end(FAILED)
        return False

    def episodes(self, seeds: Sequence[int]) -> list[int]:
        """One episode after the other; returns the seeds of those that succeeded, and says how many."""
        good = []
        for number, seed in enumerate(seeds, 1):
            if self.episode(seed):
                good.append(seed)
            if rospy.is_shutdown():
                break
            rospy.loginfo("policy: %d of %d succeeded (seed %d: %s)", len(good), number, seed,
                          SUCCEEDED if seed in good else FAILED)
        return good

    def _begin(self, runner):
        """Where the arms are is where they go on from."""
        for control in self._controls:
            control.reset()
        runner.begin()
        self._look()

    def _look(self):
        """See the things as they are now; by the clock, they come by themselves."""
        if self._lock_step:
            self.lab.look()

    def _go_to_start(self):
        """Both arms to the task's start, while nothing speaks against it. Raises PolicyError."""
        if self.task.POSE is None:
            start = robosuite_start()
        else:
            table = poses()
            start = {side: np.array(list(table.angles(self.task.POSE, side).values())) for side in SIDES}
        arms, end = self.lab.robot.arms, rospy.get_time() + _START_S
        while not all(np.abs(arms[side].angles - angles).max() < _START_RAD for side, angles in start.items()):
            if rospy.get_time() > end:
                raise PolicyError("the arms are not at the start within %g s: %s" % (_START_S, self._told))
            self._begin(Runner(self._policy))
            if reason := reason_to_wait(self._limits, self._situation()):
                self._tell(WAITING, reason)
                time.sleep(_POLL_S)
                end = rospy.get_time() + _START_S
                continue
            for side, angles in start.items():
                arms[side].command(Mode.POSITION, angles)
                arms[side].gripper.command("release")
            self._pass(_REPEAT_S)

    def _end(self, state: str) -> None:
        self._tell(state)
        self._marks.publish(state)

    def _act(self, action: np.ndarray) -> None:
        points = _STREAM_HZ // self._policy.contract.rate_hz
        begins = [control.target.copy() for control in self._controls]
        for control, begin, part in zip(self._controls, begins, np.split(action, len(self._controls)), strict=True):
            control.take(np.clip(part, -1.0, 1.0))
            control.target = limited(begin, control.target, self._limits.speed_rad_s / self._policy.contract.rate_hz)
        for point in range(points):
            for control, begin in zip(self._controls, begins, strict=True):
                control.send((point + 1) / points, begin)
            self._pass(1.0 / _STREAM_HZ, ["/robot/limb/%s/joint_command" % side for side in SIDES])
        self._look()

    def _pass(self, seconds: float, topics: Sequence[str] = ()) -> None:
        """Let simulated time pass; in lock-step, after messages on `topics`, and until the joint states are there."""
        if not self._lock_step:
            rospy.sleep(seconds)
            return
        now = self._advance(round(seconds * _TICKS_HZ), topics)
        self._wait(lambda: self._sees(now), "joint states of %.3f s" % now)

    def _advance(self, ticks: int, topics: Sequence[str] = ()) -> float:
        """Let the simulator make ticks, after messages on `topics`; returns the time [s]."""
        answer = call("/gazebo/advance", AdvanceTicks, ticks, list(topics), _ADVANCE_S)
        if not answer.success:
            raise GazeboInterfaceError(answer.status_message)
        return answer.sim_time.to_sec()


def main() -> None:
    """The program."""
    argparse.ArgumentParser(description=_DESCRIPTION).parse_args(rospy.myargv()[1:])
    limit_ports()
    try:
        rospy.init_node("policy")
        limits = DrivingLimits(**{name: float(rospy.get_param("~" + name, default))
                                  for name, default in vars(DrivingLimits()).items()})
        policy = load(Path(rospy.get_param("~policy", "policy.npz")).expanduser())
        node = PolicyNode(policy, limits, bool(rospy.get_param("~lock_step", False)),
                          bool(rospy.get_param("~without_switch", False)))
        seed, count = int(rospy.get_param("~episode_seed", -1)), int(rospy.get_param("~episodes", 1))
        if count < 1 or (count > 1 and seed < 0):
            raise ValueError("~episodes is %d; it must be 1 or more, and more than 1 need ~episode_seed" % count)
        if seed < 0:
            sys.exit(0 if node.episode(None) else 1)
        sys.exit(0 if len(node.episodes(range(seed, seed + count))) == count else 1)
    except (PolicyError, DemonstrationError, GazeboInterfaceError, ValueError, KeyError,
            rospy.ROSInitException) as error:
        sys.exit("policy: %s" % error)
