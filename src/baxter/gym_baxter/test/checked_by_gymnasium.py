# SPDX-License-Identifier: BSD-3-Clause
"""Gymnasium's own checks of every environment; a warning is an error. Runs where Gymnasium is installed, as in
tests/unit/test_pip_library.py: arguments are ids without name space, by default all."""
import sys
import warnings

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

import gym_baxter  # noqa: F401
from baxter_lab import Options
from gym_baxter.tasks import TASKS

PLAIN = Options(with_meshes=False)


def refused(kind, text, use):
    try:
        use()
    except kind as error:
        assert text in str(error), error
    else:
        raise AssertionError("not refused: %s" % text)


def main():
    for name in sys.argv[1:] or TASKS:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            made = gymnasium.make("gym_baxter/%s-v0" % name, options=PLAIN)
            check_env(made.unwrapped)
            made.close()
        print(name, "passes")
    pixels = gymnasium.make("gym_baxter/Reach-v0", obs_type="pixels_agent_pos", size=32, options=PLAIN)
    observation, _ = pixels.reset(seed=1)
    assert observation["pixels"]["head"].shape == (32, 32, 3) and observation in pixels.observation_space
    state = pixels.unwrapped.save()
    first = pixels.step(np.full(16, 0.5, dtype=np.float32))[0]
    pixels.reset(options={"state": state})
    second = pixels.step(np.full(16, 0.5, dtype=np.float32))[0]
    np.testing.assert_array_equal(first["agent_pos"], second["agent_pos"])
    pixels.close()
    many = gymnasium.make_vec("gym_baxter/Reach-v0", num_envs=2, vectorization_mode="async", options=PLAIN)
    # LeRobot asks for both, and processes that lack one end.
    assert many.call("task") == ("Reach", "Reach") and all(many.call("task_description"))
    alone = gymnasium.make("gym_baxter/Reach-v0", options=PLAIN)
    both = [many.reset(seed=[3, 4])[0]]
    both += [many.step(np.full((2, 16), value, dtype=np.float32))[0] for value in (0.2, -0.4)]
    for row, seed in enumerate((3, 4)):
        one = [alone.reset(seed=seed)[0]]
        one += [alone.step(np.full(16, value, dtype=np.float32))[0] for value in (0.2, -0.4)]
        np.testing.assert_array_equal([step[row] for step in both], one)
    # Its processes say what was wrong, and end.
    refused(ValueError, "16 numbers", lambda: many.step(np.full((2, 16), np.nan, dtype=np.float32)))
    many.close(terminate=True)
    alone.close()
    alone.close()
    for use in (alone.unwrapped.reset, alone.unwrapped.save, lambda: alone.unwrapped.step(np.zeros(16))):
        refused(gymnasium.error.ClosedEnvironmentError, "closed", use)
    print("states, pictures and processes agree")


if __name__ == "__main__":
    main()
