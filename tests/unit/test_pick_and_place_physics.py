# SPDX-License-Identifier: BSD-3-Clause
"""One run of the pick and place benchmark, the same without friction and with too much weight, and one by looking."""

import dataclasses
import sys
from pathlib import Path

import pytest

from baxter_sim_examples import BlockLost, Trial

BENCH = Path(__file__).resolve().parents[1] / "bench"
SEED = 1
LOOKED_SEED, LOOKED_SERIAL = 20, 2


@pytest.fixture(scope="module")
def carry():
    """Function(trial) that runs it: (simulated seconds, distance from the target); with serial=N by looking and
    feeling, on the physical robot N."""
    sys.path.insert(0, str(BENCH))
    try:
        import pick_and_place_bench as bench
    finally:
        sys.path.remove(str(BENCH))
    lab_class = bench.load_lab()

    def run(trial, serial=None):
        if serial is None:
            return bench.run(lab_class, *bench.load_scene(), trial)
        physical = {"profile": "robot", "serial": serial}
        return bench.run(lab_class, *bench.load_scene(serial), trial, physical, bench.described(serial))

    return run


def test_block_arrives(carry):
    _, miss_m = carry(Trial.from_seed(SEED))
    assert miss_m < 2e-3


def test_a_block_without_friction_is_not_lifted(carry):
    """Only friction holds it: 2 x 6 N on a weight of 0.5 N and more."""
    with pytest.raises(BlockLost, match="nothing is between the fingers after it was lifted"):
        carry(dataclasses.replace(Trial.from_seed(SEED), friction=0.01))


def test_a_block_that_is_too_heavy_slips_out(carry):
    with pytest.raises(BlockLost, match="nothing is between the fingers"):
        carry(dataclasses.replace(Trial.from_seed(SEED), mass_kg=2.0, friction=0.5))


@pytest.mark.long
def test_a_physical_robot_brings_it_by_looking_and_feeling(carry):
    """It is told the area, and the table's height within 2 cm."""
    _, miss_m = carry(Trial.from_seed(LOOKED_SEED), serial=LOOKED_SERIAL)
    assert miss_m < 5e-3
