# SPDX-License-Identifier: BSD-3-Clause
"""The driver of the browser and its answers; the browser is a list of them."""
import json

import pytest

from lab_testing.browser import Browser, PageLeft

LEFT = {"error": {"code": -32000, "message": "Inspected target navigated or closed"}}
TRUE = {"result": {"result": {"value": True}}}


class Socket:
    """Answers each command with the next one of ``answers``."""

    def __init__(self, answers):
        self._answers = list(answers)

    def send(self, text):
        self._number = json.loads(text)["id"]

    def recv(self):
        return json.dumps({"id": self._number, **self._answers.pop(0)})


def browser(*answers):
    made = object.__new__(Browser)
    made._socket, made._number, made.errors = Socket(answers), 0, []
    return made


def test_a_page_that_is_left_meanwhile_is_asked_again():
    assert browser(LEFT, LEFT, TRUE).wait("true") is True
    with pytest.raises(PageLeft, match="Runtime.evaluate: .*navigated"):
        browser(LEFT).evaluate("true")


def test_any_other_error_ends_the_wait():
    with pytest.raises(AssertionError, match="no such thing") as raised:
        browser({"error": {"code": -32601, "message": "no such thing"}}, TRUE).wait("true")
    assert not isinstance(raised.value, PageLeft)
