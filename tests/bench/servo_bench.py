# SPDX-License-Identifier: BSD-3-Clause
"""The servo in random streams of twists, 20 s each of the arm's time, among the objects of the planning problems.

Every stream begins at the start of another problem, and its twist changes once a second; through singularities, joint
limits and obstacles. Checked are the limits of each step, every fourth posture by exact geometry, and whether the arm
can leave where the stream ends. Times are CPU times of one thread for a step. A round has 40 streams, with ``--all``
200.
"""
import os
import time

import numpy as np
import planning_problems as problems

from motion_planning.planners.planning import sphere_model_of
from moveit_servo.servo import Command, Servo
from moveit_servo.settings import ServoSettings
from moveit_servo.surroundings import Surroundings

STREAMS, STREAMS_OF_ALL, QUICK = 40, 200, 4
STREAM_S, TWIST_S, DT = 20.0, 1.0, 0.008
# Standard deviations of twists [m/s, rad/s], and the share of pauses.
TWIST, PAUSES = np.repeat((0.3, 0.6), 3), 0.15
ACCELERATION = 10.0  # [rad/s^2]
# The joints follow their set-points with this time constant [s].
LAG_S = 0.02
SEEN = 4
# Time for each direction at the end of a stream [s], and the joint motion that counts [rad].
LEAVING_S, MOVED_RAD = 0.4, 0.01


def measure(report, quick, number):
    streams = QUICK if quick else STREAMS_OF_ALL if os.environ.get("BENCH_ALL") else STREAMS
    for name, robot, place in (("Baxter, one arm", problems.baxter(), problems.BAXTER_PLACE),
                               ("PROBOT", problems.probot(), problems.PROBOT_PLACE)):
        times, worst, contacts, stuck = [], 0.0, 0, 0
        for k in range(streams // 2):
            seed = 100000 + number * STREAMS_OF_ALL + k
            stream = Stream(problems.table(robot, place, seed), np.random.default_rng(seed))
            times += stream.run()
            worst, contacts, stuck = max(worst, stream.worst()), contacts + stream.touches(), stuck + stream.is_stuck()
        times = 1e3 * np.array(times)
        count = streams // 2
        report.add("%s: a step, median" % name, np.median(times), "ms", samples=len(times))
        report.add("%s: a step, p99" % name, np.percentile(times, 99), "ms", samples=len(times), most=2.0)
        report.add("%s: greatest share of a limit" % name, 100.0 * worst, "%", samples=count, most=100.01)
        every = {"samples": count, "pooled": True, "most": 0.0}
        report.add("%s: streams with a contact" % name, 100.0 * contacts / count, "%", **every)
        report.add("%s: streams with a dead end" % name, 100.0 * stuck / count, "%", **every)


class Stream:
    """A problem's arm under a random stream of twists."""

    def __init__(self, problem, rng):
        self.problem, self.rng = problem, rng
        model = problem.robot.model
        self.servo = Servo(model, ServoSettings(move_group_name=problem.group, command_out_topic="none",
                                                max_acceleration=ACCELERATION))
        self.servo.surroundings = Surroundings(sphere_model_of(problem.robot.exact), self.servo.group, problem.scene)
        self.q = np.array(problem.scene.state.q)
        self.indices = [model.index[joint] for joint in self.servo.joints]
        self.q[model.groups[problem.group].indices] = problem.start
        self.still, self.steps = np.zeros(len(self.q)), []

    def step(self, twist):
        made = self.servo.step(self.q, self.still, Command(twist=twist), DT)
        self.q[self.indices] += (made.position - self.q[self.indices]) * min(1.0, DT / LAG_S)
        return made

    def run(self):
        """Return the CPU time of each step [s]."""
        times = []
        for tick in range(round(STREAM_S / DT)):
            if tick % round(TWIST_S / DT) == 0:
                twist = self.rng.normal(size=6) * TWIST * (self.rng.random() > PAUSES)
            begin = time.thread_time()
            self.steps.append(self.step(twist))
            times.append(time.thread_time() - begin)
        return times

    def worst(self):
        """The greatest velocity, acceleration or jerk, in shares of its limit."""
        limits = self.servo.limits
        velocity, acceleration = (np.array([getattr(step, name) for step in self.steps])
                                  for name in ("velocity", "acceleration"))
        return max(float((np.abs(velocity) / limits.velocity).max()),
                   float((np.abs(acceleration) / limits.acceleration).max()),
                   float((np.abs(np.diff(acceleration, axis=0)) / DT / limits.jerk).max()))

    def touches(self):
        """Whether exact geometry finds a contact."""
        whole = np.tile(self.problem.scene.state.q, (len(self.steps[::SEEN]), 1))
        whole[:, self.indices] = [step.position for step in self.steps[::SEEN]]
        return self.problem.robot.exact.first_blocked(self.problem.scene, whole, self.problem.group) is not None

    def is_stuck(self):
        """Whether no direction moves the arm."""
        for row in range(6):
            for sign in (1.0, -1.0):
                before = self.q.copy()
                for _ in range(round(LEAVING_S / DT)):
                    self.step(0.2 * sign * np.eye(6)[row])
                if np.abs(self.q - before).max() > MOVED_RAD:
                    return False
        return True
