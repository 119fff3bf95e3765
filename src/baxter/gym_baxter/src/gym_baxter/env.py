# SPDX-License-Identifier: BSD-3-Clause
"""The environments for Gymnasium."""
from __future__ import annotations

from typing import Any

import gymnasium  # pyright: ignore[reportMissingImports]  (an extra)
import numpy as np
from gymnasium import spaces  # pyright: ignore[reportMissingImports]
from gymnasium.utils import EzPickle  # pyright: ignore[reportMissingImports]

from .core import Choices, Core, CoreState
from .tasks import TASKS

#: Size of a picture for people [pixels].
_PICTURE = (480, 360)
#: No number of a state is greater [rad, rad/s, m]: tables are within reach, and nothing here flies.
_FAR = 100.0


class BaxterEnv(gymnasium.Env, EzPickle):
    """One task: the arguments are those of `core.Choices`. An episode ends when the task is done, and is truncated by
    Gymnasium's TimeLimit. `info` has ``is_success``. `reset(options={"state": s})` begins at a state of ``save()``.
    Attributes `task`: its name; `task_description`: the task in words."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(self, task: str, render_mode: str | None = None, **choices: Any) -> None:
        EzPickle.__init__(self, task, render_mode, **choices)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError("render_mode is %r; choices are None and rgb_array" % (render_mode,))
        self.render_mode = render_mode
        self._open_core: Core | None = Core(task, Choices(**choices))
        self.metadata = {**type(self).metadata, "render_fps": self._core.choices.control_freq}
        # lerobot-eval asks a vector of processes for both, and one that lacks either loses its processes.
        self.task, self.task_description = task, self._core.task.SENTENCE
        self.action_space = spaces.Box(-1.0, 1.0, (self._core.action_size,), np.float32)
        self._core.reset(np.random.default_rng(0))
        self.observation_space = _space(self._given(self._core.observation()))

    @property
    def _core(self) -> Core:
        """Raises ClosedEnvironmentError."""
        if self._open_core is None:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed; gymnasium.make gives a new one")
        return self._open_core

    def _given(self, observation: dict[str, Any]) -> np.ndarray | dict[str, Any]:
        return observation["state"] if self._core.choices.obs_type == "state" else (
            observation if "agent_pos" in observation else observation["pixels"])

    def reset(self, *, seed: int | None = None,
              options: dict[str, Any] | None = None) -> tuple[np.ndarray | dict[str, Any], dict[str, Any]]:
        """Begin an episode. Raises LabError for a state of another environment."""
        super().reset(seed=seed)
        state = (options or {}).get("state")
        if unknown := set(options or {}) - {"state"}:
            gymnasium.logger.warn("reset() knows the option state; without effect: %s" % ", ".join(map(str, unknown)))
        found = self._core.reset(self.np_random) if state is None else self._core.restore(state)
        return self._given(found), {"is_success": False}

    def step(self, action: np.ndarray) -> tuple[np.ndarray | dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One action."""
        observation, reward, succeeded = self._core.step(action)
        return self._given(observation), float(reward), bool(succeeded), False, {"is_success": bool(succeeded)}

    def save(self) -> CoreState:
        """The whole present state, for ``reset(options={"state": ...})`` of this environment, in its process."""
        return self._core.save()

    def render(self) -> np.ndarray | None:
        """A picture from outside, (360, 480, 3) uint8, with render_mode rgb_array. A goal is a green ball there; the
        robot's cameras do not see it."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() needs gymnasium.make(..., render_mode=\"rgb_array\")")
            return None
        return self._core.look(*_PICTURE)

    def close(self) -> None:
        """End the world. A second call does nothing."""
        if self._open_core is not None:
            self._open_core.close()
        self._open_core = None


def _space(value: np.ndarray | dict[str, Any]) -> spaces.Space:
    if isinstance(value, dict):
        return spaces.Dict({name: _space(part) for name, part in value.items()})
    if value.dtype == np.uint8:
        return spaces.Box(0, 255, value.shape, np.uint8)
    return spaces.Box(-_FAR, _FAR, value.shape, np.float64)


def register() -> None:
    """Make all tasks known to ``gymnasium.make``."""
    for name, task in TASKS.items():
        gymnasium.register("gym_baxter/%s-v0" % name, entry_point="gym_baxter.env:BaxterEnv", kwargs={"task": name},
                           max_episode_steps=task.STEPS)
