# SPDX-License-Identifier: BSD-3-Clause
"""The plugins' part of LeRobot, for tests without it. `../checked_by_lerobot.py` compares it with the real one."""
import abc
import enum
import sys
import types
from dataclasses import dataclass, field


class _Registry:
    @classmethod
    def register_subclass(cls, name):
        def keep(found):
            cls.known[name] = found
            return found
        return keep


@dataclass(kw_only=True)
class RobotConfig(_Registry):
    id: str | None = None
    calibration_dir: str | None = None
    known = {}

    def __post_init__(self):
        pass


@dataclass(kw_only=True)
class TeleoperatorConfig(_Registry):
    id: str | None = None
    calibration_dir: str | None = None
    known = {}


@dataclass
class EnvConfig(_Registry):
    task: str | None = None
    fps: int = 30
    features: dict = field(default_factory=dict)
    features_map: dict = field(default_factory=dict)
    known = {}


def _abstract(*names):
    return {name: abc.abstractmethod(lambda self, *given: None) for name in names}


_SHARED = ("action_features", "is_connected", "is_calibrated", "connect", "calibrate", "configure", "disconnect")
#: {class: names of its abstract members}
ABSTRACT = {"Robot": {*_SHARED, "observation_features", "get_observation", "send_action"},
            "Teleoperator": {*_SHARED, "feedback_features", "get_action", "send_feedback"}}


def _init(self, config):
    self.id = config.id


Robot, Teleoperator = (abc.ABCMeta(name, (), {**_abstract(*names), "__init__": _init})
                       for name, names in ABSTRACT.items())
TeleopEvents = enum.Enum("TeleopEvents", {name: name.lower() for name in (
    "SUCCESS", "FAILURE", "RERECORD_EPISODE", "IS_INTERVENTION", "TERMINATE_EPISODE")})
FeatureType = enum.Enum("FeatureType", {name: name for name in ("STATE", "VISUAL", "ENV", "ACTION")})


@dataclass
class PolicyFeature:
    type: FeatureType
    shape: tuple


#: {module: what plugins import of it}
MODULES = {"lerobot": (), "lerobot.robots": (Robot, RobotConfig),
           "lerobot.teleoperators": (Teleoperator, TeleoperatorConfig), "lerobot.teleoperators.utils": (TeleopEvents,),
           "lerobot.configs": (FeatureType, PolicyFeature), "lerobot.envs": (), "lerobot.envs.configs": (EnvConfig,)}


def install():
    """Put them in LeRobot's place."""
    for name, members in MODULES.items():
        module = types.ModuleType(name)
        vars(module).update({member.__name__: member for member in members})
        sys.modules[name] = module
