# SPDX-License-Identifier: BSD-3-Clause
"""A follower of a simulator's snapshot shows what is there now: what is spawned, moved and deleted while it runs."""
import numpy as np
import pytest

from sensor_renderer.following import WorldFollower
from world_picture.drawing import DrawingCache
from world_picture.snapshot import SnapshotWriter

CUBE = """<robot name="cube"><link name="link"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
</robot>"""


@pytest.fixture
def writer(tmp_path):
    writer = SnapshotWriter(tmp_path)
    yield writer
    writer.close()


def show(writer, **places):
    """Write a scene of cubes by their names, and its state, as a simulator does."""
    writer.write_scene([{"name": name, "urdf": CUBE, "joints": []} for name in places])
    move(writer, **places)


def move(writer, **places):
    writer.write(1, 0.002, [(*place, 0.0, 0.0, 0.0, 1.0) for place in places.values()])


def seen(follower):
    """{name: (3,) where it is}"""
    return {name: body.link_matrix("link")[:3, 3].tolist() for name, body in follower.mirror.bodies.items()}


def test_what_is_spawned_moved_and_deleted_is_followed(writer, tmp_path):
    follower = WorldFollower(writer.folder, pytest.fail, DrawingCache(tmp_path / "drawings"))
    show(writer, first=(1.0, 0.0, 0.0))
    assert follower.follow() and seen(follower) == {"first": [1.0, 0.0, 0.0]}
    move(writer, first=(2.0, 0.0, 0.0))
    assert follower.follow() and seen(follower) == {"first": [2.0, 0.0, 0.0]}
    show(writer, first=(2.0, 0.0, 0.0), second=(0.0, 3.0, 0.0))
    assert follower.follow() and seen(follower) == {"first": [2.0, 0.0, 0.0], "second": [0.0, 3.0, 0.0]}
    show(writer, second=(0.0, 4.0, 0.0))
    assert follower.follow() and seen(follower) == {"second": [0.0, 4.0, 0.0]}
    assert follower.revision == writer.revision


def test_a_state_of_the_scene_before_is_not_taken_for_one_of_the_new_scene(writer, tmp_path):
    follower = WorldFollower(writer.folder, pytest.fail, DrawingCache(tmp_path / "drawings"))
    assert not follower.follow()  # nothing was written
    show(writer, first=(1.0, 0.0, 0.0))
    assert follower.follow()
    before = np.array(follower.snapshot.values)
    writer.write_scene([{"name": name, "urdf": CUBE, "joints": []} for name in ("first", "second")])
    follower.follow()
    assert list(seen(follower)) == ["first"] and follower.snapshot.values.tolist() == before.tolist()
