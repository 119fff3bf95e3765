# SPDX-License-Identifier: BSD-3-Clause
"""robosuite's Baxter at TwoArmLift, in a Python of its own: prints the seconds of processor time of each action."""
import json
import sys
import time

import numpy as np
import robosuite


def main() -> None:
    """Arguments: actions, seed."""
    count, seed = int(sys.argv[1]), int(sys.argv[2])
    env = robosuite.make("TwoArmLift", robots="Baxter", has_renderer=False, has_offscreen_renderer=False,
                         use_camera_obs=False, control_freq=20, horizon=10 * count + 100)
    env.reset()
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (count + 20, env.action_dim))
    seconds = []
    for action in actions:
        begin = time.thread_time()
        env.step(action)
        seconds.append(time.thread_time() - begin)
    print(json.dumps(seconds[20:]))  # the first ones compile


if __name__ == "__main__":
    main()
