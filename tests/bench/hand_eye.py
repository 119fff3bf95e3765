# SPDX-License-Identifier: BSD-3-Clause
"""The camera in the left hand of a Lab: pictures of the world as it stands, drawn in this process.

The picture is that of the place where the camera is. Where the robot takes it to be follows from its joint states and
its description, as for any program.
"""
import numpy as np

from arm_kinematics import Chain
from baxter_sim_examples import TABLE_TOP_M, TABLE_XY_M
from baxter_sim_examples.looking import CameraView
from baxter_sim_examples.scene import TABLE_SIZE_M
from baxter_sim_hardware import effects
from baxter_sim_hardware.sensing.cameras import CaptureSettings
from baxter_sim_hardware.sensing.optics import Optics
from model_files.resources import ResourceFinder
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from urdf_model import merge_fixed
from world_picture.drawing import DrawingCache

NAME = "left_hand_camera"
ARRAY_FOCAL = 476.7  # of the drawing's camera [pixels]
BOX = """<robot name="%s"><link name="%s"><visual><origin xyz="0 0 %g"/><geometry><box size="%g %g %g"/></geometry>
<material name="wood"><color rgba="%s 1"/></material></visual></link></robot>"""
TABLE_COLOUR = "0.55 0.38 0.22"


class Eye:
    """lab: a Lab; robot_xml: its description; block: body of the block, block_xml: its description; parameters: profile
    and serial of the robot."""

    def __init__(self, lab, robot, robot_xml, block, block_xml, parameters):
        self._lab, self._block = lab, block
        chosen = effects.ALL if parameters.get("profile") == "robot" else effects.NONE
        self._optics = Optics(NAME, effects.chosen(chosen), parameters.get("serial", 0), seed=1)
        self._pinhole = self._optics.pinhole(CaptureSettings(640, 400, 25.0, {}).pinhole(ARRAY_FOCAL, 0.02, 10.0),
                                             ARRAY_FOCAL)
        self._chain = Chain.from_robot(robot, base="base", tip=NAME)
        self._joints = list(merge_fixed(robot).joints)
        table = BOX % ("table", "table", TABLE_TOP_M - 0.02, TABLE_SIZE_M, TABLE_SIZE_M, 0.04, TABLE_COLOUR)
        self._mirror = Mirror(DrawingCache(), ResourceFinder(), print)
        self._mirror.set_scene([
            {"name": "floor", "urdf": None, "joints": []}, {"name": "robot", "urdf": robot_xml, "joints": self._joints},
            {"name": "table", "urdf": table, "joints": []}, {"name": "block", "urdf": block_xml, "joints": []}])
        self._renderer = GlRenderer()

    def close(self):
        self._renderer.close()

    def view(self):
        """The `CameraView` of this moment: the picture as it is, its pose in `base` as the robot's joints say."""
        lab = self._lab
        true = dict(zip(lab.model.joint_names, lab.model.read_joints()[0], strict=True))
        base, block = lab.model.base_pose(), self._block.base_pose()
        still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        self._mirror.set_state(np.array([
            *still, *base.position, *base.quaternion, *(true[name] for name in self._joints),
            *TABLE_XY_M, 0.0, *still[3:], *block.position, *block.quaternion]))
        picture, _ = self._renderer.render(self._mirror, self._pinhole, lab.model.link_pose(NAME).matrix())
        picture = self._optics.seen(picture, self._pinhole, lab.world.time_s)
        said = dict(zip(lab.model.joint_names, lab.plugin.read_joints()[0], strict=True))
        pinhole = self._pinhole
        matrix = np.array([[pinhole.fx, 0.0, pinhole.cx], [0.0, pinhole.fy, pinhole.cy], [0.0, 0.0, 1.0]])
        return CameraView(picture, matrix, self._chain.fk(np.array([said[name] for name in self._chain.joint_names])))
