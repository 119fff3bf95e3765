# SPDX-License-Identifier: BSD-3-Clause
"""The nodes that roslaunch starts beside a master: ROS's own, without the clock."""
import roslaunch.config
import roslaunch.xmlloader


def test_rosout_hears_no_clock():
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.config.load_roscore(roslaunch.xmlloader.XmlLoader(), config, verbose=False)
    assert [(node.name, node.package, node.remap_args) for node in config.nodes_core] == [
        ("rosout", "rosout", [["/clock", "/rosout/no_clock"]])]
