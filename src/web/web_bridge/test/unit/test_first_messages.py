# SPDX-License-Identifier: BSD-3-Clause
"""The store of a new topic's first messages."""
from web_bridge.publications import FirstMessages


def test_the_newest_are_kept_within_both_limits():
    first = FirstMessages(3, 100)
    for number in range(5):
        first.add(number, 10)
    assert first.messages() == [2, 3, 4]
    first.add("large", 90)
    assert first.messages() == [4, "large"]


def test_the_newest_is_kept_even_where_it_is_too_large():
    first = FirstMessages(3, 100)
    first.add("small", 10)
    first.add("huge", 1000)
    assert first.messages() == ["huge"]
    first.add("next", 10)
    assert first.messages() == ["next"]
