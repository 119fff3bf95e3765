# SPDX-License-Identifier: BSD-3-Clause
"""The robot's state: posture, base and attached objects."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.model.errors import ModelError
from motion_planning.shapes import read_only

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.scene import AttachedBody


@dataclass(frozen=True, eq=False)
class State:
    """A state of a robot; immutable.

    q (n,): a value for each of ``variables`` [rad or m]. base (4, 4): the root link in the planning frame.
    attached: id to the ``scene.AttachedBody`` that the robot holds. variables: names of the model's variables.
    """

    q: np.ndarray
    base: np.ndarray = field(default_factory=lambda: np.eye(4))
    attached: Mapping[str, AttachedBody] = field(default_factory=dict)
    variables: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", read_only(self.q))
        object.__setattr__(self, "base", read_only(self.base))
        if not isinstance(self.attached, MappingProxyType):
            object.__setattr__(self, "attached", MappingProxyType(dict(self.attached)))

    @property
    def positions(self) -> dict[str, float]:
        """A new dict: variable to value."""
        return dict(zip(self.variables, self.q.tolist(), strict=True))

    def with_joints(self, values: Mapping[str, float]) -> State:
        """Return the state with ``values``, {joint: value}, replaced. Raises ModelError for a joint that is not a
        variable, and for a value that is not finite."""
        q = self.q.copy()
        for name, value in values.items():
            if name not in self.variables:
                raise ModelError("'%s' is not a joint variable of the robot; expected one of %s"
                                 % (name, ", ".join(self.variables)))
            if not np.isfinite(value):
                raise ModelError("the value of joint '%s' is %s; expected a finite number" % (name, value))
            q[self.variables.index(name)] = value
        return replace(self, q=q)

    def with_q(self, q: ArrayLike, indices: np.ndarray | None = None) -> State:
        """Return the state at ``q`` (n,), or with ``q`` (k,) at the ``indices`` (k,) of a group."""
        if indices is not None:
            whole = self.q.copy()
            whole[indices] = q
            q = whole
        return replace(self, q=q)

    def with_base(self, base: np.ndarray) -> State:
        """Return the state with the root link at ``base`` (4, 4) in the planning frame."""
        return replace(self, base=base)

    def with_attached(self, attached: Mapping[str, AttachedBody]) -> State:
        """Return the state with ``attached``, {id: AttachedBody}, as its only attached objects."""
        return replace(self, attached=attached)
