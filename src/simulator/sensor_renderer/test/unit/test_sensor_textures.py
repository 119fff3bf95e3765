# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on surfaces, and surfaces that give off light."""
import numpy as np
import pytest
from PIL import Image

from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.textures import Textures
from sensor_renderer.tiny_renderer import TinyRenderer
from sensor_renderer.triangles import of_primitive, uv_on_primitive
from urdf_model import Cylinder, Sphere
from urdf_model.transforms import pose_matrix
from world_picture.drawing import DrawingCache

UPRIGHT = [0, 0, 0, 0, 0, 0, 1]
PINHOLE = Pinhole.from_field_of_view(120, 120, 1.0, 0.05, 20.0)
EVEN = {"lights": [], "ambient": [0.6, 0.6, 0.6], "background": [0, 0, 0]}
DARK = {"lights": [], "ambient": [0, 0, 0], "background": [0, 0, 0]}
RED, GREEN, BLUE, YELLOW = (220, 20, 20), (20, 220, 20), (20, 20, 220), (220, 220, 20)
QUARTERS = {"upper left": RED, "upper right": GREEN, "lower left": BLUE, "lower right": YELLOW}


@pytest.fixture(params=[False, True], ids=["live", "still"])
def renderer(request):
    made = GlRenderer(still=request.param)
    yield made
    made.close()


@pytest.fixture
def quarters(tmp_path):
    """A picture file with one colour in each quarter."""
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:32, :32], pixels[:32, 32:], pixels[32:, :32], pixels[32:, 32:] = QUARTERS.values()
    path = tmp_path / "quarters.png"
    Image.fromarray(pixels).save(path)
    return path


def robot(shape, material=""):
    return ('<robot name="r"><link name="link"><visual><geometry>%s</geometry><material name="m">%s</material></visual>'
            "</link></robot>" % (shape, material))


def world(tmp_path, urdf, light=EVEN, warn=pytest.fail):
    mirror = Mirror(DrawingCache(tmp_path / "cache"), lambda name: name.replace("file://", ""), warn)
    mirror.set_scene([{"name": "thing", "urdf": urdf, "joints": []}], light)
    mirror.set_state(np.array(UPRIGHT, dtype=float))
    return mirror


def looking(x=0.0, y=0.0, z=0.0):
    """Optical pose at (x, y, z), which looks at the origin; upwards is z, or x for a view along z."""
    place = np.array([x, y, z])
    forward = -place / np.linalg.norm(place)
    down = np.array([-1.0, 0, 0]) if abs(forward[2]) > 0.9 else np.array([0, 0, -1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(down, forward), down, forward])
    pose[:3, 3] = place
    return pose


def colours(picture, half=20):
    """The colours (name of the quarter -> rgb) around the middle of the picture, and their brightness taken out."""
    middle = picture.shape[0] // 2
    low, high = middle - half // 2, middle + half // 2
    found = {"upper left": picture[low, low], "upper right": picture[low, high],
             "lower left": picture[high, low], "lower right": picture[high, high]}
    return {place: pixel / max(pixel.max(), 1) for place, pixel in found.items()}


def shows_quarters(picture, quarters=QUARTERS):
    return all(np.allclose(colours(picture)[place], np.array(colour) / 220, atol=0.1)
               for place, colour in quarters.items())


def turned(quarters, order):
    """The quarters as they are seen when the picture is turned: the places of ``order`` in the order of QUARTERS."""
    return dict(zip(QUARTERS, (quarters[place] for place in order), strict=True))


HALF_TURN = turned(QUARTERS, ("lower right", "lower left", "upper right", "upper left"))


