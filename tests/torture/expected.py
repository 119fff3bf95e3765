# SPDX-License-Identifier: BSD-3-Clause
"""Short reference models of a robot and a controller manager, to compare the real ones with. No ROS needed.

They follow docs/interface.md ("States") and ros_control's rules, not the code under test.
"""
DISABLED, ENABLED, STOPPED, PRESSED, RELEASED = "disabled", "enabled", "stopped", "pressed", "released"


class ExpectedRobot:
    """Enable, stop and reset. Attribute ``state``: one of the five words above."""

    def __init__(self):
        self.state = DISABLED

    def enable(self):
        if self.state == DISABLED:
            self.state = ENABLED

    def disable(self):
        if self.state == ENABLED:
            self.state = DISABLED

    def stop(self):
        if self.state in (DISABLED, ENABLED):
            self.state = STOPPED

    def reset(self):
        if self.state != PRESSED:
            self.state = DISABLED

    def press(self):
        self.state = PRESSED

    def release(self):
        if self.state == PRESSED:
            self.state = RELEASED

    @property
    def fields(self):
        """(ready, enabled, stopped, estop_button, estop_source) of an AssemblyState."""
        return {DISABLED: (False, False, False, 0, 0), ENABLED: (True, True, False, 0, 0),
                STOPPED: (False, False, True, 2, 2), PRESSED: (False, False, True, 1, 1),
                RELEASED: (False, False, True, 3, 1)}[self.state]


class ExpectedControllers:
    """Load, unload and switch. Attribute ``running``: {name: whether it runs} of the loaded controllers."""

    def __init__(self, claims):
        """claims: controller's name to the joints that it commands."""
        self._claims, self.running = claims, {}

    def load(self, name):
        """Return whether it is possible."""
        if name in self.running:
            return False
        self.running[name] = False
        return True

    def unload(self, name):
        """Return whether it is possible."""
        if self.running.get(name, True):
            return False
        del self.running[name]
        return True

    def switch(self, start, stop):
        """Strict: all or nothing. Return whether it is possible. start, stop: one name each, or ""."""
        if (start and self.running.get(start, True)) or (stop and not self.running.get(stop, False)):
            return False
        stays = {name for name, runs in self.running.items() if runs and name != stop}
        if start and any(set(self._claims[start]) & set(self._claims[name]) for name in stays):
            return False
        if stop:
            self.running[stop] = False
        if start:
            self.running[start] = True
        return True
