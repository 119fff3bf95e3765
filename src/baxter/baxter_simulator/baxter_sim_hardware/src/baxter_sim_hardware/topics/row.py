# SPDX-License-Identifier: BSD-3-Clause
"""What a row of the interface table says."""
from dataclasses import dataclass

from baxter_model import SIDES
from baxter_sim_hardware.sensing.panel import ANALOG, DIGITAL, NAVIGATORS

STATE_RATE_HZ = 100.0  # the physical robot's state topics
LATCHED = "latched"  # in place of a rate: once, and again for who comes later
JOINT_STATE_RATE = "joint_state_rate"  # in place of a rate: the parameter of that name
ASSEMBLIES = (*SIDES, "head", "torso")
PARTS = {"limb": SIDES, "digital": tuple(DIGITAL), "analog": tuple(ANALOG), "navigator": NAVIGATORS,
         "assembly": ASSEMBLIES}


@dataclass(frozen=True)
class Topic:
    """One row. key: what the plugin calls it; name: below the robot's namespace unless it begins with a slash, with one
    of PARTS in braces where there is a topic for each.

    rate: Hz, or LATCHED, or JOINT_STATE_RATE; None for topics that the robot listens to.
    """

    key: str
    name: str
    type: str
    rate: object
    meaning: str

    @property
    def is_published(self):
        return self.rate is not None

    def names(self):
        """[(part or None, topic name)], one for each limb, component ... where the topic exists for each."""
        for kind, parts in PARTS.items():
            if "{%s}" % kind in self.name:
                return [(part, self.name.format(**{kind: part})) for part in parts]
        return [(None, self.name)]