def wavefront(tmp_path, material="map_Kd quarters.png\n"):
    """A square of 1 m in the plane y, z, which is seen from -x: its picture's right is -y and its top is +z."""
    (tmp_path / "square.mtl").write_text("newmtl paper\n" + material)
    (tmp_path / "square.obj").write_text(
        "mtllib square.mtl\nv 0 0.5 -0.5\nv 0 -0.5 -0.5\nv 0 -0.5 0.5\nv 0 0.5 0.5\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paper\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    return robot('<mesh filename="%s"/>' % (tmp_path / "square.obj"))


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>quarters.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="x"><phong>EMISSION<diffuse>DIFFUSE</diffuse></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0.5 -0.5 0 -0.5 -0.5 0 -0.5 0.5 0 0.5 0.5</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array>
<technique_common><accessor source="#ua" count="4" stride="2"><param name="S" type="float"/>
<param name="T" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2" material="k"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 1 1 2 2 0 0 2 2 3 3</p></triangles></mesh></geometry>
</library_geometries>
<library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="k" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def collada(tmp_path, diffuse='<texture texture="t" texcoord="u"/>', emission=""):
    folder = tmp_path / "meshes"
    folder.mkdir(exist_ok=True)
    emission = emission and "<emission><color>%s 1</color></emission>" % emission
    (folder / "square.dae").write_text(COLLADA.replace("DIFFUSE", diffuse).replace("EMISSION", emission))
    return robot('<mesh filename="%s"/>' % (folder / "square.dae"))


def test_a_mesh_shows_the_picture_that_its_file_names(renderer, tmp_path, quarters):
    picture, depth = renderer.render(world(tmp_path, wavefront(tmp_path)), PINHOLE, looking(x=-1.2), depth=True)
    assert shows_quarters(picture) and depth[60, 60] == pytest.approx(1.2, abs=1e-3)
    # A sheet is seen from its front, unless it says otherwise; from behind as through glass.
    assert renderer.render(world(tmp_path, wavefront(tmp_path)), PINHOLE, looking(x=1.2))[0].max() == 0
    sheet = robot('<mesh filename="%s"/>' % (tmp_path / "square.obj"),
                  '<texture filename="%s" two_sided="true"/>' % quarters)
    mirrored = turned(QUARTERS, ("upper right", "upper left", "lower right", "lower left"))
    assert shows_quarters(renderer.render(world(tmp_path, sheet), PINHOLE, looking(x=1.2))[0], mirrored)
    # Mirrored by its scale, it is seen from the side on which it is.
    turned_over = robot('<mesh filename="%s" scale="1 -1 1"/>' % (tmp_path / "square.obj"))
    assert shows_quarters(renderer.render(world(tmp_path, turned_over), PINHOLE, looking(x=-1.2))[0], mirrored)


def test_pictures_of_collada_are_where_gazebo_looks_for_them(renderer, tmp_path, quarters):
    urdf = collada(tmp_path)
    for folder in (tmp_path / "meshes", tmp_path / "materials" / "textures"):
        folder.mkdir(parents=True, exist_ok=True)
        place = quarters.replace(folder / quarters.name)
        assert shows_quarters(renderer.render(world(tmp_path, urdf), PINHOLE, looking(x=-1.2))[0])
        quarters = place


BOX = ('<visual><origin xyz="%g 0 0"/><geometry><box size="%s"/></geometry><material name="%s"><color rgba="%s"/>'
       "</material></visual>")


def glass(opacity, size="0.01 1 1"):
    """A red pane of a box at the origin, across x; a green box behind it, at negative x."""
    return '<robot name="r"><link name="link">%s%s</link></robot>' % (
        BOX % (0, size, "m", "1 0 0 %g" % opacity), BOX % (-1, "0.1 9 9", "n", "0 1 0 1"))


@pytest.mark.parametrize("opacity", [0.75, 0.5, 0.25, 0.0])
def test_a_pane_covers_what_is_behind_it_by_its_opacity(renderer, tmp_path, opacity):
    (covered, near), (seen, far), (picture, depth) = (
        renderer.render(world(tmp_path, text), PINHOLE, looking(x=1.2), depth=True)
        for text in (glass(1.0), glass(1.0, "0.01 0.001 0.001"), glass(opacity)))
    covered, seen = (pixels[50, 50].astype(float) for pixels in (covered, seen))
    assert covered[0] > 50 and seen[1] > 50
    np.testing.assert_allclose(picture[50, 50], opacity * covered + (1.0 - opacity) * seen, atol=2)
    assert depth[50, 50] == pytest.approx((near if opacity else far)[50, 50], abs=1e-3)


def test_panes_and_the_sky_behind_them_are_seen_through_each_other(renderer, tmp_path):
    """Blended from far to near, whatever their order; in front of nothing, the background shines through."""
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
    light = {**EVEN, "background": [0, 0, 1]}
    for near, far in (("a", "b"), ("b", "a")):
        panes = {near: BOX % (0.5, "0.01 9 9", near, "1 0 0 0.5"), far: BOX % (-0.5, "0.01 9 9", far, "0 1 0 0.5")}
        urdf = '<robot name="r"><link name="a">%s</link><link name="b">%s</link>%s</robot>' % (
            panes["a"], panes["b"], joint)
        mirror = Mirror(DrawingCache(tmp_path / "cache"), str, pytest.fail)
        mirror.set_scene([{"name": "thing", "urdf": urdf, "joints": ["j"]}], light)
        mirror.set_state(np.array([*UPRIGHT, 0.0], dtype=float))
        red, green, blue = renderer.render(mirror, PINHOLE, looking(x=1.2))[0][60, 60].astype(float)
        assert red / green == pytest.approx(2.0, abs=0.1) and blue == pytest.approx(255 / 4, abs=3)


def test_a_pane_casts_no_shadow(renderer, tmp_path):
    light = {"ambient": [0.2, 0.2, 0.2], "background": [0, 0, 0], "shadows": True, "lights": [
        {"name": "sun", "type": "directional", "cast_shadows": True, "diffuse": [1, 1, 1], "specular": [0, 0, 0],
         "direction": [-1.0, 0.0, -0.001], "place": [0, 0, 10]}]}
    behind = {}
    for opacity in (1.0, 0.5):
        pose = looking(x=1.0)
        pose[0, 3] = -0.2
        behind[opacity] = int(renderer.render(world(tmp_path, glass(opacity), light), PINHOLE, pose)[0][60, 60, 1])
    assert behind[0.5] > 1.5 * behind[1.0] > 0


def test_a_mesh_may_name_the_picture_of_another_model(renderer, tmp_path, quarters):
    urdf = collada(tmp_path)
    path = tmp_path / "meshes" / "square.dae"
    path.write_text(path.read_text().replace(quarters.name, "model://other/materials/textures/a.png"))
    mirror = Mirror(DrawingCache(tmp_path / "cache"), lambda name: (
        str(quarters) if name.startswith("model://other/") else name.replace("file://", "")), pytest.fail)
    mirror.set_scene([{"name": "thing", "urdf": urdf, "joints": []}], EVEN)
    mirror.set_state(np.array(UPRIGHT, dtype=float))
    assert shows_quarters(renderer.render(mirror, PINHOLE, looking(x=-1.2))[0])


def test_a_part_of_a_mesh_is_shown_alone(renderer, tmp_path, quarters):
    urdf = collada(tmp_path)
    path = tmp_path / "meshes" / "square.dae"
    quarters.replace(path.parent / quarters.name)
    text = path.read_text()
    node = text[text.index("<node>"):text.index("</node>") + 7]
    beside = node.replace("<node>", '<node name="beside"><translate>0 5 0</translate>')
    path.write_text(text.replace(node, node.replace("<node>", '<node name="here">') + beside))
    for name, shown in (("here", True), ("beside", False)):
        part = urdf.replace("<mesh ", '<mesh submesh="%s" ' % name)
        picture, _ = renderer.render(world(tmp_path, part), PINHOLE, looking(x=-1.2))
        assert shows_quarters(picture) if shown else picture.max() == 0


def test_every_side_of_a_box_shows_the_picture_upright(renderer, tmp_path, quarters):
    """The top has the picture's upper edge at +x; so has the bottom, seen from below, at -x."""
    urdf = robot('<box size="1 1 1"/>', '<texture filename="%s"/>' % quarters)
    mirror = world(tmp_path, urdf)
    for place in ({"x": 1.8}, {"x": -1.8}, {"y": 1.8}, {"y": -1.8}, {"z": 1.8}):
        assert shows_quarters(renderer.render(mirror, PINHOLE, looking(**place))[0]), place
    # This view has +x at its upper edge.
    assert shows_quarters(renderer.render(mirror, PINHOLE, looking(z=-1.8))[0], HALF_TURN)


def test_round_bodies_show_it_once_around(renderer, tmp_path, quarters):
    material = '<texture filename="%s"/>' % quarters
    for shape in ('<cylinder radius="0.5" length="1"/>', '<sphere radius="0.5"/>'):
        mirror = world(tmp_path, robot(shape, material))
        middle = [renderer.render(mirror, PINHOLE, looking(**place))[0][50, 60].astype(int)
                  for place in ({"x": 1.8}, {"x": -1.8})]
        # Of a cylinder the upper half is seen, of a sphere, whose poles are at y, a half of both rows.
        assert np.abs(middle[0] - middle[1]).max() > 60, shape


@pytest.mark.parametrize("geometry", [Sphere(0.045), Sphere(1.0), Sphere(0.3), Cylinder(0.1, 0.3)])
def test_places_on_round_bodies_are_in_the_picture(geometry):
    uv = uv_on_primitive(geometry, of_primitive(geometry)).reshape(-1, 3, 2)
    assert np.isfinite(uv).all() and -1e-6 <= uv[..., 1].min() and uv[..., 1].max() <= 1.0 + 1e-6
    assert np.ptp(uv[..., 0], axis=1).max() <= 0.5, "no triangle goes around the back"


def test_colours_are_those_of_the_picture_times_the_light(renderer, tmp_path, quarters):
    """Under ambient light alone, at a height where the floor takes none: 0.6 * (1.1 + 0.3 n_z) of the picture."""
    urdf = robot('<box size="0.02 1 1"/>', '<color rgba="1 0.5 1 1"/><texture filename="%s"/>' % quarters)
    mirror = world(tmp_path, urdf)
    mirror.set_state(np.array([0, 0, 5.0, 0, 0, 0, 1]))
    pose = looking(x=-1.2)
    pose[2, 3] = 5.0
    picture, _ = renderer.render(mirror, PINHOLE, pose)
    assert picture[50, 50] == pytest.approx(0.66 * np.array(RED) * (1, 0.5, 1), abs=2)
    assert picture[50, 70] == pytest.approx(0.66 * np.array(GREEN) * (1, 0.5, 1), abs=2)


def test_far_pictures_are_even(renderer, tmp_path):
    """A chequered picture of single pixels is grey from afar, without noise."""
    chequered = np.indices((256, 256)).sum(axis=0) % 2 * 255
    Image.fromarray(chequered.astype(np.uint8)).save(tmp_path / "chequered.png")
    urdf = robot('<box size="0.02 1 1"/>', '<texture filename="%s"/>' % (tmp_path / "chequered.png"))
    picture, _ = renderer.render(world(tmp_path, urdf), PINHOLE, looking(x=-3.0))
    patch = picture[50:70, 50:70, 0].astype(float)
    assert patch.std(axis=1).max() < 2 and 70 < patch.mean() < 100


def test_a_missing_picture_is_one_warning_and_one_colour(renderer, tmp_path):
    said, urdf = [], collada(tmp_path)
    visual = urdf[urdf.index("<visual>"):urdf.index("</link>")]
    urdf = urdf.replace(visual, 2 * visual)
    picture, _ = renderer.render(world(tmp_path, urdf, warn=said.append), PINHOLE, looking(x=-1.2))
    assert len(said) == 1 and "quarters.png does not exist" in said[0]
    assert len({tuple(pixel) for pixel in colours(picture).values()}) == 1 and picture[60, 60].min() > 50
    (tmp_path / "meshes" / "quarters.png").write_text("no picture")
    said.clear()
    renderer.render(world(tmp_path, urdf, warn=said.append), PINHOLE, looking(x=-1.2))
    assert len(said) == 1 and "it is no picture" in said[0]


def test_a_glowing_block_is_bright_in_the_dark(renderer, tmp_path):
    colour = '<color rgba="0.2 0.2 0.2 1"/>'
    dark, _ = renderer.render(world(tmp_path, robot('<box size="1 1 1"/>', colour), DARK), PINHOLE, looking(x=-1.8))
    assert dark.max() == 0
    urdf = robot('<box size="1 1 1"/>', colour + '<emission rgb="0.7 0.1 0"/>')
    glowing, _ = renderer.render(world(tmp_path, urdf, DARK), PINHOLE, looking(x=-1.8))
    assert glowing[60, 60] == pytest.approx((178, 26, 0), abs=2)


def test_collada_glows_but_where_it_repeats_its_colour(renderer, tmp_path, quarters):
    def middle(*arguments):
        mirror = world(tmp_path, collada(tmp_path, *arguments), DARK)
        return renderer.render(mirror, PINHOLE, looking(x=-1.2))[0][60, 60]

    assert middle("<color>0.2 0.2 0.2 1</color>", "0 0.6 0") == pytest.approx((0, 153, 0), abs=2)
    assert middle("<color>0.8 0.4 0.2 1</color>", "0.8 0.4 0.2").max() == 0
    quarters.replace(tmp_path / "meshes" / "quarters.png")
    urdf = collada(tmp_path, emission="1 1 1")
    picture, _ = renderer.render(world(tmp_path, urdf, DARK), PINHOLE, looking(x=-1.2))
    assert picture[50, 50].max() > 190 and shows_quarters(picture)


@pytest.mark.parametrize(("emission", "seen"), [
    ("Ke 0 0.6 0", (0, 153, 0)), ("Ke much", (0, 0, 0)), ("Ke 1", (0, 0, 0)), ("Ke nan 0 0", (0, 0, 0))])
def test_wavefront_glows(renderer, tmp_path, emission, seen):
    mirror = world(tmp_path, wavefront(tmp_path, "Kd 0.2 0.2 0.2\n" + emission), DARK)
    assert renderer.render(mirror, PINHOLE, looking(x=-1.2))[0][60, 60] == pytest.approx(seen, abs=2)


def test_only_pictures_that_say_so_have_holes(renderer, tmp_path):
    pixels = np.full((64, 64, 4), 255, dtype=np.uint8)
    pixels[:, :32, 3] = 0
    Image.fromarray(pixels).save(tmp_path / "half.png")
    wavefront(tmp_path, "")
    for cut_out, seen in (("true", 0), ("false", 100)):
        urdf = robot('<mesh filename="%s"/>' % (tmp_path / "square.obj"),
                     '<texture filename="%s" cut_out="%s"/>' % (tmp_path / "half.png", cut_out))
        mirror = world(tmp_path, urdf)
        picture, _ = renderer.render(mirror, PINHOLE, looking(x=-1.2))
        assert picture[60, 70].max() > 100 and (picture[60, 50].max() > 100) == bool(seen)
        # Depth and masks have no holes.
        assert renderer.render(mirror, PINHOLE, looking(x=-1.2), colour=False, depth=True)[1][60, 50] < 1.3
        assert renderer.identify(mirror, PINHOLE, looking(x=-1.2))[0][60, 50] == 1


def test_edges_in_a_bright_picture_stay_where_they_are(renderer, tmp_path):
    """Halfway between black and white it is half as bright as the white: tags in the sun are not measured too small."""
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:, 32:] = 255
    Image.fromarray(pixels).save(tmp_path / "edge.png")
    mirror = world(tmp_path, wavefront(tmp_path, "map_Kd edge.png\n"), {**EVEN, "ambient": [1.6, 1.6, 1.6]})
    row = renderer.render(mirror, PINHOLE, looking(x=-1.2))[0][60, :, 0].astype(float)
    assert row[80] > 220 and row[40] == 0
    assert (row[59] + row[60]) / 2.0 == pytest.approx(row[80] / 2.0, abs=4)


