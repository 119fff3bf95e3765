# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot plugin: the tasks of gym_baxter, as `--env.type=baxter --env.task=PickPlace-v0`."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

from baxter_model import SIDES

# Worker processes of vector environments import this module alone; gym_baxter makes its names known to them as well.
from gym_baxter.controls import action_size
from gym_baxter.core import CAMERAS
from gym_baxter.names import robot_names
from gym_baxter.tasks import TASKS

_ACTION, _STATE, _THINGS = "action", "observation.state", "observation.environment_state"
_PICTURES = "observation.images"


@EnvConfig.register_subclass("baxter")
@dataclass
class BaxterEnvConfig(EnvConfig):
    """An environment that sets of `python3 -m demonstrations` were recorded in.

    task: an id of gym_baxter; fps: actions a second; episode_length: actions of an episode, None: the task's own;
    control, cameras, size: as for gym_baxter; obs_type: environment_state_agent_pos, or pixels_agent_pos. Raises
    ValueError for other tasks, controls and obs_types.
    """

    task: str | None = "PickPlace-v0"
    fps: int = 20
    episode_length: int | None = None
    control: str = "osc_pose"
    obs_type: str = "environment_state_agent_pos"
    cameras: list[str] = field(default_factory=lambda: list(CAMERAS))
    size: int = 84
    render_mode: str = "rgb_array"

    def __post_init__(self) -> None:
        name = (self.task or "").removesuffix("-v0")
        if name not in TASKS:
            raise ValueError("env.task is %r; choices are %s" % (self.task, ", ".join("%s-v0" % one for one in TASKS)))
        if self.obs_type not in ("environment_state_agent_pos", "pixels_agent_pos"):
            raise ValueError("env.obs_type is %r; choices are environment_state_agent_pos and pixels_agent_pos"
                             % self.obs_type)
        features = {_ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(action_size(self.control),)),
                    "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(len(robot_names(SIDES)),))}
        names = {_ACTION: _ACTION, "agent_pos": _STATE}
        if self.obs_type == "pixels_agent_pos":
            for camera in self.cameras:
                features["pixels/%s" % camera] = PolicyFeature(type=FeatureType.VISUAL, shape=(self.size, self.size, 3))
                names["pixels/%s" % camera] = "%s.%s" % (_PICTURES, camera)
        else:
            features["environment_state"] = PolicyFeature(type=FeatureType.ENV, shape=(len(TASKS[name].OBSERVED),))
            names["environment_state"] = _THINGS
        self.features, self.features_map = {**features, **self.features}, {**names, **self.features_map}

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of gymnasium.make."""
        chosen: dict[str, Any] = {"control": self.control, "control_freq": self.fps, "obs_type": self.obs_type,
                                  "cameras": tuple(self.cameras), "size": self.size, "render_mode": self.render_mode}
        if self.episode_length is not None:
            chosen["max_episode_steps"] = self.episode_length
        return chosen
