# SPDX-License-Identifier: BSD-3-Clause
"""The sentences about a robot that does not move."""
from types import SimpleNamespace

import pytest

from baxter_model.readiness import ENABLE, RESET, why_not_ready


@pytest.mark.parametrize("stopped, enabled, words, command", [
    (False, True, "", ""), (False, False, "not enabled", ENABLE), (True, False, "is stopped", RESET),
    (True, True, "is stopped", RESET)])
def test_reason_comes_with_the_command_that_helps(stopped, enabled, words, command):
    text = why_not_ready(SimpleNamespace(stopped=stopped, enabled=enabled))
    assert words in text and command in text and bool(text) == bool(words)
