# SPDX-License-Identifier: BSD-3-Clause
"""Light, and pictures on screens."""
import numpy as np
import pytest

from sensor_renderer.floor import on_floor
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.light import MAX_LAMPS, SceneLight
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model.transforms import pose_matrix
from world_picture.drawing import DrawingCache
from world_picture.shared_picture import PictureWriter

CUBE = """<robot name="cube"><link name="link"><visual><geometry><box size="0.2 0.2 0.2"/></geometry>
<material name="r"><color rgba="0.9 0.9 0.9 1"/></material></visual></link></robot>"""
SHEET = CUBE.replace("0.2 0.2 0.2", "1 1 0.002")
BALL = CUBE.replace('<box size="0.2 0.2 0.2"/>', '<sphere radius="0.4"/>')
FLOOR = {"name": "floor", "urdf": None, "joints": []}
UPRIGHT = [0, 0, 0, 1]
# Straight down on x, y = 0, 0 from a height of 2 m; the picture's right is -y of the world, its upper edge +x.
ABOVE = pose_matrix((0.0, 0.0, 2.0), (0.0, np.pi / 2, 0.0)) @ OPTICAL
PINHOLE = Pinhole.from_field_of_view(200, 200, 0.927, 0.05, 20.0)  # 2 m wide on the floor, 1 cm a pixel


def lamp(kind, **values):
    return {"type": kind, "place": [0, 0, 1], "direction": [0, 0, -1], "diffuse": [1.0, 1.0, 1.0],
            "attenuation": [1, 0, 0], "range": 10.0, "spot": None, "cast_shadows": False, **values}


@pytest.fixture
def renderer():
    made = GlRenderer()
    yield made
    made.close()


def world(tmp_path, light, *bodies):
    """A Mirror of the floor and [(entry of the scene, values)]."""
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([FLOOR, *(entry for entry, _ in bodies)], light)
    mirror.set_state(np.concatenate([[0, 0, 0, *UPRIGHT], *(values for _, values in bodies)]))
    return mirror


def seen(renderer, mirror, pose=ABOVE):
    return renderer.render(mirror, PINHOLE, pose)[0].astype(int)


def at(picture, x, y):
    """The colour of the floor at x, y [m]."""
    return picture[round(99.5 - 100 * x), round(99.5 - 100 * y)]


def test_shadows_fall_away_from_the_sun_of_the_world(renderer, tmp_path):
    cube = {"name": "cube", "urdf": CUBE, "joints": []}, [0, 0, 0.6, *UPRIGHT]
    for direction, side in (((0.0, 1.0, -1.0), 1), ((0.0, -1.0, -1.0), -1)):
        sun = lamp("directional", direction=direction, cast_shadows=True)
        picture = seen(renderer, world(tmp_path, {"lights": [sun]}, cube))
        assert at(picture, 0.0, 0.6 * side).sum() < 0.7 * at(picture, 0.0, -0.6 * side).sum()
        for off in ({"shadows": False}, {"lights": [{**sun, "cast_shadows": False}]}):
            even = seen(renderer, world(tmp_path, {"lights": [sun], **off}, cube))
            assert at(even, 0.0, 0.6) == pytest.approx(at(even, 0.0, -0.6), rel=0.1)  # tiles differ


def test_a_shadow_has_a_soft_edge_where_geometry_says(renderer, tmp_path):
    cube = {"name": "cube", "urdf": CUBE, "joints": []}, [0, 0, 0.6, *UPRIGHT]
    sun = lamp("directional", direction=(0.0, 1.0, -1.0), cast_shadows=True)
    fine = Pinhole.from_field_of_view(201, 201, 0.1, 0.05, 20.0)  # 1 mm a pixel
    for edge, turn in ((0.4, 1), (0.8, -1)):
        above = pose_matrix((0.05, edge, 2.0), (0.0, np.pi / 2, 0.0)) @ OPTICAL
        picture, _ = renderer.render(world(tmp_path, {"lights": [sun]}, cube), fine, above)
        # From the lit side to the shaded one, in tile-free rows of the floor.
        row = picture[100, :, 0].astype(int)[::-turn]
        assert (np.diff(row) <= 0).all() and row[0] > 1.4 * row[-1]
        between = np.flatnonzero((row < row[0] - 5) & (row > row[-1] + 5))
        assert 4 <= len(between) <= 20, "a ramp of one or two pixels of the shadow map, of 4 mm"
        assert abs(between.mean() - 100) <= 20


