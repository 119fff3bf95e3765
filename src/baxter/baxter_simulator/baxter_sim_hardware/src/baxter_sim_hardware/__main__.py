# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m baxter_sim_hardware``: compile everything into the cache, so that no start has to wait for it."""
import numpy as np

from baxter_sim_hardware.setpoint import MovingAverage, advance, any_beyond, approach


def main():
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    approach(here, at_rest, here, bound, bound, 1.0)
    advance(here, at_rest, np.zeros(1), bound, bound, np.zeros(1, dtype=bool), here, at_rest, 1.0)
    any_beyond(1.0, here, at_rest, here, 1.0)
    MovingAverage(1, here).push(here)


if __name__ == "__main__":
    main()
