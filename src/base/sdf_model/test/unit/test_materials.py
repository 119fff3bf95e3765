# SPDX-License-Identifier: BSD-3-Clause
"""Materials of visuals, and material scripts beside models."""
import pytest

from sdf_model import ModelFolders, parse_sdf_model
from sdf_model.ogre_script import Material, parse_materials
from urdf_model import Finish, Mesh, Plane, drawing_urdf, merge_fixed, parse_urdf

SCRIPT = """
// materials of a model
material Box/Paper {
  technique { pass { ambient 0.2 0.2 0.2 1
      texture_unit { texture "paper side.png"
        scale 0.5 0.25 } } }
  technique { pass { diffuse 1 0 0 } }
}
material Box/Leaf : Box/Paper
{
  receive_shadows off
  technique
  {
    pass
    {
      diffuse 0.5 1 0.5 /* greener
      than the picture */
      emissive 0.1 0 0
      specular 0.3 0.2 0.1 1 20
      alpha_rejection greater 128
      cull_hardware none
      vertex_program_ref Any { }
    }
  }
}
material Box/Plain { technique { pass { ambient 0.1 0.2 0.3 diffuse 9 9 9 } pass { diffuse 0.4 0.5 0.6 } } }
"""


def model(material, base):
    text = """<sdf version="1.6"><model name="m"><link name="l"><visual name="v">
    <geometry><plane><size>2 1</size></plane></geometry><material>%s</material></visual></link></model>
    </sdf>""" % material
    return parse_sdf_model(text, "test", ModelFolders([base]), base)


def visual(material, base):
    shape, = model(material, base).robot.links["l"].visuals
    return shape


def script(name, *uris):
    return "<script>%s<name>%s</name></script>" % ("".join("<uri>%s</uri>" % uri for uri in uris), name)


@pytest.fixture
def box(tmp_path):
    """The folder of a model with a script and a picture."""
    for folder in ("scripts", "textures"):
        (tmp_path / "box" / "materials" / folder).mkdir(parents=True)
    (tmp_path / "box" / "materials" / "scripts" / "box.material").write_text(SCRIPT)
    (tmp_path / "box" / "materials" / "textures" / "paper side.png").write_bytes(b"")
    return tmp_path / "box"


def test_scripts_are_understood_as_far_as_a_picture_needs():
    found = parse_materials(SCRIPT)
    paper = Material((0.2, 0.2, 0.2), None, None, (0.0, 0.0, 0.0), "paper side.png", (2.0, 4.0))
    assert found["Box/Paper"] == paper
    assert found["Box/Leaf"] == Material((0.2, 0.2, 0.2), (0.5, 1.0, 0.5), (0.3, 0.2, 0.1), (0.1, 0.0, 0.0),
                                         "paper side.png", (2.0, 4.0), True, True)
    # An attribute ends with its line, so the diffuse colour in the first pass is not one.
    assert found["Box/Plain"].diffuse == (0.4, 0.5, 0.6) and found["Box/Plain"].ambient == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("text", [
    "", "}", "material", "material {", "{" * 50_000, "a {" * 50_000 + "}", '"', "/* " * 100_000,
    "material A { technique { pass { ambient x } } }",
    "material A { technique { pass { texture_unit { texture\nscale 0 0 } diffuse nan 0 0 } } }"])
def test_a_broken_script_says_nothing(text):
    assert all(found == Material() for found in parse_materials(text).values())


@pytest.mark.parametrize("uris", [
    ("model://box/materials/scripts", "model://box/materials/textures"), ("model://box/materials/scripts/box.material",),
    ("materials/scripts",), ("file://{folder}/materials/scripts/",)])
def test_a_picture_is_found_beside_its_script(box, uris, monkeypatch):
    base = box if uris[0].startswith("materials") else box.parent
    shape = visual(script("Box/Paper", *(uri.format(folder=box) for uri in uris)), base)
    texture = str(box / "materials" / "textures" / "paper side.png")
    assert shape.finish == Finish(texture=texture, repeats=(2.0, 4.0)) and shape.colour == (1.0, 1.0, 1.0, 1.0)


