# SPDX-License-Identifier: BSD-3-Clause
"""Episodes in which a policy acts and the expert says what it would have done: more to learn from, just where the
policy goes (DAgger: Ross et al., 2011)."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from demonstrations.collecting import RATE_HZ, Collected, CollectingWork, Demonstrate, collect
from demonstrations.environment import Conditions, record
from demonstrations.frames import Episode
from lab_batch import Spec

from .policy import Runner, load


class Correct(Demonstrate):
    """An episode that a policy begins and the expert ends, for lab_batch. policy: its file; the others: of
    `Demonstrate`."""

    def __init__(self, task: str = "Reach", policy: str = "policy.npz", control_freq: int = RATE_HZ,
                 profile: str = "sim", randomised: dict[str, float] | None = None):
        super().__init__(task, control_freq=control_freq, profile=profile, randomised=randomised)
        self._path = policy

    def start(self) -> None:
        """Read the policy and make its world."""
        self._student = Runner(load(Path(self._path)))
        super().start()

    def _episode(self, seed: int) -> Episode:
        return record(self._core, self._expert, seed, student=self._student)


def correct(path: Path, folder: Path, seeds: Iterable[int], workers: int = 1,
            say: Callable[[str], None] = lambda text: None,
            conditions: Conditions = Conditions()) -> Collected:  # noqa: B008 (a tuple)
    """Append corrected episodes of all seeds to a set that has the expert's own actions. path: of the policy. Raises
    PolicyError, DemonstrationError, JobError."""
    contract = load(path).contract
    spec = Spec("%s:%s" % (__name__, Correct.__name__), {
        "task": contract.task, "policy": str(Path(path).resolve()), "control_freq": contract.rate_hz})
    return collect(contract.task, folder, seeds, work=CollectingWork(workers, say), spec=spec, conditions=conditions)
