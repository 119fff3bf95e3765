# SPDX-License-Identifier: BSD-3-Clause
"""Settings of planning: tolerances, constraints, planners, speed."""
from __future__ import annotations

from collections.abc import Sequence

import rospy
from moveit_msgs.msg import Constraints, TrajectoryConstraints

from .exception import MoveItCommanderException
from .requests import RequestSettings


class Tunable:
    """Something with settings for planning. Angles in rad, positions in m, times in s."""

    def __init__(self, settings: RequestSettings | None = None) -> None:
        self._settings = settings or RequestSettings()

    def get_goal_tolerance(self) -> tuple[float, float, float]:
        """Return the tolerances of joints, position and orientation."""
        settings = self._settings
        return settings.joint_tolerance, settings.position_tolerance, settings.orientation_tolerance

    def get_goal_joint_tolerance(self) -> float:
        """Return how far from the target a joint may end."""
        return self._settings.joint_tolerance

    def get_goal_position_tolerance(self) -> float:
        """Return the radius about the target's position."""
        return self._settings.position_tolerance

    def get_goal_orientation_tolerance(self) -> float:
        """Return the angle about each axis."""
        return self._settings.orientation_tolerance

    def set_goal_tolerance(self, value: float) -> None:
        """Set all three tolerances."""
        self.set_goal_joint_tolerance(value)
        self.set_goal_position_tolerance(value)
        self.set_goal_orientation_tolerance(value)

    def set_goal_joint_tolerance(self, value: float) -> None:
        """Set how far from the target a joint may end."""
        self._settings.joint_tolerance = float(value)

    def set_goal_position_tolerance(self, value: float) -> None:
        """Set the radius about the target's position."""
        self._settings.position_tolerance = float(value)

    def set_goal_orientation_tolerance(self, value: float) -> None:
        """Set the angle about each axis."""
        self._settings.orientation_tolerance = float(value)

    def allow_looking(self, value: bool) -> None:
        """Allow or forbid move_group to look around for unknown parts of the scene."""
        self._settings.looking = bool(value)

    def allow_replanning(self, value: bool) -> None:
        """Allow or forbid move_group to plan again if an obstacle blocks the path."""
        self._settings.replanning = bool(value)

    def get_known_constraints(self) -> list[str]:
        """Return the names of stored constraints: none, because there is no data base of them."""
        return []

    def set_constraints_database(self, host: str, port: int) -> None:
        """Say that there is no data base of constraints."""
        rospy.logwarn("there is no data base of constraints at %s:%s; pass Constraints to set_path_constraints",
                      host, port)

    def get_path_constraints(self) -> Constraints:
        """Return the Constraints that hold on the way."""
        return self._settings.path_constraints

    def set_path_constraints(self, value: Constraints | str | None) -> None:
        """Set the Constraints that hold on the way; None for none."""
        if isinstance(value, str):
            raise MoveItCommanderException("there are no stored constraints named '%s'; pass Constraints" % value)
        self._settings.path_constraints = value if value is not None else Constraints()

    def clear_path_constraints(self) -> None:
        """Let nothing hold on the way."""
        self.set_path_constraints(None)

    def get_trajectory_constraints(self) -> TrajectoryConstraints:
        """Return the TrajectoryConstraints."""
        return self._settings.trajectory_constraints

    def set_trajectory_constraints(self, value: TrajectoryConstraints | None) -> None:
        """Set the TrajectoryConstraints; None for none."""
        self._settings.trajectory_constraints = value if value is not None else TrajectoryConstraints()

    def clear_trajectory_constraints(self) -> None:
        """Forget the TrajectoryConstraints."""
        self.set_trajectory_constraints(None)

    def set_planning_time(self, seconds: float) -> None:
        """Set how long planning may take."""
        self._settings.planning_time = float(seconds)

    def get_planning_time(self) -> float:
        """Return how long planning may take."""
        return self._settings.planning_time

    def set_planning_pipeline_id(self, planning_pipeline: str) -> None:
        """Set the planning pipeline; "" for move_group's default."""
        self._settings.pipeline_id = planning_pipeline

    def get_planning_pipeline_id(self) -> str:
        """Return the planning pipeline."""
        return self._settings.pipeline_id

    def set_planner_id(self, planner_id: str) -> None:
        """Set the planner; "" for the group's default."""
        self._settings.planner_id = planner_id

    def get_planner_id(self) -> str:
        """Return the planner."""
        return self._settings.planner_id

    def set_num_planning_attempts(self, num_planning_attempts: int) -> None:
        """Set from how many plans the best is taken."""
        self._settings.attempts = int(num_planning_attempts)

    def set_workspace(self, ws: Sequence[float]) -> None:
        """Set where a base that can move may go: [], [min x, min y, max x, max y], or with z, 6 values."""
        if len(ws) not in (0, 4, 6):
            raise MoveItCommanderException("expected 0, 4 or 6 values for the workspace, got %d" % len(ws))
        self._settings.workspace = {0: (0.0,) * 6, 4: (*ws[:2], 0.0, *ws[2:4], 0.0), 6: tuple(ws)}[len(ws)]

    def set_max_velocity_scaling_factor(self, value: float) -> None:
        """Set the share of the joints' velocity limits that is used, above 0 and at most 1."""
        self._settings.velocity_scaling = self._share(value)

    def set_max_acceleration_scaling_factor(self, value: float) -> None:
        """Set the share of the joints' acceleration limits that is used, above 0 and at most 1."""
        self._settings.acceleration_scaling = self._share(value)

    @staticmethod
    def _share(value: float) -> float:
        if not 0.0 < value <= 1.0:
            raise MoveItCommanderException("a scaling factor is above 0 and at most 1, got %r" % (value,))
        return float(value)
