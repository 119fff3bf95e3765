# SPDX-License-Identifier: BSD-3-Clause
"""What a robot and a controller manager should do, in a few lines, to hold the real ones against. No ROS needed.

Written from docs/interface.md ("States") and from ros_control's rules, not from the code that it judges.
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
    """Load, unload and switch. Attribute ``running``: name to whether it runs, of those that are loaded."""

    def __init__(self, claims):
        """claims: controller's name to the joints that it commands."""
        self._claims, self.running = claims, {}

    def load(self, name):
        """Returns whether it can be."""
        if name in self.running:
            return False
        self.running[name] = False
        return True

    def unload(self, name):
        """Returns whether it can be."""
        if self.running.get(name, True):
            return False
        del self.running[name]
        return True

    def switch(self, start, stop):
        """Strictly: all or nothing. Returns whether it can be. start, stop: a name each, or ""."""
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