def test_a_round_body_throws_no_shadow_on_its_lit_side(renderer, tmp_path):
    ball = {"name": "ball", "urdf": BALL, "joints": []}, [0, 0, 0.6, *UPRIGHT]
    sun = lamp("directional", direction=(0.3, 1.0, -1.0), cast_shadows=True)
    with_shadows, without = (seen(renderer, world(tmp_path, {"lights": [sun], "shadows": on}, ball)).sum(axis=2)
                             for on in (True, False))
    place = np.linspace(0.995, -0.995, 200)
    # Nearer to the camera than the floor, so larger in the picture.
    ball = np.hypot(place[:, None], place) < 0.5
    lit = ball & (without > 1.3 * without[ball].min())
    assert lit.sum() > 2000 and (with_shadows[lit] > 0.97 * without[lit]).all()


def test_without_a_lamp_there_is_the_ambience_alone(renderer, tmp_path):
    dark = seen(renderer, world(tmp_path, {"lights": []}))
    assert dark.mean() < 0.6 * seen(renderer, world(tmp_path, {})).mean()
    red = seen(renderer, world(tmp_path, {"lights": [], "ambient": [0.8, 0.1, 0.1]}))
    assert red[..., 0].mean() == pytest.approx(2 * dark[..., 0].mean(), rel=0.05) and red[..., 1].max() < 30
    away = pose_matrix((0.0, 0.0, 2.0), (0.0, -np.pi / 2, 0.0)) @ OPTICAL
    assert (seen(renderer, world(tmp_path, {"background": [1.0, 0.0, 0.2]}), away) == (255, 0, 51)).all()


def test_lamps_light_what_they_reach(renderer, tmp_path):
    for bodies in ((), (({"name": "sheet", "urdf": SHEET, "joints": []}, [0, 0, 0.001, *UPRIGHT]),)):
        spot = lamp("spot", diffuse=[0.0, 1.0, 0.0], spot=[0.5, 0.7, 1.0])
        picture = seen(renderer, world(tmp_path, {"lights": [spot], "ambient": [0.1] * 3}, *bodies))
        if not bodies:  # the floor is lit pixel by pixel: inside of half the outer angle and nowhere else
            assert at(picture, 0.1, 0.0)[1] > at(picture, 0.1, 0.0)[0] + 80
            assert at(picture, 0.5, 0.0)[1] < at(picture, 0.5, 0.0)[0] + 10
        point = lamp("point", diffuse=[0.0, 0.0, 1.0], place=[0.4, 0.4, 0.3], attenuation=[1, 0, 4.0])
        picture = seen(renderer, world(tmp_path, {"lights": [point], "ambient": [0.1] * 3}, *bodies))
        assert at(picture, 0.4, 0.4)[2] > at(picture, -0.4, -0.4)[2] + 40
        short = seen(renderer, world(tmp_path, {"lights": [{**point, "range": 0.2}], "ambient": [0.1] * 3}, *bodies))
        assert short[..., 2].max() < 50


@pytest.mark.parametrize("kind", ["spot", "point"])
def test_the_strongest_lamps_throw_shadows(renderer, tmp_path, kind):
    """A lamp above and to the left of a cube: its shadow lies to the right, where the lines from the lamp end."""
    cube = {"name": "cube", "urdf": CUBE, "joints": []}, [0, 0, 0.3, *UPRIGHT]
    values = {"place": [0, 0.5, 1.0], "direction": [0, -0.5, -0.8], "spot": [1.6, 1.8, 1.0], "diffuse": [1.2] * 3}
    for turn in (1, -1):
        values["place"][1], values["direction"][1] = 0.5 * turn, -0.5 * turn
        lit, shaded = (seen(renderer, world(tmp_path, {"lights": [lamp(kind, cast_shadows=casts, **values)]}, cube))
                       for casts in (False, True))
        # Through the middle of the cube at 0.3 m, and past it.
        assert at(shaded, 0.0, -0.21 * turn).sum() < 0.75 * at(lit, 0.0, -0.21 * turn).sum()
        for x, y in ((0.0, 0.3 * turn), (0.5, -0.2 * turn), (0.0, -0.75 * turn)):
            assert at(shaded, x, y) == pytest.approx(at(lit, x, y), abs=2)


