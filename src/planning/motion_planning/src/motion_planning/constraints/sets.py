# SPDX-License-Identifier: BSD-3-Clause
"""Sets of constraints."""
from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

from motion_planning.constraints.targets import (
    JointTarget,
    OrientationTarget,
    PositionTarget,
    StateInScene,
    VisibilityTarget,
)

if TYPE_CHECKING:
    from motion_planning.constraints.targets import Evaluation
    from motion_planning.exact import ExactChecker
    from motion_planning.model import PlanningModel, State
    from motion_planning.scene import Scene


@dataclass(frozen=True)
class ConstraintSet:
    """Constraints that must all hold. An empty set always holds."""

    name: str = ""
    joints: tuple[JointTarget, ...] = ()
    positions: tuple[PositionTarget, ...] = ()
    orientations: tuple[OrientationTarget, ...] = ()
    visibilities: tuple[VisibilityTarget, ...] = ()

    def __post_init__(self) -> None:
        for entry in fields(self)[1:]:
            object.__setattr__(self, entry.name, tuple(getattr(self, entry.name)))

    def __len__(self) -> int:
        return len(self.all)

    @property
    def all(self) -> tuple[JointTarget | PositionTarget | OrientationTarget | VisibilityTarget, ...]:
        """The constraints in the order of :meth:`evaluate`'s result: joints, positions, orientations, visibilities."""
        return self.joints + self.positions + self.orientations + self.visibilities

    def evaluate(self, model: PlanningModel, state: State, scene: Scene,
                 exact: ExactChecker | None = None) -> list[Evaluation]:
        """Return [Evaluation, ...], one for each of :attr:`all`, of a State.

        ``exact``: ExactChecker that tells whether a link blocks a line of sight; None: no such check. Raises
        ConstraintError for names that neither the robot nor the scene has.
        """
        context = StateInScene(model, state, scene, exact)
        return [one.evaluate(context) for one in self.all]

    def broken(self, model: PlanningModel, state: State, scene: Scene, exact: ExactChecker | None = None) -> str | None:
        """Return the sentence of the first violated constraint, None if all hold. Raises ConstraintError."""
        context = StateInScene(model, state, scene, exact)
        return next((result.sentence for result in (one.evaluate(context) for one in self.all)
                     if not result.satisfied), None)

    def resolved(self, scene: Scene) -> ConstraintSet:
        """Return the set with its frames looked up in ``scene`` as it is now, and constraints on attached objects
        applied to the link that holds them. A goal in a moving frame refers to the frame's pose at the time of the
        request.

        Raises ConstraintError for names that neither the robot nor the scene has.
        """
        return replace(self, **{entry.name: tuple(one.resolved(scene) for one in getattr(self, entry.name))
                                for entry in fields(self)[1:]})

    def merged(self, other: ConstraintSet) -> ConstraintSet:
        """Return the constraints of both sets."""
        return ConstraintSet(self.name or other.name, *(getattr(self, entry.name) + getattr(other, entry.name)
                                                        for entry in fields(self)[1:]))
