# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that work in idle() while they do not run."""
from controller_manager import JOINT_STATE, Controller
from controller_manager.manager import STRICT, ControllerManager
from controller_manager.testing import FakeHardware, fake_context
from loop_ros.testing import FakeLog


class Answering(Controller):
    """Writes down when it is called."""

    def __init__(self, name, hardware, context):
        super().__init__(name, hardware, context)
        self.observe(JOINT_STATE)
        self.calls = []

    def update(self, time_s, dt):
        self.calls.append(("update", time_s))

    def idle(self, time_s):
        if self.context.param("breaks"):
            raise ValueError("broken on purpose")
        self.calls.append(("idle", time_s))


def manager_with(log, **parameters):
    manager = ControllerManager(FakeHardware({"a": ()}), log)
    manager.load("one", "Answering", Answering, fake_context("one", parameters)[0])
    return manager, manager.loaded[0].controller


def test_idle_is_called_at_every_tick_at_which_it_does_not_run():
    manager, controller = manager_with(FakeLog())
    manager.update(1.0, 0.1)
    manager.switch(["one"], [], STRICT)
    manager.update(2.0, 0.1)
    manager.update(3.0, 0.1)
    manager.switch([], ["one"], STRICT)
    manager.update(4.0, 0.1)
    manager.update(5.0, 0.1)
    manager.unload("one")
    manager.update(6.0, 0.1)
    assert controller.calls == [("idle", 1.0), ("idle", 2.0), ("update", 3.0), ("update", 4.0), ("idle", 5.0)]


def test_failing_idle_is_told_once_and_does_not_keep_it_from_running():
    log = FakeLog()
    manager, controller = manager_with(log, breaks=True)
    manager.update(1.0, 0.1)
    manager.update(2.0, 0.1)
    assert len(log.of("error")) == 1 and "broken on purpose" in log.of("error")[0]
    manager.switch(["one"], [], STRICT)
    manager.update(3.0, 0.1)
    manager.update(4.0, 0.1)
    assert controller.calls == [("update", 4.0)]
