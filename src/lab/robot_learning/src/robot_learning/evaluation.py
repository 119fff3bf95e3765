# SPDX-License-Identifier: BSD-3-Clause
"""How often a policy does its task: episodes of unseen seeds, in worker processes."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from demonstrations.environment import Conditions, core_of
from gym_baxter.core import Core
from gym_baxter.names import action_names, robot_names
from lab_batch import Job, Spec
from lab_batch.processes import BatchLimits, map_seeds

from .policy import Acting, Contract, Runner, load

#: Quantile of the normal distribution for 95 % between both ends.
_Z = 1.959964
_EPISODE_S = 600.0


def wilson(successes: int, count: int) -> tuple[float, float]:
    """The 95 % confidence interval of a share (Wilson, 1927). Raises ValueError without trials."""
    if not 0 <= successes <= count or count < 1:
        raise ValueError("%d of %d is no share" % (successes, count))
    share, square = successes / count, _Z * _Z
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _Z / (1 + square / count) * math.sqrt(share * (1 - share) / count + square / (4 * count * count))
    return max(middle - half, 0.0), min(middle + half, 1.0)


def core_for(contract: Contract, **choices: Any) -> Core:
    """The environment of a policy. Raises DemonstrationError; PolicyError where the contract does not fit it."""
    core = core_of(contract.task, contract.control, control_freq=contract.rate_hz,
                   robosuite_order=contract.robosuite_order, **choices)
    try:
        named = (*robot_names(core.sides), *core.task.OBSERVED)
        contract.require(observation=[name for name, _ in named], units=[unit for _, unit in named],
                         action=[name for name, _ in action_names(contract.control, core.sides)])
    except Exception:
        core.close()
        raise
    return core


def observation_of(core: Core) -> np.ndarray:
    """(n,) what policies of state see."""
    return np.concatenate([core.agent_pos(), core.task.observed()])


def play(core: Core, policy: Acting, seed: int, each: Callable[[Core], None] = lambda core: None) -> dict[str, Any]:
    """One episode: {success, steps, reward of the last step}. each: called after every action."""
    core.reset(np.random.default_rng(seed))
    runner, steps, reward, succeeded = Runner(policy), 0, 0.0, False
    while steps < core.steps and not succeeded:
        _, reward, succeeded = core.step(runner.act(observation_of(core)))
        each(core)
        steps += 1
    return {"success": bool(succeeded), "steps": steps, "reward": float(reward)}


class Evaluate(Job):
    """An episode of a policy, for lab_batch. policy: its file; profile, randomised: as for
    `demonstrations.environment.Conditions`."""

    def __init__(self, policy: str = "policy.npz", profile: str = "sim", randomised: dict[str, float] | None = None):
        self._path = policy
        self._choices = Conditions(profile, randomised or {}).choices

    def start(self) -> None:
        """Read the policy and make its world."""
        self._policy = load(Path(self._path))
        self._core = core_for(self._policy.contract, **self._choices)

    def run(self, seed: int) -> dict:
        """The episode of a seed."""
        return play(self._core, self._policy, seed)

    def end(self) -> None:
        """End the world."""
        self._core.close()


@dataclass(frozen=True)
class Score:
    """results: {seed: what `play` returned}; errors: {seed: why an episode failed to run}, which count as failures."""

    results: dict[int, dict[str, Any]]
    errors: dict[int, str]

    @property
    def successes(self) -> int:
        """Number of successful episodes."""
        return sum(one["success"] for one in self.results.values())

    @property
    def count(self) -> int:
        """Number of episodes."""
        return len(self.results) + len(self.errors)

    def __str__(self) -> str:
        low, high = wilson(self.successes, self.count)
        return "%d of %d succeeded: %.0f %%, 95 %% confidence %.0f to %.0f %%" % (
            self.successes, self.count, 100.0 * self.successes / self.count, 100.0 * low, 100.0 * high)


def evaluate(path: Path, seeds: Iterable[int], workers: int = 1,
             progress: Callable[[int, int], None] = lambda done, good: None, **choices: Any) -> Score:
    """Play the seeds; the same results for any number of workers. choices: of `Evaluate`. Raises JobError,
    PolicyError."""
    load(path)  # a bad file is told before workers start
    seeds = list(seeds)
    results: dict[int, dict[str, Any]] = {}
    errors: dict[int, str] = {}
    spec = Spec("%s:%s" % (__name__, Evaluate.__name__), {"policy": str(Path(path).resolve()), **choices})
    for outcome in map_seeds(spec, seeds, BatchLimits(min(workers, max(len(seeds), 1)), _EPISODE_S, None)):
        if outcome.is_done:
            results[outcome.seed] = outcome.result
        else:
            errors[outcome.seed] = outcome.error
        progress(len(results) + len(errors), sum(one["success"] for one in results.values()))
    return Score(dict(sorted(results.items())), dict(sorted(errors.items())))
