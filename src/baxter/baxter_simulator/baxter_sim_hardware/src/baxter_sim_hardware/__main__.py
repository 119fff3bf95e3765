# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m baxter_sim_hardware``: compile everything into the cache, so that no start has to wait for it."""

from __future__ import annotations

from baxter_sim_hardware import compiled, effects


def main() -> None:
    compiled.load()
    compiled.load_of_effects(effects.read(effects.physical_robot()))


if __name__ == "__main__":
    main()