def test_a_lamp_in_a_link_moves_with_it(renderer, tmp_path):
    bulb = {**lamp("point", diffuse=[0.0, 0.0, 1.0], place=[0.0, 0.0, 0.3], attenuation=[1, 0, 4.0]), "link": "link"}
    cube = {"name": "cube", "urdf": CUBE, "joints": [], "lights": [bulb]}
    mirror = world(tmp_path, {"lights": [], "ambient": [0.1] * 3}, (cube, [0.0, 0.5, 0.2, *UPRIGHT]))
    # Upside down, the lamp is below its cube.
    for pose, y in (([0.0, 0.5, 0.7, 1, 0, 0, 0], 0.4), ([0.0, -0.5, 0.7, 1, 0, 0, 0], -0.4)):
        mirror.set_state(np.concatenate([[0, 0, 0, *UPRIGHT], pose]))
        picture = seen(renderer, mirror)
        assert at(picture, 0.0, y)[2] > at(picture, 0.0, -y)[2] + 40
    assert mirror.light.lamps[0].place == pytest.approx((0.0, -0.5, 0.4))


def test_only_the_strongest_lamps_have_shadow_maps():
    lamps = [lamp("point", diffuse=[value] * 3, cast_shadows=casts)
             for value, casts in ((0.2, True), (0.9, False), (0.5, True), (0.4, True))]
    assert [made.shadow for made in SceneLight.of_scene({"lights": lamps}).lamps] == [None, None, 0, 1]
    assert not any(made.kind[1] for made in SceneLight.of_scene({"lights": lamps, "shadows": False}).lamps)


def test_glossy_things_have_a_highlight_where_the_mirror_image_of_the_lamp_is(renderer, tmp_path):
    ball = {"name": "ball", "urdf": BALL, "joints": []}, [0, 0, 0.2, *UPRIGHT]
    lights = [[lamp("directional", direction=(0.0, -1.0, -1.0), specular=[value] * 3)] for value in (0.0, 0.3)]
    without, with_it = (seen(renderer, world(tmp_path, {"lights": light, "ambient": [0.1] * 3}, ball)).sum(axis=2)
                        for light in lights)
    row, column = np.unravel_index((with_it - without).argmax(), without.shape)
    # On a ball of 0.4 m, 22.5 degrees towards the light from the top.
    y = 0.4 * np.sin(np.pi / 8)
    depth = 1.8 - 0.4 * np.cos(np.pi / 8)
    assert row == pytest.approx(99.5, abs=4) and column == pytest.approx(99.5 - PINHOLE.fx * y / depth, abs=4)
    assert (with_it - without).max() > 15


def test_black_glossy_things_show_their_shape_by_what_they_mirror(renderer, tmp_path):
    level = pose_matrix((-2.0, 0.0, 0.6), (0.0, 0.0, 0.0)) @ OPTICAL

    def column(gloss, ambient):
        """Of a black ball of 0.4 m, from top to bottom in its middle."""
        urdf = BALL.replace("0.9 0.9 0.9 1", "0 0 0 1").replace("</material>", '<gloss value="%s"/></material>' % gloss)
        ball = {"name": "ball", "urdf": urdf, "joints": []}, [0, 0, 0.6, *UPRIGHT]
        picture = seen(renderer, world(tmp_path, {"lights": [], "ambient": [ambient] * 3}, ball), level)
        return picture[68:132, 100, 0]

    glossy = column(0.3, 0.4)
    assert glossy[0] > 1.5 * glossy.min() and glossy[:10].mean() > glossy[20:40].mean() + 5, "no edge is seen"
    assert glossy[16] > glossy[-16] + 2, "the sky is brighter than the floor"
    assert glossy.max() < 60, "it is still black"
    assert not column(0.0, 0.4).any() and not column(0.3, 0.0).any()


