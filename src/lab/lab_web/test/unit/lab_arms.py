# SPDX-License-Identifier: BSD-3-Clause
"""A robot of two arms with seven joints like Baxter's, of boxes, for tests."""

NAMES = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
SIDES = ("left", "right")
LIMIT_RAD, VELOCITY = 2.5, 2.0
# Axes and lengths [m] from the shoulder to the hand; a posture in which the hand can be moved.
_AXES = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
_LENGTHS_M = (0.1, 0.2, 0.2, 0.2, 0.2, 0.1, 0.1)
_BENT = {"s1": -0.6, "e1": 1.2, "w1": -0.4}
JOINTS = ["%s_%s" % (side, name) for side in SIDES for name in NAMES]


def posture():
    """{joint: [rad]}."""
    return {joint: _BENT.get(joint.partition("_")[2], 0.0) for joint in JOINTS}


def _arm(side, y):
    text, parent, x = "", "base", 0.0
    for name, axis, length in zip(NAMES, _AXES, _LENGTHS_M, strict=True):
        link = "%s_%s_link" % (side, name)
        text += """<link name="%s"><visual><origin xyz="%g 0 0"/><geometry>
<box size="%g 0.06 0.06"/></geometry></visual>
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="%s_%s" type="revolute"><parent link="%s"/><child link="%s"/><origin xyz="%g %g 0"/><axis xyz="%s"/>
<limit lower="-%g" upper="%g" velocity="%g" effort="50"/></joint>""" % (
            link, length / 2.0, length, side, name, parent, link, x, y, axis, LIMIT_RAD, LIMIT_RAD, VELOCITY)
        parent, x, y = link, length, 0.0
    return text + """<link name="%s_gripper"/><joint name="%s_tool" type="fixed"><parent link="%s"/>
<child link="%s_gripper"/><origin xyz="%g 0 0"/></joint>""" % (side, side, parent, side, x)


URDF = """<robot name="robot"><link name="base"><visual><geometry><box size="0.3 0.6 0.5"/></geometry></visual></link>
%s%s</robot>""" % (_arm("left", 0.35), _arm("right", -0.35))
