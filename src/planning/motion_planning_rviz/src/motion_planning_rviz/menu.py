# SPDX-License-Identifier: BSD-3-Clause
"""The menu behind a right click, as data."""
from __future__ import annotations

from collections.abc import Hashable
from typing import Any, NamedTuple

SPEEDS = (0.1, 0.25, 0.5, 1.0)
BOX_SIZES_M = (0.05, 0.1, 0.2)


class PanelEntry(NamedTuple):
    """number: from 1 on, the same in every menu of a panel; parent: number of the entry it is below, 0 at the top;
    command: (what, value ...), empty for entries that only hold others."""

    number: int
    parent: int
    title: str
    command: tuple[Any, ...]


class MenuState(NamedTuple):
    """The state that the menu shows. groups, states, objects, attached: names; planners: ((pipeline, planner), ...)."""

    groups: tuple[str, ...] = ()
    group: str = ""
    states: tuple[str, ...] = ()
    planners: tuple[tuple[str, str], ...] = ()
    planner: tuple[str, str] = ("", "")
    speed: float = 1.0
    avoid: bool = False
    own_start: bool = False
    path: bool = True
    objects: tuple[str, ...] = ()
    attached: tuple[str, ...] = ()


def build(state: MenuState, numbers: dict[tuple[int, Hashable], int]) -> list[PanelEntry]:
    """Return the Entries for a MenuState.

    numbers: {(parent, command or title): number} of all menus before, to which new entries are added: rviz answers with
    a number alone, and a click on a menu that has changed meanwhile must mean what was read there.
    """
    menu = _Menu(numbers)
    for title, command in (("Plan", "plan"), ("Execute", "execute"), ("Plan and execute", "plan_and_execute"),
                           ("Stop", "stop")):
        menu.add(0, title, command)
    goal = menu.add(0, "Goal")
    menu.add(goal, "Random valid", "random", "goal")
    menu.add(goal, "Where the robot is", "current", "goal")
    menu.add(goal, "The start", "copy", "goal")
    for name in state.states:
        menu.add(goal, name, "named", "goal", name)
    start = menu.add(0, "Start")
    menu.choice(start, "Where the robot is", not state.own_start, "current", "start")
    menu.choice(start, "Another, with a marker", state.own_start, "copy", "start")
    menu.add(start, "Random valid", "random", "start")
    for name in state.states:
        menu.add(start, name, "named", "start", name)
    if len(state.groups) > 1:
        group = menu.add(0, "Group")
        for name in state.groups:
            menu.choice(group, name, name == state.group, "group", name)
    planner = menu.add(0, "Planner")
    menu.choice(planner, "move_group's choice", state.planner == ("", ""), "planner", "", "")
    pipelines = list(dict.fromkeys(pipeline for pipeline, _ in state.planners))
    for pipeline in pipelines:
        below = planner if len(pipelines) == 1 else menu.add(planner, pipeline or "planning pipeline")
        for name in (name for other, name in state.planners if other == pipeline):
            menu.choice(below, name, state.planner == (pipeline, name), "planner", pipeline, name)
    speed = menu.add(0, "Speed")
    for share in sorted({*SPEEDS, state.speed}):
        menu.choice(speed, "%.3g %%" % (100.0 * share), share == state.speed, "speed", share)
    scene = menu.add(0, "Scene")
    box = menu.add(scene, "Add a box in front")
    for size in BOX_SIZES_M:
        menu.add(box, "%.0f cm" % (100.0 * size), "add_box", size)
    for title, what, names in (("Remove", "remove", state.objects), ("Attach", "attach", state.objects),
                               ("Detach", "detach", state.attached)):
        if names:
            below = menu.add(scene, title)
            for name in names:
                menu.add(below, name, what, name)
    menu.choice(0, "Keep clear while dragging", state.avoid, "toggle", "avoid")
    menu.choice(0, "Show the planned path", state.path, "toggle", "path")
    return menu.entries


class _Menu:
    def __init__(self, numbers: dict[tuple[int, Hashable], int]) -> None:
        self.entries: list[PanelEntry] = []
        self._numbers = numbers

    def add(self, parent: int, title: str, *command: Hashable) -> int:
        number = self._numbers.setdefault((parent, command or title), len(self._numbers) + 1)
        self.entries.append(PanelEntry(number, parent, title, command))
        return number

    def choice(self, parent: int, title: str, chosen: bool, *command: Hashable) -> int:
        return self.add(parent, ("[x] " if chosen else "[  ] ") + title, *command)
