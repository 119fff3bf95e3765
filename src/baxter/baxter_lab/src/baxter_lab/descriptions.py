# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's descriptions as text: what xacro makes of the packages' files."""
import contextlib
import importlib
import threading
from pathlib import Path
from typing import Any, cast

import yaml

import xacro
from baxter_model import SIDES
from model_files.packages import find_packages

_engine = threading.Lock()


@contextlib.contextmanager
def _answers(packages):
    """Let ``$(find PACKAGE)`` be answered by `packages`: PyPI's xacro would ask a ROS 2 that is not here."""
    substitution = cast("Any", importlib.import_module("xacro.substitution_args"))
    before = substitution._eval_find, dict(substitution._eval_dict)
    substitution._eval_find = substitution._eval_dict["find"] = packages.get_path
    try:
        yield
    finally:
        substitution._eval_find = before[0]
        substitution._eval_dict.clear()
        substitution._eval_dict.update(before[1])


def _expanded(package, file, arguments):
    packages = find_packages()
    path = Path(packages.get_path(package)) / file
    with _engine, _answers(packages):
        # Here it is PyPI's, not the command of the same name in this workspace.
        return xacro.process_file(str(path), mappings=dict(arguments)).toxml()


def baxter_urdf(arguments: dict[str, str]) -> str:
    """URDF of Baxter; arguments: of its xacro file (README of baxter_description)."""
    return _expanded("baxter_description", "urdf/baxter.urdf.xacro", arguments)


def baxter_srdf(arguments: dict[str, str]) -> str:
    """SRDF of Baxter: groups for planning, and pairs of links that cannot touch; arguments: those of the URDF."""
    electric = {side + "_electric_gripper": str(arguments.get(side + "_gripper", "electric") == "electric").lower()
                for side in SIDES}
    return _expanded("baxter_moveit_config", "config/baxter.srdf.xacro", electric)


def joint_limits() -> dict[str, Any]:
    """Limits for planned motions, slower than the drives': what people can stand beside."""
    path = Path(find_packages().get_path("baxter_moveit_config")) / "config" / "joint_limits.yaml"
    limits: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    return limits