def test_the_sky_is_bright_at_the_horizon_and_blue_above(renderer, tmp_path):
    level = pose_matrix((0.0, 0.0, 2.0), (0.0, -0.4, 0.0)) @ OPTICAL
    picture = seen(renderer, world(tmp_path, {}), level)
    red, blue = picture[..., 0].mean(axis=1), picture[..., 2].mean(axis=1)
    assert (np.diff(red[:185]) >= -0.5).all(), "darker further up"
    assert blue[0] - red[0] > blue[180] - red[180] + 20
    given = {"background": [0.2, 0.3, 0.2]}
    assert (seen(renderer, world(tmp_path, given), level)[50] == (51, 76, 51)).all()
    assert np.ptp(seen(renderer, world(tmp_path, {**given, "sky": True}), level)[:, 0], axis=0).max() > 20


def test_far_tiles_of_the_floor_are_one_grey(renderer, tmp_path):
    level = pose_matrix((0.0, 0.0, 2.0), (0.0, 0.15, 0.0)) @ OPTICAL
    row = seen(renderer, world(tmp_path, {}), level)[72]  # about 40 m away
    assert np.ptp(row, axis=0).max() <= 3


def test_a_still_has_smoother_edges(renderer, tmp_path):
    cube = {"name": "cube", "urdf": CUBE, "joints": []}, [0, 0, 0.3, 0, 0, 0.131, 0.991]
    mirror = world(tmp_path, {"ambient": [1.0] * 3, "lights": []}, cube)
    still = GlRenderer(still=True)
    shades = [len(np.unique(drawn.render(mirror, PINHOLE, ABOVE)[0][60:140, 60:140].reshape(-1, 3), axis=0))
              for drawn in (renderer, still)]
    still.close()
    assert shades[1] >= shades[0] + 3, "pixels at the edge are between cube and floor"


def test_the_map_is_drawn_again_when_something_has_moved_by_more_than_it_shows(renderer, tmp_path):
    cube = {"name": "cube", "urdf": CUBE, "joints": []}, np.array([0, 0, 0.3, *UPRIGHT])
    mirror = world(tmp_path, {}, cube)
    seen(renderer, mirror)
    drawn = []
    inner = renderer._shadows._draw_from
    renderer._shadows._draw_from = lambda *arguments: drawn.append(inner(*arguments))
    for away, count in ((1e-5, 0), (0.0, 0), (0.02, 1)):
        mirror.set_state(np.concatenate([[0, 0, 0, *UPRIGHT], cube[1] + [away, 0, 0, 0, 0, 0, 0]]))
        seen(renderer, mirror)
        assert len(drawn) == count


def test_the_shaded_part_of_the_floor_is_where_the_light_meets_it():
    corners = np.array([(-1.0, -1.0, 2.0), (1.0, -1.0, 2.0), (1.0, 1.0, 2.0), (-1.0, 1.0, 2.0)])
    floor = pose_matrix((0.0, 0.0, 0.5), (0.0, 0.0, 0.0))
    away = np.array((0.6, 0.0, 0.8))
    assert on_floor(floor, corners, away)[:, 0] == pytest.approx(np.array((-1.0, 1.0, 1.0, -1.0)) - 1.5 * 0.75)
    assert on_floor(floor, corners, away)[:, 1] == pytest.approx(corners[:, 1])
    assert on_floor(floor, corners, np.array((1.0, 0.0, 0.05))) is None


def test_strange_lights_do_no_harm():
    nowhere = lamp("directional", direction=[0, 0, 0], cast_shadows=True)
    many = [lamp("point") for _ in range(MAX_LAMPS + 5)]
    light = SceneLight.of_scene({"lights": [nowhere, *many, lamp("spot", spot=None)]})
    assert light.sun == (0.0, 0.0, 0.0) and len(light.lamps) == MAX_LAMPS
    assert np.isfinite(light.to_sun).all()
    first, second = lamp("directional"), lamp("directional", diffuse=[1, 0, 0], cast_shadows=True)
    light = SceneLight.of_scene({"lights": [first, second]})
    assert light.sun[1] == 0.0 and len(light.lamps) == 1, "the sun is the one that casts shadows"


