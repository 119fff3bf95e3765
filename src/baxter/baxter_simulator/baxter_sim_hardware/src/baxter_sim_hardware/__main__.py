# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m baxter_sim_hardware``: compile everything into the cache, so that no start has to wait for it."""
import numpy as np

from baxter_sim_hardware.setpoint import any_beyond, approach, follow


def main():
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    approach(here, at_rest, here, bound, bound, 1.0)
    nowhere = np.zeros(1, dtype=bool)
    follow(here, at_rest, np.zeros(1), bound, bound, nowhere, bound, nowhere, here, at_rest, np.zeros((1, 1)), 0,
           np.zeros(1), np.zeros(1), here, 1.0, 1.0)
    any_beyond(1.0, here, at_rest, here, 1.0)


if __name__ == "__main__":
    main()
