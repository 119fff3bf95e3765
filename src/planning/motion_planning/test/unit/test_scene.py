# SPDX-License-Identifier: BSD-3-Clause
"""Each change of a scene makes a new scene with that change, and leaves the old one as it is."""
import numpy as np
import pytest

from motion_planning.scene import OCTOMAP, AllowedCollisions, Cone, Octree, Scene, SceneError, TriangleMesh, WorldObject
from urdf_model import Box, Sphere
from urdf_model.transforms import axis_rotation, rigid


def at(x=0.0, y=0.0, z=0.0, turn=0.0):
    return rigid(axis_rotation((0.0, 0.0, 1.0), turn), (x, y, z))


def box(name="box", pose=None, **more):
    return WorldObject(name, at(1.0) if pose is None else pose, ((Box((0.1, 0.2, 0.3)), np.eye(4)),), **more)


@pytest.fixture
def scene(mix):
    return Scene(mix, mix.state({"turn": 0.4, "push": 0.25}, at(0.0, 0.0, 1.0)))


def test_add_replaces_and_leaves_the_old_scene_alone(scene):
    first = scene.with_object(box())
    second = first.with_object(box(pose=at(2.0)))
    assert list(scene.objects) == [] and list(first.objects) == list(second.objects) == ["box"]
    assert first.objects["box"].pose[0, 3] == 1.0 and second.objects["box"].pose[0, 3] == 2.0
    with pytest.raises(TypeError):
        first.objects["other"] = 1


def test_append_adds_shapes_where_they_are(scene):
    start = scene.with_object(box(pose=at(1.0, turn=0.5)))
    more = WorldObject("box", at(3.0), ((Sphere(0.1), at(0.0, 1.0)),), {"top": at(0.0, 0.0, 0.2)})
    whole = start.appended(more).objects["box"]
    assert [type(shape) for shape, _ in whole.shapes] == [Box, Sphere]
    np.testing.assert_allclose(whole.pose @ whole.shapes[1][1], at(3.0, 1.0), atol=1e-12)
    np.testing.assert_allclose(start.appended(more).frame("box/top"), at(3.0, 0.0, 0.2), atol=1e-12)
    assert scene.appended(more).objects["box"] is more


def test_move_changes_poses_alone(scene):
    start = scene.with_object(box())
    np.testing.assert_array_equal(start.moved("box", at(5.0)).objects["box"].pose, at(5.0))
    inside = start.moved("box", at(5.0), [at(0.1)]).objects["box"]
    assert inside.shapes[0][1][0, 3] == 0.1 and inside.shapes[0][0] is start.objects["box"].shapes[0][0]
    with pytest.raises(SceneError, match="has 1 shape, but 2 poses"):
        start.moved("box", at(5.0), [at(), at()])
    with pytest.raises(SceneError, match="no object 'bix'; did you mean 'box'"):
        start.moved("bix", at())


def test_remove_takes_the_colour_and_keeps_what_may_touch(scene):
    start = scene.with_objects([box(), box("cup")]).with_colours({"box": (1, 0, 0, 1), "cup": (0, 1, 0, 1)})
    start = start.with_allowed(start.allowed.with_entries({("box", "slide"): True}).with_default("cup", True))
    left = start.without_object("box")
    assert list(left.objects) == ["cup"] and list(left.colours) == ["cup"]
    # As in MoveIt: an object that takes the name again may touch what the first one might.
    for scene in (left, start.without_object(""), start.without_objects(["box", "cup"])):
        again = scene.with_object(box()).allowed
        assert again.allowed("slide", "box") and again.allowed("turret", "base") and again.allowed("cup", "slide")
    assert list(start.without_object("").objects) == []
    with pytest.raises(SceneError, match="no object 'cap'"):
        start.without_object("cap")


@pytest.mark.parametrize("bad, words", [
    (lambda: WorldObject("b", np.full((4, 4), np.nan), ()), "finite"),
    (lambda: WorldObject("b", np.zeros((4, 4)), ()), "no rotation"),
    (lambda: WorldObject("b", np.eye(3), ()), "finite \\(4, 4\\)"),
    (lambda: WorldObject("b", at(1e9), ()), "1e\\+09 m away"),
    (lambda: box(pose=at(np.inf)), "finite"),
    (lambda: WorldObject("b", at(), ((Box((0.1, -0.2, 0.1)), at()),)), "Box of object 'b' has the sizes 0.1, -0.2"),
    (lambda: WorldObject("b", at(), ((Sphere(np.nan), at()),)), "sizes nan"),
    (lambda: WorldObject("b", at(), ((Cone(0.1, 1e9), at()),)), "sizes 0.1, 1e\\+09"),
    (lambda: WorldObject("b", at(), ((TriangleMesh(1e9 * np.eye(3), [[0, 1, 2]]), at()),)), "mesh of object 'b'"),
])
def test_poses_are_checked(bad, words):
    with pytest.raises(SceneError, match=words):
        bad()


