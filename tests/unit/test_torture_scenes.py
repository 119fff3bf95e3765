# SPDX-License-Identifier: BSD-3-Clause
"""A slice of torture's hostile planning scenes, always the same."""
import sys
from pathlib import Path

import pytest

TORTURE = Path(__file__).resolve().parents[1] / "torture"


@pytest.fixture
def scenes(monkeypatch):
    monkeypatch.syspath_prepend(str(TORTURE))
    import scenes

    from motion_planning.spheres import cover, sphere_model

    for module, name in ((sphere_model, "cached"), (sphere_model, "_MAX_POINTS"), (sphere_model, "_MAX_BOXES"),
                         (cover, "OF_OBJECTS")):
        monkeypatch.setattr(module, name, getattr(module, name))  # put back afterwards
    yield scenes
    sys.modules.pop("scenes")


def test_hostile_scenes_are_prepared_and_spheres_contain_them(scenes):
    some = scenes.Scenes(7)
    found = {number: some.problems(number) for number in range(100)}
    assert not {number: problems for number, problems in found.items() if problems}


def test_a_scene_that_spheres_do_not_contain_is_found(scenes, monkeypatch):
    some = scenes.Scenes(7)
    empty = scenes.sphere_model.Boxes(scenes.np.empty((0, 2, 3)))
    monkeypatch.setattr("motion_planning.spheres.world_tables.boxes_of", lambda mesh: empty)
    monkeypatch.setattr("motion_planning.spheres.world_tables.box_around", lambda mesh: empty)
    assert any("spheres are free" in text for number in range(100) for text in some.problems(number))
