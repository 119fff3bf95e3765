# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures: Baxter's model, as the lab runs it, and the sides. A conftest names those that its tests use in __all__."""
from pathlib import Path

import pytest

from baxter_model import SIDES
from urdf_model import parse_urdf

# Expanded by the workspace's set-up.
_BAXTER = Path(__file__).resolve().parents[4] / "src/baxter/baxter_common/baxter_description/urdf/baxter.urdf"


@pytest.fixture(scope="session")
def baxter_xml():
    return _BAXTER.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def robot(baxter_xml):
    return parse_urdf(baxter_xml, source=str(_BAXTER))


@pytest.fixture(scope="session", params=SIDES)
def side(request):
    return request.param
