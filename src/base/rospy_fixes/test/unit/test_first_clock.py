# SPDX-License-Identifier: BSD-3-Clause
"""How long init_node waits for simulated time and for a starting simulator."""
import pytest

from master_calls.simulator_start import SimulatorDied
from rospy_fixes import first_clock
from rospy_fixes.first_clock import NOBODY_S, SILENT_S, STARTING_S, ClockWait


class FakeWatch:
    """`starting(now_s)` -> names, or raises."""

    def __init__(self, starting):
        self.starting, self.now_s, self.looks = starting, 0.0, 0

    def look(self):
        self.looks += 1
        return self.starting(self.now_s)


def wait(starting=lambda now_s: [], clock_from_s=1e9, published_from_s=1e9, wants_the_world=True):
    """Wait in steps of 0.05 s; returns (seconds waited, the ClockWait, the watch)."""
    watch = FakeWatch(starting)
    clock_wait = ClockWait(watch, wants_the_world, begin_s=0.0)
    for step in range(20 * 1000):
        watch.now_s = step / 20.0
        if clock_wait.is_over(watch.now_s >= clock_from_s, lambda: watch.now_s >= published_from_s, watch.now_s):
            return watch.now_s, clock_wait, watch
    raise AssertionError("for ever")


def test_a_clock_that_runs_costs_one_look():
    waited_s, clock_wait, watch = wait(clock_from_s=0.0)
    assert waited_s == 0.0 and watch.looks == 1 and not clock_wait.complaint
    assert wait(clock_from_s=0.0, wants_the_world=False)[2].looks == 0


def test_nobody_there_is_a_short_wait_with_one_complaint():
    waited_s, clock_wait, _ = wait()
    assert waited_s == pytest.approx(NOBODY_S, abs=0.1)
    assert "rosparam set use_sim_time false" in clock_wait.complaint


def test_a_publisher_that_is_silent_is_given_longer_and_not_for_ever():
    assert wait(published_from_s=2.0)[0] == pytest.approx(SILENT_S, abs=0.1)
    assert wait(published_from_s=2.0, clock_from_s=20.0)[0] == pytest.approx(20.0, abs=0.1)


def test_a_start_is_waited_for_as_long_as_it_is_seen():
    waited_s, clock_wait, _ = wait(lambda now_s: ["/gazebo"] if now_s < 100.0 else [], clock_from_s=99.0)
    assert waited_s == pytest.approx(100.0, abs=0.6) and not clock_wait.complaint
    assert wait(lambda now_s: ["/gazebo"])[0] == pytest.approx(STARTING_S, abs=0.1)


def test_those_of_the_launch_itself_do_not_wait_for_models():
    def starting(now_s):
        return ["/urdf_spawner"]

    assert wait(starting, clock_from_s=8.0, wants_the_world=False)[0] == pytest.approx(8.0)
    assert wait(starting, clock_from_s=8.0)[0] == pytest.approx(STARTING_S, abs=0.1)


def test_a_simulator_that_dies_is_named():
    def starting(now_s):
        if now_s > 7.0:
            raise SimulatorDied("/gazebo ended")
        return ["/gazebo"]

    waited_s, clock_wait, _ = wait(starting)
    assert waited_s < 8.0 and clock_wait.complaint == "/gazebo ended"


@pytest.mark.parametrize("path, is_tool", [
    ("/usr/bin/rostopic", True), ("/opt/ros/noetic/bin/rosservice", True), ("/bin/rqt_plot", True),
    ("/opt/ros/noetic/lib/baxter_tools/enable_robot.py", False), ("/home/me/bin/move.py", False), ("", False)])
def test_ros_own_tools_are_told_apart(path, is_tool):
    assert first_clock._is_tool([path]) is is_tool
    assert not first_clock._is_tool([])


def test_options_of_init_node_are_read_by_name_and_by_place():
    def init_node(name, argv=None, anonymous=False, log_level=None, disable_rostime=False):
        pass

    assert first_clock._option(init_node, "disable_rostime", ("name", None, False, None, True), {})
    assert first_clock._option(init_node, "disable_rostime", ("name",), {"disable_rostime": True})
    assert not first_clock._option(init_node, "disable_rostime", ("name",), {"anonymous": True})
