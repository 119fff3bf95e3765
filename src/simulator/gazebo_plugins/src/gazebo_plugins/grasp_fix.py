# SPDX-License-Identifier: BSD-3-Clause
"""``libgazebo_grasp_fix.so``: fingers that hold what they grip."""
from __future__ import annotations

from typing import TYPE_CHECKING

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext


class GraspFix(ModelPlugin):
    """In Gazebo it fixes a gripped body to the palm, since contacts there do not hold it. Here the friction of the
    fingers, the elements ``arm/gripper_link``, holds without creeping; the numbers of the plugin have no effect."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        names = [unscoped(context.model.name, (link.text or "").strip())
                 for arm in context.element.findall("arm") for link in arm.findall("gripper_link")]
        known = context.model.merged.frames
        missing = [name for name in names if name not in known]
        if missing or not names:
            raise PluginError("plugin %s of model '%s': <gripper_link> is %s, expected some of the links %s"
                              % (context.element.get("filename"), context.model.name,
                                 ", ".join("'%s'" % name for name in missing) or "missing in <arm>", ", ".join(known)))
        for name in names:
            context.model.grip_firmly(name)
