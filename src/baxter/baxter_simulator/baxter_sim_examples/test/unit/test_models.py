# SPDX-License-Identifier: BSD-3-Clause
"""The table and the block that published pick-and-place programs read from this package's folder."""
from pathlib import Path

import pytest

from baxter_sim_examples.scene import TABLE_SIZE_M, TABLE_TOP_M
from urdf_model import parse_urdf

MODELS = Path(__file__).parents[2] / "models"


def test_the_block_stands_on_its_corner_and_weighs_half_a_kilogram():
    # The programs take the lines' ends out.
    link = parse_urdf((MODELS / "block" / "model.urdf").read_text().replace("\n", "")).links["block"]
    assert link.collisions[0].geometry.size == pytest.approx([0.05] * 3)
    assert link.collisions[0].origin[:3, 3] == pytest.approx([0.025] * 3)
    assert link.inertial.centre == pytest.approx([0.025] * 3)
    assert (link.inertial.mass, link.inertial.inertia[0, 0]) == (0.5, pytest.approx(0.5 * 0.05**2 / 6.0, rel=1e-3))


def test_the_table_is_the_one_of_the_model_folders():
    table = (MODELS / "cafe_table" / "model.sdf").read_text()
    assert "<size>%g %g 0.04</size>" % (TABLE_SIZE_M, TABLE_SIZE_M) in table
    assert "0 0 %g 0 0 0" % (TABLE_TOP_M - 0.02) in table