def test_a_screen_shows_its_picture_the_right_way_round(renderer, tmp_path):
    pictures = PictureWriter(tmp_path / "screen", 100, 50)
    # Its face up, its right towards -y, so that this camera sees it upright.
    place = np.array([[0, 1, 0, 0.0], [-1, 0, 0, 0.0], [0, 0, 1, 0.02], [0, 0, 0, 1]])
    body = {"name": "sheet", "urdf": SHEET, "joints": [], "screens": [
        {"link": "link", "offset": place.ravel().tolist(), "size": [0.8, 0.4], "picture": str(pictures.path)}]}
    mirror = world(tmp_path, {}, (body, [0, 0, 0.5, *UPRIGHT]))
    black = seen(renderer, mirror)
    assert (black[90:110, 60:140] == 0).all()

    pixels = np.zeros((50, 100, 3), dtype=np.uint8)
    pixels[:25, :50], pixels[:25, 50:], pixels[25:, :50] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    pictures.show(pixels)
    shown = seen(renderer, mirror)
    for row, column, colour in ((85, 80, (255, 0, 0)), (85, 120, (0, 255, 0)), (115, 80, (0, 0, 255)),
                                (115, 120, (0, 0, 0))):
        assert shown[row, column] == pytest.approx(colour, abs=2)
    # 0.8 m wide at 1.48 m below the camera.
    width = (shown[85].max(axis=1) - shown[85].min(axis=1) > 200).sum()
    assert width == pytest.approx(0.8 / 1.48 * PINHOLE.fx, abs=2)

    below = pose_matrix((0.0, 0.0, 0.05), (0.0, -np.pi / 2, 0.0)) @ OPTICAL
    assert np.ptp(seen(renderer, mirror, below)[100, 100]) < 10, "nobody sees it from behind"
    pictures.close()
    mirror.set_scene([FLOOR], {})
    assert not mirror.bodies["floor"].screens


def test_a_light_covers_with_its_bright_pixels_alone(renderer, tmp_path):
    pictures = PictureWriter(tmp_path / "light", 100, 100)
    place = np.eye(4)
    place[2, 3] = 0.02
    light = {"link": "link", "offset": place.ravel().tolist(), "size": [0.8, 0.8], "picture": str(pictures.path)}
    body = {"name": "sheet", "urdf": SHEET, "joints": []}
    pose = [0, 0, 0.5, *UPRIGHT]
    bare = seen(renderer, world(tmp_path, {}, (body, pose)))
    mirror = world(tmp_path, {}, ({**body, "screens": [{**light, "glows": True}]}, pose))
    assert (seen(renderer, mirror) == bare).all(), "it is off"
    pixels = np.zeros((100, 100, 3), dtype=np.uint8)
    pixels[:50] = (255, 40, 0)
    pictures.show(pixels)
    shown = seen(renderer, mirror)
    changed = np.abs(shown - bare).max(axis=2) > 10
    assert 0.45 < changed.sum() / (0.8 / 1.48 * PINHOLE.fx) ** 2 < 0.55
    assert np.median(shown[changed], axis=0) == pytest.approx((255, 40, 0), abs=2)
    pictures.show(np.zeros_like(pixels))
    assert (seen(renderer, mirror) == bare).all(), "off again, without a new scene"
    pictures.close()


def test_a_screen_whose_picture_is_gone_is_left_out(tmp_path):
    said = []
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, said.append)
    mirror.set_scene([{"name": "sheet", "urdf": SHEET, "joints": [], "screens": [
        {"link": "link", "offset": np.eye(4).ravel().tolist(), "size": [1, 1], "picture": str(tmp_path / "gone")}]}])
    assert not mirror.bodies["sheet"].screens and "gone" in said[0]
