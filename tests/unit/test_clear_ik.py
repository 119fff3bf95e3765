# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics that avoids collisions of Baxter's arms and body, with the simulator's own shapes and pairs."""
import numpy as np
import pytest
import rospkg

import xacro
from arm_kinematics import Chain, NoSolution, Reason, solve
from arm_kinematics.bullet_checker import BulletChecker
from baxter_model.self_collision import MESH_CUTS, self_collision_pairs
from bullet_sim import World
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf
from urdf_model.transforms import rigid


@pytest.fixture(scope="module")
def robot():
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return parse_urdf(xacro.process_file(file).toxml(), source=file)


@pytest.fixture(scope="module")
def checker(robot):
    checker = BulletChecker.of_robot(robot, self_collision_pairs(robot.links), find_mesh=ResourceFinder(),
                                     mesh_cuts=MESH_CUTS)
    yield checker
    checker.close()


def locked(chain, q):
    """``chain`` with very narrow limits around ``q``, so that every solution has the same contacts as q."""
    rotations, offsets, _ = chain.arrays
    return Chain(chain.base, "tip", [
        *((name, "revolute", "l%d" % i, rigid(rotations[i], offsets[i]), (0, 0, 1), q[i] - 1e-4, q[i] + 1e-4)
          for i, name in enumerate(chain.joint_names)),
        ("tool", "fixed", "tip", rigid(rotations[-1], offsets[-1]), (0, 0, 1), None, None)])


@pytest.mark.parametrize("side", ["left", "right"])
def test_pair_that_touches_is_named(robot, checker, side):
    """The overlapping pairs are those that the physics finds in a separate world, one step later."""
    chain = Chain.from_robot(robot, "base", side + "_gripper")
    world = World(find_mesh=ResourceFinder())
    model = world.spawn(robot, "baxter", static=True, self_collision_pairs=self_collision_pairs(robot.links),
                        mesh_cuts=MESH_CUTS)
    index = model.index(chain.joint_names)
    checker.set_posture(model.joint_names, model.read_joints()[0])  # the other arm's posture in that world
    right, built = 0, 0
    for q in np.random.default_rng(61).uniform(chain.lower, chain.upper, (300, 7)):
        model.set_joint_positions(index, q)
        overlaps = {frozenset((found.link_a, found.link_b)) for found in world.touching(model)
                    if found.distance < -1e-3}
        if not overlaps:
            continue
        built += 1
        arm = locked(chain, q)
        with pytest.raises(NoSolution) as caught:
            solve(arm, arm.fk(q), q, checker=checker)
        right += caught.value.reason is Reason.SELF_COLLISION and frozenset(caught.value.pair) in overlaps
    world.close()
    assert built >= 50
    assert right >= 0.95 * built


def test_pose_that_a_clear_posture_reaches_gets_a_clear_one(robot, checker):
    """Poses made from collision-free postures; the plain answer often collides."""
    chain = Chain.from_robot(robot, "base", "left_gripper")
    made = bent_around = found = 0
    for q in np.random.default_rng(62).uniform(chain.lower, chain.upper, (250, 7)):
        if checker.contact(chain.joint_names, q) is not None:
            continue
        made += 1
        target = chain.fk(q)
        bent_around += checker.contact(chain.joint_names, solve(chain, target, chain.mid_range).q) is not None
        try:
            answer = solve(chain, target, chain.mid_range, checker=checker).q
        except NoSolution:
            continue
        assert checker.contact(chain.joint_names, answer) is None
        np.testing.assert_allclose(chain.fk(answer), target, atol=3e-6)
        found += 1
    assert made >= 100 and bent_around >= 10
    assert found >= 0.99 * made
