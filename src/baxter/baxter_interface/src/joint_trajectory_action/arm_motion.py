# SPDX-License-Identifier: BSD-3-Clause
"""The commands of the trajectory server to one arm, tick by tick. Free of ROS; time is an argument."""
from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from baxter_control.pid import PID
from joint_trajectory import Follower, GoalTolerances, Tolerances, bounds, merge_tolerances

if TYPE_CHECKING:
    from joint_trajectory import GoalVerdict
    from joint_trajectory.command import TrajectoryCommand
    from joint_trajectory.limits import Limits

# Duration of a stop, from the present velocity to rest [s].
STOP_DURATION_S = 0.25
# Tolerance of a trajectory beyond the position limits of the robot's description, and lag that a too fast joint may
# have [rad]. The robot's own tucked pose lies 0.03 rad beyond, and recordings of moves at full speed have steps of one
# reading, 0.015 to 0.03 rad.
LIMIT_SLACK_RAD = 0.05
_AS_SETTINGS = GoalTolerances()


class CommandMode(enum.Enum):
    """The command mode of an arm; the values are those of the server's option."""

    POSITION = "position"
    VELOCITY = "velocity"
    POSITION_WITH_DYNAMICS = "position_w_id"


class GoalDefaults(NamedTuple):
    """Tolerances and gains for a goal that gives none of its own; n joints.

    ``path``, ``goal`` (n,): position errors allowed during the motion and at the end [rad]; ``stopped_velocity``
    [rad/s]; 0 or less: any. ``goal_time_s``: allowed delay of the end. ``gains`` (3, n): kp, ki, kd of velocity mode,
    velocity [rad/s] per position error [rad].
    """

    path: np.ndarray
    goal: np.ndarray
    stopped_velocity: float
    goal_time_s: float
    gains: np.ndarray

    @classmethod
    def from_config(cls, config: dict[str, float], joint_names: list[str]) -> GoalDefaults:
        """From the server's parameters, a mapping; gains that a mode does not have are 0."""
        def column(ending: str, *default: float) -> np.ndarray:
            return np.array([config.get(name + ending, *default) for name in joint_names], dtype=float)

        return cls(column("_trajectory"), column("_goal"), float(config["stopped_velocity_tolerance"]),
                   float(config["goal_time"]), np.array([column(gain, 0.0) for gain in ("_kp", "_ki", "_kd")]))


