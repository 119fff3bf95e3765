# SPDX-License-Identifier: BSD-3-Clause
"""Links with other collision shapes than their description gives."""
import pytest

from bullet_sim import BulletSimError, Pose, World
from bullet_sim.solids import AS_DRAWN, HOLLOW, with_solids
from urdf_model import parse_urdf

POST = """<robot name="post">
<link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="fixed" type="fixed"><parent link="base"/><child link="top"/><origin xyz="0 0 0.5"/></joint>
<link name="top"><visual><geometry><box size="1 1 0.2"/></geometry></visual>
<collision><geometry><sphere radius="0.5"/></geometry></collision></link></robot>"""
BALL = """<robot name="ball"><link name="ball"><inertial><mass value="1"/><inertia ixx="0.004" ixy="0" ixz="0"
iyy="0.004" iyz="0" izz="0.004"/></inertial><collision><geometry><sphere radius="0.1"/></geometry></collision>
</link></robot>"""


@pytest.mark.parametrize("kind, rests_at_m", [(None, 1.1), (AS_DRAWN, 0.7), (HOLLOW, 0.6)])
def test_a_ball_rests_on_what_is_solid(kind, rests_at_m):
    world = World()
    try:
        world.spawn(with_solids(parse_urdf(POST), kind and {"top": kind}), "post", static=True)
        ball = world.spawn(parse_urdf(BALL), "ball", Pose((0.0, 0.0, 1.2)))
        for _ in range(700):
            world.step()
        assert ball.link_pose("ball").position[2] == pytest.approx(rests_at_m, abs=2e-3)
    finally:
        world.close()


@pytest.mark.parametrize("solids, text", [({"tip": HOLLOW}, "robot 'post' has no link 'tip' that could be hollow"),
                                          ({"top": "soft"}, "link 'top' is to be 'soft'; choices are 'as drawn'")])
def test_what_cannot_be_is_refused(solids, text):
    with pytest.raises(BulletSimError, match=text):
        with_solids(parse_urdf(POST), solids)
