# SPDX-License-Identifier: BSD-3-Clause
"""Valid configurations of a server."""
import math
from types import SimpleNamespace

import pytest

from baxter_interface.dynamic_parameters import check

TABLE = SimpleNamespace(min={"goal": 0.0, "count": 0, "on": False, "name": ""},
                        max={"goal": 2.0, "count": 5, "on": True, "name": ""},
                        type={"goal": "double", "count": "int", "on": "bool", "name": "str"})


@pytest.mark.parametrize("values", [
    {"goal": 1.0, "count": 1, "on": True, "name": "x"}, {"goal": 1}, {"goal": math.inf}, {"goal": -math.inf},
    {"groups": {"id": 0, "state": True}}])
def test_values_and_what_is_clamped_pass(values):
    check(values, TABLE)


@pytest.mark.parametrize("values, text", [
    ({"goal": 1.0, "speed": math.inf}, "there is no parameter 'speed'; parameters: goal, count, on, name"),
    ({"goal": math.nan}, "goal is nan, expected 0 to 2"),
    ({"goal": "2"}, "goal is '2', expected a value of type double"),
    ({"goal": True}, "goal is True"), ({"count": 1.5}, "count is 1.5, expected a value of type int"),
    ({"on": 1}, "on is 1, expected a value of type bool"), ({"name": 1}, "name is 1"),
    ({"x" * 9999: 0.0}, "no parameter")])
def test_what_no_parameter_can_be_is_refused_with_its_name(values, text):
    with pytest.raises(ValueError, match=text) as refusal:
        check(values, TABLE)
    assert len(str(refusal.value)) < 300
