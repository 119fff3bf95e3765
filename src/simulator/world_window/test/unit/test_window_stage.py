# SPDX-License-Identifier: BSD-3-Clause
"""The mouse picks, pulls and moves the eye; selection and following survive changes of the world."""
import numpy as np
import pytest
from window_worlds import BLOCK_AT, FLOOR, SCENE, values

from sensor_renderer.mirror import Mirror
from world_picture.drawing import DrawingCache
from world_window import overlay, picking
from world_window.eye import NEAREST_M
from world_window.stage import FIRST_EYE, LEFT, MIDDLE, RIGHT, WindowStage

BLOCK = "block", "body"


@pytest.fixture
def mirror():
    mirror = Mirror(DrawingCache(), lambda uri: None, pytest.fail)
    mirror.set_scene(SCENE)
    mirror.set_state(values())
    return mirror


@pytest.fixture
def stage(mirror):
    stage = WindowStage(800, 600)
    stage.take(mirror, True)
    return stage


def seen(stage, point):
    local = np.linalg.inv(stage.eye.pose()) @ [*point, 1.0]
    return stage.pinhole.project([local[:3]])[0]


def drag(stage, button, start, end, **keys):
    stage.press(button, *start, **keys)
    for part in np.linspace(0.0, 1.0, 5)[1:]:
        stage.move(*(np.asarray(start) + part * np.subtract(end, start)))
    return stage.release(button, *end)


# -- picking ------------------------------------------------------------------------------------------------------


def test_a_ray_hits_the_nearest_face(mirror):
    down = np.array([0.0, 0.0, -1.0])
    hit = picking.first_hit(mirror, np.array([*BLOCK_AT[:2], 2.0]), down)
    assert (hit.model, hit.link) == BLOCK and hit.distance == pytest.approx(1.4)
    np.testing.assert_allclose(hit.point, (0.2, 0.1, 0.6), atol=1e-6)
    assert picking.first_hit(mirror, np.array([0.4, 0.4, 2.0]), down).model == "table"
    assert picking.first_hit(mirror, np.array([3.0, 3.0, 2.0]), down).model == "floor"
    assert picking.first_hit(mirror, np.array([3.0, 3.0, 2.0]), -down) is None


def test_links_that_have_moved_are_hit_where_they_are(mirror):
    down, above = np.array([0.0, 0.0, -1.0]), np.array([-0.8, 1.0, 2.0])
    assert picking.first_hit(mirror, above, down).model == "floor"
    mirror.set_state(values(joint=np.pi / 2.0))
    hit = picking.first_hit(mirror, above, down)
    assert (hit.model, hit.link) == ("arm", "rod") and hit.point[2] == pytest.approx(0.425)


def test_the_ray_of_a_pixel_goes_through_what_is_seen_there(stage):
    origin, direction = picking.ray(stage.pinhole, stage.eye.pose(), *seen(stage, BLOCK_AT))
    away = np.array(BLOCK_AT) - origin
    assert direction @ away == pytest.approx(np.linalg.norm(away))


def test_a_ray_meets_a_plane_ahead_only():
    origin, point = np.zeros(3), np.array([0.0, 0.0, 2.0])
    np.testing.assert_allclose(picking.on_plane(origin, np.array([0.6, 0.0, 0.8]), point, np.array([0.0, 0.0, 1.0])),
                               (1.5, 0.0, 2.0))
    for direction in ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0)):
        assert picking.on_plane(origin, np.array(direction), point, np.array([0.0, 0.0, 1.0])) is None


# -- the eye ------------------------------------------------------------------------------------------------------


def test_an_empty_world_is_seen_as_by_gazebo_and_the_first_model_is_looked_at(mirror):
    stage, empty = WindowStage(800, 600), Mirror(DrawingCache(), lambda uri: None, pytest.fail)
    empty.set_scene([FLOOR])
    stage.take(empty, True)
    assert stage.eye == FIRST_EYE
    stage.take(mirror, True)
    assert stage.eye != FIRST_EYE
    assert (np.abs(seen(stage, BLOCK_AT) - (400, 300)) < (400, 300)).all()


