# SPDX-License-Identifier: BSD-3-Clause
"""Seeds for the searches of one request, and when the next seed is tried."""
from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Any, NamedTuple

from arm_kinematics.errors import InvalidPosture, InvalidSeed, NoSolution, Reason
from command_line.options import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from arm_kinematics.chain import Chain
    from arm_kinematics.posture_map import PostureMap


class SeedMode(enum.IntEnum):
    """The numbers of baxter_core_msgs/SolvePositionIK, for a request's mode and a response's type."""

    AUTO = 0
    USER = 1
    CURRENT = 2
    NS_MAP = 3


_TRIED = {
    SeedMode.AUTO: (SeedMode.USER, SeedMode.CURRENT, SeedMode.NS_MAP),
    SeedMode.USER: (SeedMode.USER,),
    SeedMode.CURRENT: (SeedMode.CURRENT,),
    SeedMode.NS_MAP: (SeedMode.NS_MAP,),
}


def seed_mode(number: int) -> SeedMode:
    """Return the SeedMode of a number. Raises InvalidSeed."""
    try:
        return SeedMode(number)
    except ValueError:
        raise InvalidSeed("seed_mode %d is unknown; use 0 AUTO, 1 USER, 2 CURRENT or 3 NS_MAP" % number) from None


class SeedRequest(NamedTuple):
    """The seeds of a request. given: (joint names, positions) per pose, as far as the caller sent them; a pair of empty
    lists is not a seed. poses: number of poses in the request.
    """

    mode: SeedMode
    given: list
    poses: int


class SeedPolicy:
    """Tries seeds in the order of the mode. ``neutral`` (n,): used if the current posture is not known."""

    def __init__(self, chain: Chain, posture_map: PostureMap, neutral: np.ndarray,
                 current: Callable[[], np.ndarray]) -> None:
        """``current()``: returns the current posture (n,), or raises InvalidPosture, which says why it is not known."""
        self._chain, self._posture_map, self._neutral, self._current = chain, posture_map, neutral, current
        self._reported = None  # why the current posture was unknown at the last call, or None

    def answer(self, request: SeedRequest, index: int, target: np.ndarray, solve: Callable[[np.ndarray], Any],
               remarks: list[str]) -> tuple[SeedMode, Any]:
        """Return (SeedMode of the seed that succeeded, result of ``solve(seed)``) for pose number ``index`` of a
        SeedRequest.

        ``target`` (4, 4): the pose, tip in base. A search that did not converge is repeated with the next seed; any
        other diagnosis concerns the pose and holds for every seed. Appends remarks for the caller to ``remarks``.
        Raises NoSolution of the last search, InvalidSeed.
        """
        failure: NoSolution | None = None
        for mode in _TRIED[request.mode]:
            seed = self._seed(mode, request, index, target, remarks)
            if seed is None:
                continue
            try:
                return mode, solve(seed)
            except NoSolution as error:
                if error.reason is not Reason.NOT_CONVERGED:
                    raise
                failure = error
        if failure is None:
            raise InvalidSeed("no posture to start from for the mode %s" % request.mode.name)
        raise failure

    def _seed(self, mode: SeedMode, request: SeedRequest, index: int, target: np.ndarray,
              remarks: list[str]) -> np.ndarray | None:
        """Return the posture to start from, or None if AUTO has no user's seed."""
        if mode is SeedMode.NS_MAP:
            return self._posture_map.nearest(target)
        if mode is SeedMode.CURRENT:
            return self._current_or_neutral(remarks)
        demanded = request.mode is SeedMode.USER
        names, positions = request.given[index] if index < len(request.given) else ((), ())
        if not names and not positions:
            if demanded:
                raise InvalidSeed("seed_mode USER needs one seed_angles entry with the limb's joints for each pose, "
                                  "this one has none (%s for %s)" % (counted(len(request.given), "seed"),
                                                                     counted(request.poses, "pose")))
            return None
        try:
            return self._chain.posture_by_name(list(names), list(positions))
        except InvalidPosture as error:
            if demanded:
                raise InvalidSeed("its seed cannot be used: %s" % error) from None
            remarks.append("the seed of pose %d is left out: %s" % (index + 1, error))
            return None

    def _current_or_neutral(self, remarks: list[str]) -> np.ndarray:
        try:
            current = self._current()
        except InvalidPosture as error:
            # Once, not with every request: it stays true until joint states arrive, and a log line takes as long as an
            # answer.
            if str(error) != self._reported:
                self._reported = str(error)
                remarks.append("%s; the neutral posture replaces the current one" % error)
            return self._neutral
        self._reported = None
        return current
