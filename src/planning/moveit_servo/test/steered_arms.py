# SPDX-License-Identifier: BSD-3-Clause
"""Arms to steer: those of the lab, and a small one of boxes."""
from pathlib import Path

import numpy as np
import rospkg
import yaml

import xacro
from motion_planning.model import PlanningModel
from motion_planning.scene import Scene
from motion_planning.spheres import SphereModel
from moveit_servo.servo import Servo
from moveit_servo.settings import ServoSettings
from moveit_servo.surroundings import Surroundings

#: Three joints that turn about z, in a row of links of 0.4 m, above nothing.
PLANAR_URDF = '<robot name="planar"><link name="base"/>' + "".join(
    '<link name="link%d"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.36 0.06 0.06"/></geometry>'
    '</collision></link><joint name="turn%d" type="revolute"><origin xyz="%g 0 0"/><parent link="%s"/>'
    '<child link="link%d"/><axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="9" velocity="1"/></joint>' % (
        number, number, 0.4 if number else 0.0, "link%d" % (number - 1) if number else "base", number)
    for number in range(3)) + (
    '<link name="tip"/><joint name="end" type="fixed"><origin xyz="0.4 0 0"/><parent link="link2"/>'
    '<child link="tip"/></joint></robot>')
PLANAR_SRDF = ('<robot name="planar"><group name="arm"><chain base_link="base" tip_link="tip"/></group>' + "".join(
    '<disable_collisions link1="link%d" link2="link%d" reason="Adjacent"/>' % (k, k + 1) for k in range(2))
    + "</robot>")
DT = 0.008


def path(package, name):
    return Path(rospkg.RosPack().get_path(package)) / name


def baxter_model():
    """Baxter's PlanningModel."""
    options = {"left_tip_name": "left_gripper", "right_tip_name": "right_gripper",
               **{side + "_electric_gripper": "true" for side in ("left", "right")}}
    texts = [xacro.process_file(str(path(package, name)), mappings=options).toxml() for package, name in (
        ("baxter_description", "urdf/baxter.urdf.xacro"), ("baxter_moveit_config", "config/baxter.srdf.xacro"))]
    limits = yaml.safe_load(path("baxter_moveit_config", "config/joint_limits.yaml").read_text())
    return PlanningModel.from_xml(*texts, limits)


def probot_model():
    """PROBOT's PlanningModel."""
    urdf = xacro.process_file(str(path("probot_description", "urdf/probot_anno.xacro"))).toxml()
    config = path("probot_anno_moveit_config", "config")
    return PlanningModel.from_xml(urdf, (config / "probot_anno.srdf").read_text(),
                                  yaml.safe_load((config / "joint_limits.yaml").read_text()))


def planar_model():
    """The PlanningModel of PLANAR_URDF."""
    return PlanningModel.from_xml(PLANAR_URDF, PLANAR_SRDF)


class Driven:
    """A Servo with an arm that is where the set-points say, unless ``follows`` is False."""

    def __init__(self, model, group, state, objects=None, **settings):
        self.model = model
        self.servo = Servo(model, ServoSettings(**{"move_group_name": group, "command_out_topic": "out", **settings}))
        self.q = model.state(state).q.copy()
        self.indices = [model.index[name] for name in self.servo.joints]
        self.follows, self.steps = True, []
        if objects is not None:
            self.scene = Scene(model).with_objects(objects)
            self.servo.surroundings = Surroundings(SphereModel.of(model, None), self.servo.group, self.scene)

    def go(self, command, seconds, dt=DT):
        """Send ``command`` for ``seconds``; return the Steps."""
        steps = []
        for _ in range(round(seconds / dt)):
            steps.append(self.servo.step(self.q, np.zeros(len(self.q)), command, dt))
            if self.follows:
                self.q[self.indices] = steps[-1].position
        self.steps += steps
        return steps

    @property
    def tip(self):
        return self.servo.pose(self.q)

    def worst(self, dt=DT):
        """The greatest velocity, acceleration and jerk of all steps, in shares of the limits; the least distance from a
        joint limit."""
        limits = self.servo.limits
        position, velocity, acceleration = (np.array([getattr(step, name) for step in self.steps])
                                            for name in ("position", "velocity", "acceleration"))
        jerk = np.abs(np.diff(acceleration, axis=0)) / dt / limits.jerk
        shares = [float((np.abs(values) / most).max()) for values, most in (
            (velocity, limits.velocity), (acceleration, limits.acceleration))]
        return (*shares, float(jerk.max()), float(np.minimum(position - limits.lower, limits.upper - position).min()))
