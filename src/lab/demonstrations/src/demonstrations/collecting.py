# SPDX-License-Identifier: BSD-3-Clause
"""Many demonstrations of an expert: in worker processes, with the same result for any number of them."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lab_batch import Job, Spec
from lab_batch.processes import BatchLimits, map_seeds

from .card import write_card
from .environment import Conditions, core_of, expert_of, record, schema_of
from .frames import DemonstrationError, Episode
from .writing import SetWriter

#: Actions a second.
RATE_HZ = 20
#: An episode of an expert takes less than this [s of wall time].
_EPISODE_S = 300.0


class Demonstrate(Job):
    """An episode of the expert of a task, for lab_batch. noise: as for `record`; profile, randomised: as for
    `Conditions`."""

    def __init__(self, task: str = "Reach", noise: float = 0.0, control_freq: int = RATE_HZ, profile: str = "sim",
                 randomised: dict[str, float] | None = None):
        self._task, self._noise, self._rate = task, noise, control_freq
        self._conditions = Conditions(profile, randomised or {})

    def start(self) -> None:
        """Make the world."""
        self._core = core_of(self._task, control_freq=self._rate, **self._conditions.choices)
        self._expert = expert_of(self._core)

    def run(self, seed: int) -> dict:
        """{task, success, columns} of the episode of a seed."""
        episode = self._episode(seed)
        return {"task": episode.task, "success": episode.success,
                "columns": {key: values.tolist() for key, values in episode.columns.items()}}

    def _episode(self, seed: int) -> Episode:
        return record(self._core, self._expert, seed, self._noise)

    def end(self) -> None:
        """End the world."""
        self._core.close()


class Collected(NamedTuple):
    """kept, failed: numbers of episodes of the expert; frames: of those that were kept."""

    kept: int
    failed: int
    frames: int


class CollectingWork(NamedTuple):
    """Processes at a time, and a function of each line that tells how far they are."""

    workers: int = 1
    say: Callable[[str], None] = lambda text: None


class Views(NamedTuple):
    """Cameras of gym_baxter, and the side of their pictures in pixels."""

    cameras: tuple[str, ...]
    size: int


def collect(task: str, folder: Path, seeds: Iterable[int], noise: float = 0.0,
            work: CollectingWork = CollectingWork(), spec: Spec | None = None,  # noqa: B008 (tuples)
            conditions: Conditions = Conditions()) -> Collected:  # noqa: B008
    """Append the expert's successful episodes of all seeds to a set, in the order of the seeds. spec: of another job
    with the parameters and results of `Demonstrate`, and with the expert's own actions; it gets the conditions as well.
    Raises DemonstrationError, JobError, the first where the set has no episode then."""
    seeds = list(seeds)
    with_expert = noise > 0.0 or spec is not None
    spec = spec or Spec("%s:%s" % (__name__, Demonstrate.__name__),
                        {"task": task, "noise": noise, "control_freq": RATE_HZ})
    spec = Spec(spec.name, {**spec.parameters, "profile": conditions.profile,
                            "randomised": dict(conditions.randomised)})
    core = core_of(task, control_freq=spec.parameters["control_freq"], **conditions.choices)
    try:
        expert_of(core)
        schema = schema_of(core, with_expert)
    finally:
        core.close()
    kept = failed = frames = 0
    waiting: dict[int, dict | None] = {}
    limits = BatchLimits(min(work.workers, max(len(seeds), 1)), _EPISODE_S, None)
    with SetWriter(folder, schema) as writer:
        order = iter(seeds)
        following = next(order, None)
        for outcome in map_seeds(spec, seeds, limits):
            if outcome.error:
                work.say("seed %d: %s" % (outcome.seed, outcome.error))
            waiting[outcome.seed] = outcome.result if outcome.is_done else None
            while following in waiting:
                result = waiting.pop(following)
                if result is None or not result["success"]:
                    failed += 1
                else:
                    writer.add(_episode(result, schema, following))
                    kept, frames = kept + 1, frames + len(result["columns"]["action"])
                work.say("%d of %d demonstrations of %s" % (kept + failed, len(seeds), task))
                following = next(order, None)
    if not writer.episodes:
        raise DemonstrationError("the expert did none of %d episodes of %s" % (len(seeds), task))
    write_card(folder)
    return Collected(kept, failed, frames)


def film(task: str, folder: Path, seeds: Iterable[int], views: Views, noise: float = 0.0,
         say: Callable[[str], None] = lambda text: None,
         conditions: Conditions = Conditions()) -> Collected:  # noqa: B008 (a tuple)
    """As `collect`, in this process, with pictures. Raises DemonstrationError."""
    seeds = list(seeds)
    core = core_of(task, cameras=views.cameras, size=views.size, control_freq=RATE_HZ, **conditions.choices)
    kept = frames = 0
    try:
        expert = expert_of(core)
        with SetWriter(folder, schema_of(core, noise > 0.0)) as writer:
            for count, seed in enumerate(seeds, 1):
                episode = record(core, expert, seed, noise, writer.frame)
                if episode.success:
                    writer.keep(episode.task, True, seed)
                    kept, frames = kept + 1, frames + len(episode)
                else:
                    writer.drop()
                say("%d of %d demonstrations of %s" % (count, len(seeds), task))
    finally:
        core.close()
    if not writer.episodes:
        raise DemonstrationError("the expert did none of %d episodes of %s" % (len(seeds), task))
    write_card(folder)
    return Collected(kept, len(seeds) - kept, frames)


def _episode(result, schema, seed):
    columns = {key: np.array(values, dtype=schema.features[key].dtype) for key, values in result["columns"].items()}
    return Episode(result["task"], columns, result["success"], seed)
