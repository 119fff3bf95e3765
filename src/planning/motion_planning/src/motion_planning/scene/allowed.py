# SPDX-License-Identifier: BSD-3-Clause
"""Which two of a scene's links and objects may touch: MoveIt's allowed-collision matrix."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from command_line.options import counted
from motion_planning.model.planning_model import pair_of

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel


@dataclass(frozen=True, eq=False)
class AllowedCollisions:
    """Entries for pairs of names, and defaults for one name with all others. Immutable.

    entries: {sorted pair: may touch}; defaults: {name: may touch all bodies that it has no entry with}. A pair's entry
    has priority; then defaults, of which a "must not" wins; pairs without either must not touch.
    """

    entries: Mapping[tuple[str, str], bool] = field(default_factory=dict)
    defaults: Mapping[str, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("entries", "defaults"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @classmethod
    def of(cls, model: PlanningModel) -> AllowedCollisions:
        """Return the matrix of ``model``'s SRDF."""
        entries = {pair_of(*pair): False for pair in model.srdf.enabled}
        entries.update(dict.fromkeys(model.disabled, True))
        return cls(entries, dict.fromkeys(model.srdf.no_default, True))

    @classmethod
    def from_matrix(cls, names: Sequence[str], matrix: Sequence[Sequence[bool]] | np.ndarray,
                    default_names: Sequence[str] = (), default_values: Sequence[bool] = ()) -> AllowedCollisions:
        """Return the entries of a message: ``matrix`` (n, n) bool for ``names`` (n), values for default names.

        Raises ValueError for lists that do not fit each other.
        """
        if len(matrix) != len(names) or any(len(row) != len(names) for row in matrix):
            raise ValueError("an allowed-collision matrix of %s needs %s of %s, got rows of %s"
                             % (counted(len(names), "name"), counted(len(names), "row"), counted(len(names), "value"),
                                sorted({len(row) for row in matrix}) or "nothing"))
        if len(default_names) != len(default_values):
            raise ValueError("%d default names but %d default values" % (len(default_names), len(default_values)))
        # Only the upper half is read: senders fill both.
        entries = {pair_of(a, b): bool(matrix[i][j]) for i, a in enumerate(names) for j, b in enumerate(names[i:], i)
                   if i != j}
        return cls(entries, dict(zip(default_names, map(bool, default_values), strict=True)))

    def as_matrix(self) -> tuple[list[str], np.ndarray, list[str], list[bool]]:
        """Return (names, matrix (n, n) bool, default names, default values), as in a message. A pair without an entry
        gets the value of its defaults.
        """
        names = sorted({name for pair in self.entries for name in pair})
        matrix = np.array([[i != j and self.allowed(a, b) for j, b in enumerate(names)] for i, a in enumerate(names)],
                          dtype=bool).reshape(len(names), len(names))
        return names, matrix, list(self.defaults), list(self.defaults.values())

    def allowed(self, a: str, b: str) -> bool:
        """Whether ``a`` and ``b`` may touch."""
        entry = self.entries.get((a, b) if a <= b else (b, a))
        if entry is not None:
            return entry
        said = [self.defaults[name] for name in (a, b) if name in self.defaults]
        return bool(said) and all(said)

    def among(self, names: Sequence[str]) -> np.ndarray:
        """Return (n, n) bool: whether each two of ``names`` may touch, in a few steps for many names."""
        said = np.array([name in self.defaults for name in names], dtype=bool)
        value = np.array([self.defaults.get(name, False) for name in names], dtype=bool)
        may = (said[:, None] | said) & (value | ~said)[:, None] & (value | ~said)
        index = {}
        for number, name in enumerate(names):
            index.setdefault(name, []).append(number)
        for (a, b), allowed in self.entries.items():
            if a in index and b in index:
                may[np.ix_(index[a], index[b])] = may[np.ix_(index[b], index[a])] = allowed
        return may

    def with_entries(self, pairs: Mapping[tuple[str, str], bool]) -> AllowedCollisions:
        """Return a copy with the entries ``pairs``, {(name, name): may touch}."""
        return AllowedCollisions({**self.entries, **{pair_of(*pair): bool(value) for pair, value in pairs.items()}},
                                 self.defaults)

    def with_default(self, name: str, allow: bool) -> AllowedCollisions:
        """Return a copy with ``name`` allowed to touch everything, or nothing; its entries stay."""
        return AllowedCollisions(self.entries, {**self.defaults, name: bool(allow)})