def test_shadows_are_right_on_what_comes_into_view_later(renderer, tmp_path, quarters):
    """The map of a lamp is drawn once, here before there is a program for pictures."""
    lamp = {"type": "spot", "place": [-0.6, 0, 1.5], "direction": [0.4, 0, -1], "diffuse": [1, 1, 1],
            "attenuation": [1, 0, 0], "range": 10.0, "spot": [1.2, 1.4, 1.0], "cast_shadows": True}
    urdf = wavefront(tmp_path).replace("<geometry>", '<origin rpy="0 %.6f 0"/><geometry>' % (np.pi / 2), 1).replace(
        "</link>", '<visual><origin xyz="0 0 0.5"/><geometry><box size="0.3 0.3 0.1"/></geometry></visual></link>')
    mirror = world(tmp_path, urdf, {**EVEN, "lights": [lamp]})
    away, towards = pose_matrix((0, 0, 2), (0, -np.pi / 2, 0)) @ OPTICAL, looking(z=2.0)
    pictures = [renderer.render(mirror, PINHOLE, pose)[0] for pose in (towards, away, towards)]
    other = GlRenderer(still=renderer._programs._per_pixel)
    other.render(mirror, PINHOLE, away)
    pictures.append(other.render(mirror, PINHOLE, towards)[0])
    other.close()
    assert (pictures[0] == pictures[2]).all() and (pictures[0] == pictures[3]).all()
    shaded, lit = (pictures[0][row, 50].max() for row in (36, 84))
    assert shaded < 0.9 * lit, "below the picture's middle is -x, where the lamp is"


def test_without_opengl_a_picture_is_its_mean_colour(tmp_path, quarters):
    made = TinyRenderer()
    picture, _ = made.render(world(tmp_path, wavefront(tmp_path)), PINHOLE, looking(x=-1.2))
    made.close()
    seen = picture[60, 60] / picture[60, 60].max()
    assert seen == pytest.approx(np.array([120, 120, 70]) / 120, abs=0.05)


def test_without_pictures_there_is_no_program_for_them(renderer, tmp_path):
    renderer.render(world(tmp_path, robot('<box size="1 1 1"/>')), PINHOLE, looking(x=-1.8))
    assert renderer._programs._textured is None


def test_pictures_take_bounded_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("sensor_renderer.textures.MAX_PIXELS", 70_000)
    for number in range(3):
        Image.new("RGB", (256, 256), (number, 0, 0)).save(tmp_path / ("%d.png" % number))
    made = GlRenderer()
    textures = Textures(made._context)
    sizes = [textures.of(str(tmp_path / ("%d.png" % number))).size for number in range(3)]
    assert sizes == [(256, 256), (64, 64), (64, 64)]
    textures.clear()
    assert textures.of(str(tmp_path / "2.png")).size == (256, 256)
    made.close()