def test_names_are_checked(scene):
    for name, words in ((OCTOMAP, "octomap's name"), ("", "no name")):
        with pytest.raises(SceneError, match=words):
            scene.with_object(box(name))
        with pytest.raises(SceneError, match=words):
            scene.attach(box(name), "slide")
    with pytest.raises(SceneError, match="has no shapes"):
        scene.with_object(WorldObject("empty", at(), ()))


def test_shapes_are_checked():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert len(TriangleMesh(corners, [[0, 1, 2]]).vertices) == 3 and Cone(1.0, 2.0).length == 2.0
    for vertices, triangles in ((corners, []), (corners, [[0, 1, 3]]), (corners, [[0, 1, -1]]),
                                ([[0, 0, np.inf]] * 3, [[0, 1, 2]]), ([[0, 0]], [[0, 0, 0]])):
        with pytest.raises(ValueError):
            TriangleMesh(vertices, np.reshape(triangles, (-1, 3)))
    with pytest.raises(ValueError):
        Octree(0.0, [])
    for boxes, words in (([(0.15, 0.15, 0.15, 0.3)], "power of 2"), ([(0.1, 0.05, 0.05, 0.1)], "on the grid"),
                         ([(4e3 + 0.05, 0.05, 0.05, 0.1)], "from its origin"), ([(0.0, 0, 0, np.nan)], "finite")):
        with pytest.raises(ValueError, match=words):
            Octree(0.1, boxes)
    assert Octree(0.1, []).boxes.shape == (0, 4)


def test_attaching_takes_the_object_out_of_the_world_and_it_follows_the_link(scene):
    start = scene.with_object(box(subframes={"top": at(0.0, 0.0, 0.15)})).with_colours({"box": (1, 0, 0, 1)})
    held = start.attach("box", "slide", ["finger"])
    body = held.state.attached["box"]
    assert list(held.objects) == [] and body.touch_links == {"slide", "finger"} and "box" in held.colours
    np.testing.assert_allclose(held.frame("box"), at(1.0), atol=1e-12)
    moved = held.with_state(held.state.with_joints({"push": 0.1}))
    step = held.frame("slide")[:3, :3] @ (-0.15, 0.0, 0.0)
    np.testing.assert_allclose(moved.frame("box")[:3, 3], (1.0, 0.0, 0.0) + step, atol=1e-12)
    np.testing.assert_allclose(moved.frame("box/top")[:3, 3], (1.0, 0.0, 0.15) + step, atol=1e-12)
    back = moved.detach("box")
    assert dict(back.state.attached) == {} and back.colours["box"] == (1, 0, 0, 1)
    np.testing.assert_allclose(back.objects["box"].pose, moved.frame("box"), atol=1e-12)


def test_attaching_with_geometry_replaces_what_has_the_name(scene):
    held = scene.with_object(box()).attach(box(pose=at(0.1)), "slide")
    assert list(held.objects) == []
    np.testing.assert_allclose(held.frame("box"), held.frame("slide") @ at(0.1), atol=1e-12)
    other = held.attach(box(pose=at(0.5)), "finger")
    assert list(other.state.attached) == ["box"] and other.state.attached["box"].link == "finger"
    handed = held.attach("box", "finger")
    np.testing.assert_allclose(handed.frame("box"), held.frame("box"), atol=1e-12)
    more = held.attach_more(WorldObject("box", at(0.1), ((Sphere(0.1), at()),)), "slide")
    assert len(more.state.attached["box"].object.shapes) == 2
    with pytest.raises(SceneError, match="held by 'slide', not by 'finger'"):
        held.attach_more(box(), "finger")


def test_detaching_all_or_all_of_a_link(scene):
    held = scene.attach(box("a", at()), "slide").attach(box("b", at()), "finger").attach(box("c", at()), "slide")
    assert sorted(held.detach(link="slide").objects) == ["a", "c"]
    assert sorted(held.detach().objects) == ["a", "b", "c"]
    with pytest.raises(SceneError, match="holds no object 'd'"):
        held.detach("d")
    with pytest.raises(SceneError, match="held by 'finger', not by 'slide'"):
        held.detach("b", "slide")


