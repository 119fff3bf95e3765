# SPDX-License-Identifier: BSD-3-Clause
"""From a plugin's file name to its class."""
import sys
import types
from pathlib import Path

import pytest
from std_msgs.msg import String

from gazebo_ros.model_plugin import ModelPlugin, PluginContext, PluginError, PluginHost, PluginSource
from gazebo_ros.plugin_table import PluginTable
from loop_ros.testing import FakeRos

CONFIG = Path(__file__).resolve().parents[2] / "config" / "model_plugins.yaml"


class Example(ModelPlugin):
    """A plugin."""


@pytest.fixture
def module(monkeypatch):
    module = types.ModuleType("a_plugin_module")
    module.Example, module.NoPlugin = Example, dict
    monkeypatch.setitem(sys.modules, "a_plugin_module", module)


def test_the_file_name_finds_the_class_whatever_folder_it_is_in(module):
    table = PluginTable({"libexample.so": "a_plugin_module:Example"})
    assert table.find("libexample.so") is Example
    assert table.find("/opt/somewhere/lib/libexample.so") is Example


def test_an_unknown_file_name_is_none(module):
    assert PluginTable({"libexample.so": "a_plugin_module:Example"}).find("libother.so") is None


@pytest.mark.parametrize("target", ["a_plugin_module:Missing", "no_such_module:Example", "a_plugin_module:NoPlugin"])
def test_an_entry_that_leads_nowhere_names_itself(module, target):
    with pytest.raises(PluginError, match="libexample.so.*%s" % target):
        PluginTable({"libexample.so": target}).find("libexample.so")


@pytest.mark.parametrize("entries", [["libexample.so"], {"libexample.so": "no_class"}, {"libexample.so": ":Example"},
                                     {"libexample.so": 3}])
def test_a_malformed_table_says_what_is_expected(entries):
    with pytest.raises(PluginError, match="module:Class"):
        PluginTable(entries)


def test_parameters_add_to_the_file_and_replace_entries(tmp_path):
    path = tmp_path / "plugins.yaml"
    path.write_text("liba.so: a:A\nlibb.so: b:B\n", encoding="utf-8")
    table = PluginTable.from_yaml(path, {"libb.so": "other:B", "libc.so": "c:C"})
    assert table.known == ["liba.so", "libb.so", "libc.so"]
    with pytest.raises(PluginError, match="other:B"):
        table.find("libb.so")


def test_files_of_packages_add_to_the_table_and_a_broken_one_is_left_out(tmp_path):
    texts = {"ours": "liba.so: a:A\nlibb.so: b:B\n", "first": "libb.so: first:B\n", "second": "libb.so: second:B\n"
             "libd.so: d:D\n", "list": "- libe.so\n", "broken": "libf.so: [", "wrong": "libg.so: no_class\n"}
    paths = {name: tmp_path / (name + ".yaml") for name in texts}
    for name, text in texts.items():
        paths[name].write_text(text, encoding="utf-8")
    warnings = []
    others = [paths[name] for name in ("first", "second", "list", "broken", "wrong")]
    table = PluginTable.from_yaml(paths["ours"], {"libc.so": "c:C"}, others, warnings.append)
    assert table.known == ["liba.so", "libb.so", "libc.so", "libd.so"]
    with pytest.raises(PluginError, match="first:B"):
        table.find("libb.so")
    assert len(warnings) == 3 and all("is left out" in line for line in warnings)
    with pytest.raises(PluginError, match="broken.yaml"):
        PluginTable.from_yaml(paths["ours"], others=[paths["broken"]])


def test_our_own_table_is_well_formed():
    assert "libbaxter_gazebo_ros_control.so" in PluginTable.from_yaml(CONFIG).known


def test_names_in_a_context_are_relative_to_its_namespace():
    parameters = {"robot": {"rate": 50.0}, "settings": {"enable": True}}
    context = PluginContext(None, None, PluginSource(None, None, "/robot"), None, None, parameters)
    assert context.resolve("joint_states") == "/robot/joint_states"
    assert context.resolve("/tf") == "/tf"
    assert context.param("rate") == 50.0
    assert context.param("/settings/enable", False) is True
    assert context.param("/settings/missing", 7) == 7
    assert context.param("/settings/enable/deeper", 7) == 7


def test_a_plugin_that_restarts_keeps_what_it_opened():
    ros = FakeRos()
    context = PluginContext(None, None, PluginSource(None, None, "/robot"), None, ros, {},
                            PluginHost(add_screen=lambda *_: object()))

    class Plugin(ModelPlugin):
        def __init__(self, context, topic="gone"):
            super().__init__(context)
            self.opened = (context.publisher("out", String), context.subscription("in", String, depth=3),
                           context.screen("glass", [[1.0]], (1.0, 2.0), (3, 4)))
            self.own = context.publisher(topic, String)

        def close(self):
            raise RuntimeError("broken on purpose")

    plugin = Plugin(context)
    successor = plugin.successor("more")
    assert all(one is other for one, other in zip(plugin.opened, successor.opened, strict=True))
    assert plugin.own.is_closed and sorted(ros.publishers) == ["/robot/more", "/robot/out"]
    # The picture on a screen is closed with the model: this one could not be.
    context.close()
    assert ros.publishers == ros.subscriptions == {}