def test_an_eye_that_the_user_has_moved_stays_when_models_come(stage, mirror):
    drag(stage, MIDDLE, (400, 300), (450, 300))
    eye = stage.eye
    mirror.set_scene(SCENE[:2])
    mirror.set_state(values()[:14])
    stage.take(mirror, True)
    assert stage.eye == eye
    stage.home()
    assert stage.eye != eye


def test_the_left_button_pans_with_what_is_under_it(stage):
    start = seen(stage, BLOCK_AT).round()
    point = stage._under(*start)[1]
    drag(stage, LEFT, start, start + (60, 30))
    np.testing.assert_allclose(seen(stage, point) - start, (60, 30), atol=0.5)


@pytest.mark.parametrize(("button", "keys"), [(MIDDLE, {}), (LEFT, {"shift": True})])
def test_orbiting_keeps_what_is_under_the_pointer(stage, button, keys):
    start, before = seen(stage, BLOCK_AT).round(), stage.eye
    point = stage._under(*start)[1]
    drag(stage, button, start, start + (100, 20), **keys)
    np.testing.assert_allclose(seen(stage, point), start, atol=0.5)
    assert abs(stage.eye.yaw - before.yaw) > 0.3


def test_wheel_and_right_button_zoom_to_the_pointer(stage):
    place = seen(stage, BLOCK_AT).round()
    point = stage._under(*place)[1]
    first = np.linalg.norm(np.subtract(stage.eye.position, point))
    stage.wheel(3, *place)
    second = np.linalg.norm(np.subtract(stage.eye.position, point))
    assert second < 0.7 * first
    np.testing.assert_allclose(seen(stage, point), place, atol=0.5)
    drag(stage, RIGHT, place, place + (0, 50))  # downwards is away, as in rviz
    assert np.linalg.norm(np.subtract(stage.eye.position, point)) > 1.5 * second
    for _ in range(100):
        stage.wheel(3, *place)
    assert np.linalg.norm(np.subtract(stage.eye.position, point)) >= 0.99 * NEAREST_M


# -- selection ----------------------------------------------------------------------------------------------------


def test_a_click_selects_and_a_drag_does_not(stage):
    place = seen(stage, BLOCK_AT)
    hit = drag(stage, LEFT, place, place + (2, 1))
    assert (hit.model, hit.link) == BLOCK == stage.selected
    drag(stage, LEFT, place, place + (40, 0))
    assert stage.selected == BLOCK
    stage.press(LEFT, 5, 595)
    assert stage.release(LEFT, 5, 595).model == "floor" and stage.selected is None


def test_the_selection_goes_with_its_model(stage, mirror):
    stage.select(*BLOCK)
    stage.follow(BLOCK)
    assert any(isinstance(shape, overlay.ScreenLine) for shape in stage.shapes())
    mirror.set_scene(SCENE[:2])
    stage.take(mirror, True)
    assert stage.selected is None and stage.followed is None
    assert stage.shapes() == []


def test_following_moves_the_eye_with_the_link(stage, mirror):
    stage.follow(BLOCK)
    before = seen(stage, BLOCK_AT)
    moved = np.add(BLOCK_AT, (0.5, -0.2, 0.1))
    mirror.set_state(values(moved))
    version = stage.version
    stage.take(mirror, False)
    np.testing.assert_allclose(seen(stage, moved), before, atol=1e-6)
    assert stage.version > version
    stage.follow(None)
    mirror.set_state(values())
    stage.take(mirror, False)
    np.testing.assert_allclose(seen(stage, moved), before, atol=1e-6)


