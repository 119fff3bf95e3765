# SPDX-License-Identifier: BSD-3-Clause
"""The robot's description, expanded."""
import pytest
import rospkg

import xacro
from urdf_model import parse_urdf


@pytest.fixture(scope="session")
def robot():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return parse_urdf(xacro.process_file(path).toxml(), source=path)
