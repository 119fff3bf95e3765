# SPDX-License-Identifier: BSD-3-Clause
"""Episodes whose things, light and cameras differ; equal seeds are equal, and nothing differs unasked."""
import numpy as np
import pytest

from baxter_lab import Options
from bullet_sim.quiet_pybullet import pybullet
from gym_baxter.core import Choices, Core
from gym_baxter.randomised import Randomised

PLAIN = Options(with_meshes=False)
MUCH = Randomised(mass=0.5, friction=0.5, light=0.5, colour=0.2, camera_m=0.02, camera_rad=0.05)


def begun(core, seed):
    """(things observed, picture, mass and friction of the block) at the start of an episode."""
    core.reset(np.random.default_rng(seed))
    model = core.task.block.model
    info = pybullet.getDynamicsInfo(*model.parts.places[-1], physicsClientId=core.lab.world._client)
    return core.task.observed(), core.observation()["pixels"]["head"], info[0], info[1]


@pytest.fixture(scope="module")
def cores():
    made = [Core("PickPlace", Choices("osc_pose", obs_type="pixels", cameras=("head",), size=32, options=PLAIN,
                                      randomised=much)) for much in (MUCH, Randomised())]
    yield made
    for core in made:
        core.close()


def test_equal_seeds_are_equal_and_others_differ_in_all_that_was_asked_for(cores):
    first, second, again = (begun(cores[0], seed) for seed in (1, 2, 1))
    for one, other, same in zip(first, second, again, strict=True):
        assert np.array_equal(one, same) and not np.array_equal(one, other)


def test_the_things_are_where_they_are_without_it_and_their_weight_is_within_its_bounds(cores):
    usual = begun(cores[1], 3)
    assert usual[2] == pytest.approx(0.1) and begun(cores[1], 4)[2] == usual[2]
    for seed in range(3, 9):
        found = begun(cores[0], seed)
        np.testing.assert_array_equal(found[0], begun(cores[1], seed)[0])
        assert usual[2] / 1.5 <= found[2] <= usual[2] * 1.5 and usual[3] / 1.5 <= found[3] <= 1.0


def test_a_state_has_the_weights_of_its_episode(cores):
    core = cores[0]
    _, pixels, mass, friction = begun(core, 5)
    state = core.save()
    action = np.linspace(-0.5, 0.5, core.action_size)
    once = core.step(action).observation["pixels"]["head"]
    begun(core, 6)
    np.testing.assert_array_equal(core.restore(state)["pixels"]["head"], pixels)
    np.testing.assert_array_equal(core.step(action).observation["pixels"]["head"], once)


def test_light_makes_pictures_brighter_and_a_camera_that_sits_elsewhere_sees_another_picture(cores):
    core = cores[0]
    begun(core, 7)
    drawn = core._randomiser.drawn
    still = drawn._replace(cameras=np.eye(4)[None], light=np.ones(3))
    means = []
    for light in (0.5, 1.0, 2.0):
        core._randomiser.put(still._replace(light=np.full(3, light)))
        means.append(core.observation()["pixels"]["head"].mean())
    assert means == sorted(means) and means[2] - means[0] > 20.0
    core._randomiser.put(still)
    usual = core.observation()["pixels"]["head"]
    core._randomiser.put(still._replace(cameras=drawn.cameras))
    assert np.abs(core.observation()["pixels"]["head"].astype(int) - usual).mean() > 1.0


@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_shares_that_make_no_sense_are_refused(value):
    with pytest.raises(ValueError, match="randomised.mass"):
        Core("Reach", Choices(options=PLAIN, randomised=Randomised(mass=value)))