def test_go_to_brings_the_selected_thing_into_the_middle(stage):
    stage.go_to_selected()  # nothing is selected, nothing happens
    stage.select(*BLOCK)
    stage.go_to_selected()
    np.testing.assert_allclose(seen(stage, BLOCK_AT), (399.5, 299.5), atol=0.5)
    assert np.linalg.norm(np.subtract(stage.eye.position, BLOCK_AT)) < 0.5


# -- pulling ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by_tool", [False, True])
def test_a_pull_starts_at_the_thing_and_its_target_follows_the_pointer(stage, mirror, by_tool):
    place, eye = seen(stage, BLOCK_AT), stage.eye
    stage.pulls_by_left = by_tool
    stage.press(LEFT, *place, control=not by_tool)
    assert (stage.pull.model, stage.pull.link) == BLOCK
    np.testing.assert_allclose(stage.pull.grip + BLOCK_AT, stage.pull.target, atol=1e-9)
    assert np.abs(stage.pull.grip).max() == pytest.approx(0.05, abs=1e-6)  # on a face
    first = stage.pull.target
    stage.move(*(place + (70, -50)))
    np.testing.assert_allclose(seen(stage, stage.pull.target), place + (70, -50), atol=1e-6)
    ahead = eye.rotation()[:, 2]
    assert ahead @ (stage.pull.target - first) == pytest.approx(0.0, abs=1e-9)
    stage.wheel(2, *place)
    assert ahead @ (stage.pull.target - first) > 0.05
    assert any(shape.colour == overlay.SPRING for shape in stage.shapes())
    assert stage.release(LEFT, *(place + (70, -50))) is None
    assert stage.pull is None and stage.eye == eye


def test_what_is_fixed_in_the_world_is_not_pulled(stage):
    stage.press(LEFT, *seen(stage, (0.4, -0.4, 0.5)), control=True)
    assert stage.pull is None
    stage.release(LEFT, 0, 0)
    stage.press(LEFT, *seen(stage, (-0.4, 0.6, 0.4)), control=True)
    assert stage.pull.link == "rod"  # a joint of a fixed model moves


def test_a_pull_ends_with_its_model(stage, mirror):
    stage.press(LEFT, *seen(stage, BLOCK_AT), control=True)
    mirror.set_scene(SCENE[:2])
    stage.take(mirror, True)
    assert stage.pull is None
    assert stage.release(LEFT, 100, 100) is None


# -- layers -------------------------------------------------------------------------------------------------------


def test_layers_draw_frames_names_and_contacts(stage):
    assert stage.shapes() == []
    stage.show("names", True)
    assert {shape.words for shape in stage.shapes()} == {"table", "block", "arm"}
    stage.show("names", False)
    stage.show("frames", True)
    assert {shape.words for shape in stage.shapes() if isinstance(shape, overlay.Text)} == {
        "top", "body", "foot", "rod"}
    stage.show("frames", False)
    stage.take_contacts([overlay.ShownContact((0.2, 0.1, 0.5), (0.0, 0.0, 1.0), 9.81)])
    assert stage.shapes() == []
    stage.show("contacts", True)
    dot, line = stage.shapes()
    np.testing.assert_allclose((dot.x, dot.y), seen(stage, (0.2, 0.1, 0.5)))
    assert line.y1 < line.y0


def test_lines_are_cut_where_they_pass_the_eye(stage):
    drawn = overlay.Overlay(stage.pinhole, stage.eye.pose())
    ahead = stage.eye.rotation()[:, 2]
    drawn.line(stage.eye.position + 2.0 * ahead, stage.eye.position - 2.0 * ahead + (0.0, 0.0, 0.1), (1, 2, 3))
    line, = drawn.shapes
    assert np.isfinite([line.x0, line.y0, line.x1, line.y1]).all()
    drawn.line(stage.eye.position - ahead, stage.eye.position - 2.0 * ahead, (1, 2, 3))
    drawn.dot(stage.eye.position - ahead, (1, 2, 3))
    assert len(drawn.shapes) == 1