def test_detaching_keeps_the_worlds_object_of_the_same_name(scene):
    held = scene.attach(box(pose=at()), "slide").with_object(box(pose=at(9.0)))
    assert held.detach("box").objects["box"].pose[0, 3] == 9.0


def test_what_cannot_be_attached_is_named(scene):
    with pytest.raises(SceneError, match="'slid': the robot has no such link; did you mean 'slide'"):
        scene.attach(box(), "slid")
    with pytest.raises(SceneError, match="the world has no such object"):
        scene.attach("cup", "slide")


def test_frames_of_everything(scene):
    full = scene.with_object(box(subframes={"top": at(0.0, 0.0, 0.5)})).with_transforms({"camera": at(7.0)})
    np.testing.assert_allclose(full.frame("base"), at(0.0, 0.0, 1.0))
    np.testing.assert_allclose(full.frame("/box/top"), at(1.0, 0.0, 0.5))
    np.testing.assert_allclose(full.frame("camera"), at(7.0))
    assert full.has_frame("slide") and not full.has_frame("box/bottom")
    assert set(full.frame_names()) >= {"base", "slide", "box", "box/top", "camera"}
    with pytest.raises(SceneError, match="'box/tap' is not a frame.*did you mean 'box/top'"):
        full.frame("box/tap")


def test_the_planning_frame_is_the_virtual_joints(baxter):
    scene = Scene(baxter).with_state(baxter.state({}, at(1.0)))
    np.testing.assert_array_equal(scene.frame("world"), np.eye(4))
    np.testing.assert_array_equal(scene.frame("base"), at(1.0))


def test_padding_and_scale(scene):
    padded = scene.with_padding({"slide": 0.01}, {"finger": 1.5}).with_padding({"finger": 0.02})
    assert dict(padded.link_padding) == {"slide": 0.01, "finger": 0.02} and dict(padded.link_scale) == {"finger": 1.5}
    for padding, scale in (({"slid": 0.1}, None), ({"slide": -0.1}, None), (None, {"slide": 0.0}),
                           ({"slide": np.nan}, None)):
        with pytest.raises(SceneError):
            scene.with_padding(padding, scale)


def test_allowed_collisions_of_the_srdf(mix):
    allowed = AllowedCollisions.of(mix)
    for a in mix.links:
        for b in mix.links:
            if a != b:
                assert allowed.allowed(a, b) != mix.default_collision(a, b), (a, b)


def test_an_entry_comes_before_defaults_and_a_forbidding_default_before_an_allowing_one():
    allowed = AllowedCollisions({("a", "b"): False}, {"a": True, "c": False})
    assert not allowed.allowed("b", "a")
    assert allowed.allowed("a", "x") and not allowed.allowed("a", "c") and not allowed.allowed("x", "y")


def test_many_names_are_asked_about_at_once():
    rng, names = np.random.default_rng(1), ["a", "b", "c", "d", "e", "b"]
    for _ in range(50):
        entries = {tuple(sorted(rng.choice(list("abcdef"), 2, replace=False))): bool(rng.integers(2)) for _ in range(4)}
        allowed = AllowedCollisions(entries, {name: bool(rng.integers(2)) for name in rng.choice(list("abcdef"), 2)})
        assert (allowed.among(names) == [[allowed.allowed(a, b) for b in names] for a in names]).all()


def test_matrices_go_there_and_back():
    allowed = AllowedCollisions({("a", "b"): True, ("b", "c"): False}, {"d": True})
    names, matrix, *defaults = allowed.as_matrix()
    assert names == ["a", "b", "c"] and matrix.tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, 0]]
    again = AllowedCollisions.from_matrix(names, matrix, *defaults)
    assert again.allowed("a", "b") and not again.allowed("c", "b") and again.allowed("d", "z")
    for bad in ((["a", "b"], [[True]]), (["a"], []), (["a"], [[True, False]])):
        with pytest.raises(ValueError):
            AllowedCollisions.from_matrix(*bad)
    with pytest.raises(ValueError):
        AllowedCollisions.from_matrix([], [], ["a"], [])


def test_the_octomap_is_a_thing_of_its_own(scene):
    with_map = scene.with_octomap(Octree(0.1, [[0.05, 0.05, 0.05, 0.1]]), at(1.0))
    assert with_map.octomap.id == OCTOMAP and list(with_map.objects) == []
    assert with_map.with_octomap(None).octomap is None


def test_ten_thousand_objects_come_at_once(scene):
    many = scene.with_objects([box("box%d" % number) for number in range(10_000)])
    assert len(many.objects) == 10_000 and len(many.moved("box7", at()).objects) == 10_000
