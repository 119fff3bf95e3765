# SPDX-License-Identifier: BSD-3-Clause
"""Random numbers that follow from a number, such as that of a tick, whatever was drawn before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


class NumberedRandom:
    """Philox with one key. key: integer from 0, or two of them.

    A new generator for each number would give the same; this one is made once, which is five times as quick.
    """

    def __init__(self, key: int | Sequence[int]) -> None:
        self._bits = np.random.Philox(key=key)
        self._state, self._generator = self._bits.state, np.random.Generator(self._bits)

    def begin_again(self, key: int | Sequence[int]) -> None:
        """Go on with another key."""
        self._state["state"]["key"][:] = np.random.Philox(key=key).state["state"]["key"]

    def at(self, *counter: int) -> np.random.Generator:
        """The numpy Generator at counter, three integers from 0; valid until the next call."""
        self._state["state"]["counter"][1:] = counter
        self._bits.state = self._state
        return self._generator
