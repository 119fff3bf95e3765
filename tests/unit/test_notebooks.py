# SPDX-License-Identifier: BSD-3-Clause
"""The labs' notebooks: without outputs in git, installed, found by name; and how Jupyter is started for them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import notebook as tool
from lab_web import jupyter

ROOT = Path(__file__).resolve().parents[2]
NAMES = ["1_transforms_and_tf", "2_urdf", "3_rviz", "4_xacro", "5_moving_baxter", "6_rotating_the_gripper", "7_waving",
         "8_before_the_real_robot"]
WITHOUT_LAB = ("teach_it",)


def test_there_is_a_notebook_for_every_part_of_the_courses():
    found = [path.stem for path in tool.notebooks()]
    assert sorted(found) == sorted([*NAMES, "joint_states_and_trajectories", "ros_control", "planning", "steering",
                                    *WITHOUT_LAB])


@pytest.mark.parametrize("path", tool.notebooks(), ids=lambda path: path.stem)
def test_in_git_without_outputs(path):
    name = path.relative_to(ROOT).as_posix()
    staged = subprocess.run(["git", "-C", ROOT, "show", f":{name}"], capture_output=True, text=True)
    # A working copy may have outputs; committed files may not. Outside git the file itself is checked.
    content = json.loads(staged.stdout if staged.returncode == 0 else path.read_text(encoding="utf-8"))
    assert content["metadata"]["kernelspec"]["name"] == jupyter.KERNEL
    for cell in content["cells"]:
        assert cell.get("outputs", []) == [] and cell.get("execution_count") is None


@pytest.mark.parametrize("path", tool.notebooks(), ids=lambda path: path.stem)
def test_begins_with_a_heading_and_a_connection_and_has_exercises(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = ["".join(cell["source"]) for cell in cells]
    assert texts[0].startswith("# ") and ("lab_session.connect(" in texts[1]) == (path.stem not in WITHOUT_LAB)
    assert any("## Exercises" in text for text in texts)


@pytest.mark.parametrize("path", tool.notebooks(), ids=lambda path: path.stem)
def test_package_installs_its_notebooks(path):
    assert "install(DIRECTORY notebooks " in (path.parents[1] / "CMakeLists.txt").read_text(encoding="utf-8")


def test_part_of_a_name_is_enough_if_it_is_one_notebooks():
    assert tool.find("waving").stem == "7_waving"
    assert tool.find("ros_control.ipynb").stem == "ros_control"
    with pytest.raises(tool.NotebookError, match=r"did you mean 7_waving\?"):
        tool.find("wavng")
    with pytest.raises(tool.NotebookError, match="'dancing' names no notebook; there are: .*7_waving"):
        tool.find("dancing")
    with pytest.raises(tool.NotebookError, match="several notebooks; which of: "):
        tool.find("ing")


def test_kernel_is_the_workspaces_own(tmp_path):
    jupyter.write_kernel(tmp_path, [str(ROOT / "tools" / "notebook_kernel.bash")])
    spec = json.loads((tmp_path / "kernels" / "baxter" / "kernel.json").read_text(encoding="utf-8"))
    script, *rest = spec["argv"]
    assert rest == ["-f", "{connection_file}"]
    # What it starts sees the virtual environment, ROS and the workspace, from any environment.
    shown = subprocess.run([script, "--version"], env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
    assert shown.returncode == 0, shown.stderr


def test_jupyter_listens_on_loopback_and_writes_into_one_folder(tmp_path):
    assert "--ServerApp.ip=127.0.0.1" in tool.command(8888)
    assert not any("token" in word for word in tool.command(8888)), "everybody can read a command line"
    made = jupyter.environment(tmp_path, tmp_path)
    for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR"):
        assert made[name].startswith(str(tmp_path)) and Path(made[name]).is_dir()


def test_jupyterlab_does_not_ask_about_news(tmp_path):
    """As JupyterLab itself reads its settings, from the schemas that it came with."""
    lab = Path(sys.prefix) / "share/jupyter/lab"
    program = (
        "import json, sys\n"
        "from jupyterlab_server.settings_utils import get_settings\n"
        f"found, _ = get_settings({str(lab / 'settings')!r}, {str(lab / 'schemas')!r}, {str(tmp_path / 'user')!r},\n"
        "    schema_name='@jupyterlab/apputils-extension:notification', labextensions_path=[])\n"
        "print(json.dumps({name: entry['default'] for name, entry in found['schema']['properties'].items()}))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], env=jupyter.environment(tmp_path, tmp_path),
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    defaults = json.loads(done.stdout)
    assert defaults["fetchNews"] == "false" and defaults["checkForUpdates"] is False


def test_checkpoints_are_no_part_of_the_repository():
    done = subprocess.run(["git", "check-ignore", "src/courses/rf_lab2/notebooks/.ipynb_checkpoints/a.ipynb"], cwd=ROOT)
    if done.returncode == 128:
        pytest.skip("no git checkout")
    assert done.returncode == 0


def test_list_and_unknown_name_on_the_command_line():
    listed = subprocess.run([ROOT / "baxter.sh", "notebook", "--list"], capture_output=True, text=True)
    assert listed.returncode == 0 and all(name in listed.stdout for name in NAMES)
    refused = subprocess.run([ROOT / "baxter.sh", "notebook", "dancing"], capture_output=True, text=True)
    assert refused.returncode == 2 and "names no notebook" in refused.stderr and "Traceback" not in refused.stderr