class ArmMotion:
    """Follows goals with n joints, and holds them after the last one until :meth:`release`.

    Attributes
    ----------
    joint_names : list of n names
    goal : object or None The argument of :meth:`begin`, until the goal has ended.
    engaged : bool
        Whether the joints are being commanded.
    begin_s : float
        When the present goal's trajectory began [s].
    """

    def __init__(self, joint_names: list[str], mode: CommandMode, period_s: float,
                 limits: Limits | None = None) -> None:
        """``mode``: :class:`CommandMode`; ``period_s`` [s] between ticks; ``limits``:
        :class:`joint_trajectory.Limits`."""
        self.joint_names = list(joint_names)
        self.goal = None
        self.engaged = False
        self.begin_s = 0.0
        self._mode = mode
        self._period_s = period_s
        self._follower = Follower(self.joint_names, stop_duration_s=STOP_DURATION_S, allow_partial=True, smooth=True,
                                  limits=limits)
        self._named = np.zeros(len(self.joint_names), dtype=bool)
        self._pids = []
        self._now_s = 0.0
        self._output = np.zeros((3, len(self.joint_names)))

    def begin(self, command: TrajectoryCommand, now_s: float, position: np.ndarray, goal: Any, settings: GoalDefaults,
              wanted: GoalTolerances = _AS_SETTINGS) -> Any:
        """Follow ``command`` (:class:`joint_trajectory.TrajectoryCommand`) from ``now_s`` [s] on.

        ``position`` (n,): measured [rad]; ``goal``: any object. ``wanted``: the goal's own
        :class:`joint_trajectory.GoalTolerances`, which override ``settings`` (:class:`GoalDefaults`). Joints that the
        command does not name are not commanded, or continue with earlier commands. The previous goal is forgotten: the
        caller must tell its owner.

        Returns the :class:`joint_trajectory.Replacement`. Raises :class:`joint_trajectory.TrajectoryError`; nothing
        has changed then.
        """
        count = len(self.joint_names)
        defaults = Tolerances(bounds(count, position=settings.path),
                              bounds(count, position=settings.goal, velocity=settings.stopped_velocity),
                              settings.goal_time_s)
        tolerances = merge_tolerances(defaults, self.joint_names, *wanted)
        # The end is commanded one tick before; the arm is still moving then.
        tolerances = tolerances._replace(goal_time_s=tolerances.goal_time_s + 2.0 * self._period_s)
        if not self.engaged:
            self._follower.start(now_s, position, np.zeros(count))
        replacement = self._follower.accept(command, now_s, position, goal, tolerances)
        if not self.engaged:
            self._named[:] = False
            self._make_pids(settings)
        self._named |= np.isin(self.joint_names, command.joint_names)
        self._set_gains(settings)
        self.goal, self.engaged = goal, True
        self.begin_s = now_s if command.start_time is None else command.start_time
        return replacement

    def tick(self, now_s: float, position: np.ndarray, velocity: np.ndarray) -> GoalVerdict | None:
        """Look at the measured ``position``, ``velocity`` (n,); returns the :class:`GoalVerdict` if the goal ends now.

        A goal that fails during the motion stops the joints where they are; one that fails at its end holds the end.
        """
        self._now_s = now_s
        verdict = self._follower.update(now_s, position, velocity)
        if verdict is not None:
            on_the_way = self._follower.trajectory.end_time > now_s
            self.goal = None
            self._follower.release()
            if on_the_way:
                self._follower.start(now_s, position, velocity)
        # A command acts until the next one, so it is the position at that time.
        self._output[:] = self._follower.look_ahead(now_s + self._period_s)
        if self._mode is CommandMode.VELOCITY:
            self._correct()
        return verdict

    def command(self) -> dict[str, float]:
        """The command of this tick: {joint name: rad, or rad/s in velocity mode} of the joints that goals have
        named."""
        row = 1 if self._mode is CommandMode.VELOCITY else 0
        return {name: float(value) for name, value, named
                in zip(self.joint_names, self._output[row], self._named, strict=True) if named}

    @property
    def output(self) -> np.ndarray:
        """(3, n): position, velocity, acceleration that the last tick commands; read only."""
        return self._output

    @property
    def desired(self) -> np.ndarray:
        """(3, n): position, velocity, acceleration wanted at the last tick; read only."""
        return self._follower.desired

    @property
    def error(self) -> np.ndarray:
        """(3, n): wanted minus measured at the last tick; read only."""
        return self._follower.error

    def farthest(self, position: np.ndarray) -> tuple[str, float]:
        """The joint with the largest error to the end of the trajectory: (name, error [rad])."""
        end = self._follower.trajectory.sample(self._follower.trajectory.end_time)[0]
        error = np.where(self._named, end - position, 0.0)
        joint = int(np.argmax(np.abs(error)))
        return self.joint_names[joint], float(error[joint])

    def stop(self, now_s: float, position: np.ndarray) -> None:
        """End the goal, come to rest and hold."""
        self.goal = None
        self._follower.release()
        self._follower.stop(now_s, position)

    def release(self) -> None:
        """End the goal and command nothing any more."""
        self.goal = None
        self.engaged = False
        self._follower.release()

    def _make_pids(self, settings: GoalDefaults) -> None:
        self._pids = [PID(*gains, now=lambda: self._now_s) for gains in settings.gains.T.tolist()]

    def _set_gains(self, settings: GoalDefaults) -> None:
        for pid, (kp, ki, kd) in zip(self._pids, settings.gains.T.tolist(), strict=True):
            pid.set_kp(kp)
            pid.set_ki(ki)
            pid.set_kd(kd)

    def _correct(self) -> None:
        for joint, pid in enumerate(self._pids):
            self._output[1, joint] += pid.compute_output(float(self.error[0, joint]))
