# SPDX-License-Identifier: BSD-3-Clause
import sys
from pathlib import Path

# fake_graph and websocket_client are shared by the files of this folder.
sys.path.insert(0, str(Path(__file__).parent))

import pytest  # noqa: E402
from web_lab import WebLab  # noqa: E402


@pytest.fixture
def lab():
    lab = WebLab()
    yield lab
    lab.close()
