# SPDX-License-Identifier: BSD-3-Clause
"""Every topic of the physical robot is served or listed with a reason; each row is published at its rate."""
from pathlib import Path

import numpy as np
import pytest
import yaml
from std_msgs.msg import Empty

from baxter_sim_hardware.topics import coverage, interface

PACKAGE = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def table():
    return yaml.safe_load((PACKAGE / "config" / "topics_not_served.yaml").read_text())


def test_the_physical_robot_has_268_topics():
    assert len(coverage.physical()) == 268


def test_every_topic_is_served_with_its_type_or_left_out_with_a_reason(table):
    here = coverage.served()
    for name, kind in coverage.physical().items():
        if name in here:
            assert here[name] == kind, name
        elif not coverage.elsewhere(name, table):
            assert coverage.reason_to_leave_out(name, kind, table), name


def test_nothing_is_both_served_and_left_out(table):
    for name, kind in coverage.served().items():
        assert not coverage.reason_to_leave_out(name, kind, table), name
        assert not coverage.elsewhere(name, table), name


def test_every_rule_is_used(table):
    physical = coverage.physical()
    reasons = {coverage.reason_to_leave_out(name, kind, table) for name, kind in physical.items()}
    assert reasons >= {entry["reason"] for entry in table["left_out"]}
    assert {coverage.elsewhere(name, table) for name in physical} >= set(table["elsewhere"].values())


def test_documentation_prints_the_counts(table):
    text = (PACKAGE.parents[3] / "docs" / "interface.md").read_text(encoding="utf-8")
    assert coverage.markdown(table) in text, "rosrun baxter_sim_hardware interface_table --coverage prints it"


def test_every_published_row_comes_at_its_rate(make_lab):
    lab = make_lab()
    times = {topic: [] for topic in lab.publishers}
    for topic, publisher in lab.publishers.items():
        publisher.has_listeners = True
        publisher.publish = lambda message, topic=topic: times[topic].append(lab.world.time_s)
    lab.run(2.2)
    for row in interface.TOPICS:
        if not row.is_published or row.rate == interface.LATCHED:
            continue
        rate = interface.JOINT_STATE_RATE_HZ if row.rate == interface.JOINT_STATE_RATE else row.rate
        for _, name in row.names():
            assert len(times[name]) >= 2.0 * rate, name
            # The first may be early: the grid of a rate does not begin at the spawn.
            np.testing.assert_allclose(np.diff(times[name])[1:], 1.0 / rate, atol=1e-9, err_msg=name)


def test_latched_rows_are_published_once(make_lab):
    lab = make_lab()
    lab.run(0.5)
    assert lab.publishers["sim/started"].messages == [Empty()]
    assert len(lab.publishers["urdf"].messages) == 1