def test_a_picture_that_is_missing_is_named_where_it_should_be(box):
    (box / "materials" / "textures" / "paper side.png").unlink()
    shape = visual(script("Box/Leaf", "model://box/materials/scripts"), box.parent)
    assert shape.finish.texture == str(box / "materials" / "scripts" / "paper side.png")
    assert shape.finish == Finish((0.1, 0.0, 0.0), 0.3, shape.finish.texture, (2.0, 4.0), True, True)
    assert shape.colour == (0.5, 1.0, 0.5, 1.0)


def test_names_that_no_file_can_have_are_missing(box):
    long = "x" * 5000
    (box / "materials" / "scripts" / "box.material").write_text(SCRIPT.replace("paper side.png", long))
    assert visual(script("Box/Plain", long), box.parent).finish is None
    assert visual(script("Box/Paper", "model://box/materials/scripts"), box.parent).finish.texture.endswith(long)
    material = "<pbr><metal><albedo_map>%s</albedo_map></metal></pbr>" % long
    assert visual(material, box.parent).finish.texture.endswith(long)


def test_what_the_material_says_itself_comes_first(box):
    shape = visual(script("Box/Plain", "model://box/materials/scripts") + "<specular>0.1 0.2 0.1 1</specular>"
                   "<emissive>0 2 0 1</emissive><diffuse>0 0 1 1</diffuse>", box.parent)
    assert shape.colour == (0.0, 0.0, 1.0, 1.0) and shape.finish == Finish((0.0, 1.0, 0.0), 0.2)
    assert visual("<emissive>0 0 0 1</emissive>", box.parent).finish is None


@pytest.mark.parametrize("uri", ["textures/a.png", "model://box/textures/a.png", "file://{folder}/textures/a.png"])
def test_a_colour_map_of_newer_simulators_is_a_texture(tmp_path, uri):
    folder = tmp_path / "box"
    (folder / "textures").mkdir(parents=True)
    material = "<pbr><metal><albedo_map>%s</albedo_map></metal></pbr>" % uri.format(folder=folder)
    for _ in range(2):  # missing, then there
        shape = visual(material, tmp_path if uri.startswith("model") else folder)
        assert shape.finish == Finish(texture=str(folder / "textures" / "a.png")) and shape.colour is None
        (folder / "textures" / "a.png").write_bytes(b"")


def test_names_of_gazebos_materials_need_no_script(tmp_path):
    shape = visual(script("Gazebo/RedGlow", "file://media/materials/scripts/gazebo.material"), tmp_path)
    assert shape.colour == (1.0, 0.1, 0.1, 1.0) and shape.finish == Finish((1.0, 0.0, 0.0))
    unknown = visual(script("Other/Thing", "model://nowhere/materials/scripts"), tmp_path)
    assert unknown.colour is None and unknown.finish is None


def test_a_part_of_a_mesh_is_drawn_alone(box):
    text = """<sdf version="1.6"><model name="m"><link name="l"><visual name="v"><geometry><mesh><uri>a.dae</uri>
    <submesh><name>Leaf</name>%s</submesh></mesh></geometry></visual></link></model></sdf>"""
    for more, centred in (("", False), ("<center>true</center>", True)):
        read = parse_sdf_model(text % more, "test", ModelFolders([]), "/f")
        shape, = parse_urdf(drawing_urdf(merge_fixed(read.robot))).links["l"].visuals
        assert shape.geometry == Mesh("/f/a.dae", (1.0, 1.0, 1.0), "Leaf", centred) and not read.warning


def test_a_picture_on_a_plane_has_x_to_its_right(box):
    found = model(script("Box/Paper", "model://box/materials/scripts"), box.parent)
    assert isinstance(found.robot.links["l"].visuals[0].geometry, Plane)
    shape, = parse_urdf(drawing_urdf(merge_fixed(found.robot))).links["l"].visuals
    # On the top of a box, -y is to the right and x upwards.
    assert shape.geometry.size[:2] == (1.0, 2.0)
    assert shape.origin[:3, :3] @ (0, -1, 0) == pytest.approx([1, 0, 0])
    assert shape.origin[:3, :3] @ (1, 0, 0) == pytest.approx([0, 1, 0])
    assert shape.finish.repeats == (2.0, 4.0)
