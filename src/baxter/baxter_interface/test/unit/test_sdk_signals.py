# SPDX-License-Identifier: BSD-3-Clause
"""Signals call their slots and keep no object alive."""
import gc

import pytest

from baxter_dataflow import Signal
from baxter_dataflow.weakrefset import WeakRefSet, WeakSet


class Listener:
    def __init__(self):
        self.heard = []

    def hear(self, value):
        self.heard.append(value)


def test_functions_and_methods_are_called_in_order_of_connection():
    signal, log, listener = Signal(), [], Listener()

    def first(value):
        log.append(("first", value))

    signal.connect(first)
    signal.connect(listener.hear)
    signal(True)
    assert log == [("first", True)] and listener.heard == [True]


def test_slot_connected_twice_is_called_once():
    signal, listener = Signal(), Listener()
    signal.connect(listener.hear)
    signal.connect(listener.hear)
    signal(1)
    assert listener.heard == [1]


def test_disconnected_slot_is_silent_and_disconnecting_again_is_harmless():
    signal, one, other = Signal(), Listener(), Listener()
    signal.connect(one.hear)
    signal.connect(other.hear)
    signal.disconnect(one.hear)
    signal.disconnect(one.hear)
    signal(2)
    assert (one.heard, other.heard) == ([], [2])


def test_signal_does_not_keep_a_listener_alive():
    signal, heard = Signal(), []
    listener = Listener()
    listener.heard = heard
    signal.connect(listener.hear)
    del listener
    gc.collect()
    signal(3)
    assert heard == []


def test_slot_may_disconnect_itself_while_called():
    signal, log = Signal(), []

    def once(value):
        log.append(value)
        signal.disconnect(once)

    signal.connect(once)
    signal(1)
    signal(2)
    assert log == [1]


def test_slot_must_be_callable():
    with pytest.raises(TypeError, match="function"):
        Signal().connect("hear")


def test_weak_set_forgets_what_nobody_else_holds():
    assert WeakRefSet is WeakSet
    kept, gone = Listener(), Listener()
    members = WeakSet([kept, gone])
    del gone
    gc.collect()
    assert list(members) == [kept]
