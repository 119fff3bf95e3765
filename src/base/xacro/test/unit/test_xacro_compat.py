# SPDX-License-Identifier: BSD-3-Clause
"""Every way to call xacro expands files alike and finds packages through ROS_PACKAGE_PATH."""
import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2]
ROBOT = """<robot name="probe" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="colour" default="red"/>
  <link name="$(arg colour)"/>
  <note path="$(find probe_description)" twice="${2 * 21}"/>
  <xacro:include filename="$(find probe_description)/urdf/part.xacro"/>
</robot>
"""
PART = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="part"/></robot>\n'
MANIFEST = """<package format="3"><name>probe_description</name><version>0.0.0</version><description/>
<maintainer email="a@b.c">a</maintainer><license>BSD</license></package>
"""
# The engine as a console script of a virtual environment calls it.
PIP_COMMAND = [sys.executable, "-c", "import sys; sys.argv[0] = 'xacro'; from xacro import main; main()"]
COMMANDS = {"xacro": [sys.executable, str(PACKAGE / "xacro")], "xacro.py": [sys.executable, str(PACKAGE / "xacro.py")],
            "pip": PIP_COMMAND}


@pytest.fixture
def probe(tmp_path):
    """Folder of a ROS package outside the workspace, with urdf/probe.urdf.xacro in it."""
    folder = tmp_path / "probe_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "package.xml").write_text(MANIFEST)
    (folder / "urdf" / "probe.urdf.xacro").write_text(ROBOT)
    (folder / "urdf" / "part.xacro").write_text(PART)
    return folder


def run(command, *arguments, path, cwd="/"):
    environment = dict(os.environ, ROS_PACKAGE_PATH=str(path), PYTHONPATH=str(PACKAGE / "src"))
    return subprocess.run([*command, *map(str, arguments)], env=environment, cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_command_finds_packages_and_takes_arguments(command, probe):
    done = run(command, "--inorder", probe / "urdf" / "probe.urdf.xacro", "colour:=blue", path=probe.parent)
    assert done.returncode == 0, done.stderr
    assert "in-order" not in done.stderr
    assert '<link name="blue"/>' in done.stdout
    assert '<note path="%s" twice="42"/>' % probe in done.stdout
    assert '<link name="part"/>' in done.stdout


def test_output_file_and_dependencies(probe):
    source = probe / "urdf" / "probe.urdf.xacro"
    assert run(COMMANDS["xacro"], "-q", "-o", "out.urdf", source, path=probe.parent, cwd=probe).returncode == 0
    assert '<link name="red"/>' in (probe / "out.urdf").read_text()
    assert run(COMMANDS["xacro"], "--deps", source, path=probe.parent).stdout == str(probe / "urdf" / "part.xacro")


def test_module_offers_the_engine(probe):
    code = ("import sys, xacro; import xacro.substitution_args; "
            "print(xacro.process_file(sys.argv[1], mappings={'colour': 'blue'}).documentElement.toxml())")
    done = run([sys.executable, "-c", code], probe / "urdf" / "probe.urdf.xacro", path=probe.parent)
    assert '<link name="blue"/>' in done.stdout, done.stderr


def test_a_device_and_a_silent_pipe_are_no_files(tmp_path, probe):
    done = run(COMMANDS["xacro"], "/dev/zero", path=tmp_path)
    assert done.returncode == 2 and "/dev/zero is a device; a file is expected" in done.stderr
    os.mkfifo(tmp_path / "pipe")
    code = "import xacro; xacro.PIPE_WAIT_S = 0.2; print(xacro.process_file(%r).toxml())" % str(tmp_path / "pipe")
    # The engine's module has taken the place of ours, whose global it is.
    code = code.replace("xacro.PIPE_WAIT_S", "xacro.parse.__globals__['PIPE_WAIT_S']")
    silent = run([sys.executable, "-c", code], path=tmp_path)
    assert "a named pipe into which nobody has written for 0.2 s" in silent.stderr
    with subprocess.Popen(["cp", str(probe / "urdf" / "part.xacro"), str(tmp_path / "pipe")]):
        assert '<link name="part"/>' in run([sys.executable, "-c", code.replace("0.2", "60")], path=tmp_path).stdout


def test_unknown_package_names_package_search_path_and_file(probe):
    source = probe / "urdf" / "probe.urdf.xacro"
    done = run(COMMANDS["xacro"], source, path="/nonexistent")
    assert done.returncode == 2
    assert "probe_description" in done.stderr and "/nonexistent" in done.stderr and str(source) in done.stderr


def test_broken_xml_names_the_included_file(probe):
    (probe / "urdf" / "part.xacro").write_text("<robot><link></robot>")
    done = run(COMMANDS["xacro"], probe / "urdf" / "probe.urdf.xacro", path=probe.parent)
    assert done.returncode == 2
    assert "mismatched tag" in done.stderr and "part.xacro" in done.stderr


def test_missing_engine_is_said_with_the_way_to_install_it(tmp_path):
    code = "import sys; sys.path.append(%r); import xacro" % str(PACKAGE / "src")
    done = run([sys.executable, "-I", "-S", "-c", code], path=tmp_path)
    assert "xacro engine is not installed" in done.stderr and "pip install xacro" in done.stderr


def test_a_macro_called_without_prefix_is_called_and_said_once_with_its_lines(probe):
    source = probe / "urdf" / "probe.urdf.xacro"
    source.write_text("""<robot name="probe" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="wheel" params="name"><link name="${name}"/></xacro:macro>
<xacro:macro name="inertial"><inertial/></xacro:macro>
<wheel name="left"/>
<xacro:wheel name="right"/>
<link name="base"><inertial/></link>
<wheel
  name="rear"/>
</robot>""")
    done = run(COMMANDS["xacro"], source, path=probe.parent)
    assert done.returncode == 0
    for word in ('"left"', '"right"', '"rear"', "<inertial/>"):
        assert word in done.stdout
    assert "wheel" not in done.stdout
    assert done.stderr.count("<xacro:wheel>") == 1
    assert "(%s line 4, 7)" % source in done.stderr and "inertial" not in done.stderr


def test_elements_of_xacro_may_lack_the_prefix(probe):
    source = probe / "urdf" / "probe.urdf.xacro"
    (probe / "urdf" / "part.xacro").write_text('<robot><property name="M_PI" value="3.14159"/></robot>')
    source.write_text("""<robot name="probe" xmlns:xacro="http://www.ros.org/wiki/xacro">
<include filename="part.xacro"/>
<property name="twice" value="${2 * M_PI}"/>
<property name="twice" value="${2 * M_PI}"/>
<macro name="arm" params="side *origin"><link name="${side}_arm"><insert_block name="origin"/></link></macro>
<arm side="left"><origin xyz="${twice} 0 0"/></arm>
<if value="false"><link name="none"/></if>
<gazebo><plugin filename="a.so"><include filename="as it is"/></plugin></gazebo>
</robot>""")
    done = run(COMMANDS["xacro"], source, path=probe.parent)
    assert done.returncode == 0, done.stderr
    for words in ('<link name="left_arm">', '<origin xyz="6.28318 0 0"/>', '<include filename="as it is"/>'):
        assert words in done.stdout
    assert "none" not in done.stdout and done.stderr.count("<xacro:property>") == 1
