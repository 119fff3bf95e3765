# SPDX-License-Identifier: BSD-3-Clause
"""JSON from messages: what is accepted, and that everything else gives only an error."""
import math
import time

import pytest

from rospy_nodes.json_object import DEEPEST, LONGEST, JsonRefused, read_object


@pytest.mark.parametrize("text, values", [
    ("", {}), (" \n", {}), ("{}", {}), ('{"position": 50}', {"position": 50}), ('{"a": -1.5e-3}', {"a": -1.5e-3}),
    ('{"a": [1, {"b": null}], "c": "{[{["}', {"a": [1, {"b": None}], "c": "{[{["}),
    ('{"a": 999999999999999}', {"a": 999999999999999}), ('{"quote \\" {": true}', {'quote " {': True}),
    ('{"\u00e9": "\U0001f916"}', {"\u00e9": "\U0001f916"})])
def test_objects(text, values):
    assert read_object(text) == values


def test_what_python_writes_for_no_number_is_read():
    values = read_object('{"a": NaN, "b": Infinity, "c": -Infinity}')
    assert math.isnan(values["a"]) and values["b"] == math.inf == -values["c"]


@pytest.mark.parametrize("text, found", [
    ("5", "is not a JSON object"), ("[]", "is not a JSON object"), ("{", "is not a JSON object"),
    ("\0", "is not a JSON object"), ('{"a": 1}x', "is not a JSON object"), ("nul", "is not a JSON object"),
    ('{"a":' * 5000, "25000 characters"), ('{"a":' * 1900, "nested deeper than %d" % DEEPEST),
    ("[" * 9000, "nested deeper than"),
    ('{"a":' * 9 + "1" + "}" * 9, "nested deeper than"),
    ('{"velocity": %s}' % ("9" * 400), "an integer of 400 digits"), ('{"velocity": -%s}' % ("9" * 19), "of 20 digits"),
    ('{"velocity": 1e999}', "magnitude may be up to 1e"), ('{"velocity": -1e308}', "magnitude may be up to 1e"),
    ('{"velocity": 1e15}' + " " * LONGEST, "%d characters" % (LONGEST + 18)), ("x" * 10**6, "1000000 characters")])
def test_what_is_refused_says_why_and_in_short(text, found):
    with pytest.raises(JsonRefused, match=found) as refusal:
        read_object(text)
    assert len(str(refusal.value)) < 400


@pytest.mark.parametrize("unit", ['{"a":', "[", "9", '"', "\\", "{}", "[1,", '"\\', "-", "1e"])
def test_no_text_takes_long(unit):
    began = time.process_time()
    for text in (unit * (LONGEST // len(unit)), '{"a": %s' % (unit * (9000 // len(unit)))):
        with pytest.raises(JsonRefused):
            read_object(text)
    assert time.process_time() - began < 0.5
