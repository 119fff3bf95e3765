# SPDX-License-Identifier: BSD-3-Clause
"""torture.py bag: rosbag record -a with all pictures, then a check of the bag."""
import collections

import rosbag
from full import bear
from invariants import Stamps, not_finite
from limits import arm_limits
from robot import init_node
from watch import BULKY, STATES, Watch

from lab import Lab, end

STILL_RAD = 0.001
MINUTES = 2.0
STATES_HZ = 50.0
# Share of the joint states that must be in the bag; on a busy machine the recorder loses some.
MIN_PART = 0.5


def run(options, journal):
    """Record everything while the arms move, then read the bag; return figures for the result."""
    path = options.out / "all.bag"
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch:
            recorder = lab.start("rosbag", "record", "-a", "--buffsize=512", "-O", str(path))
            begin = watch.simulated_s
            bear(lab, watch, options, journal, MINUTES if options.minutes is None else options.minutes)
            simulated_s = watch.simulated_s - begin
            end(recorder)
    counts, found = look_into(path)
    expected = MIN_PART * STATES_HZ * simulated_s
    if counts[STATES] < expected:
        found.append("the bag has %d joint states, at least %.0f were expected" % (counts[STATES], expected))
    if found:
        journal.fail("; ".join(found[:5]), options.seed, 0, 1)
    size = path.stat().st_size / 1e6
    path.unlink()
    return {"simulated_s": simulated_s, "also": {
        "recorder_ended_with": recorder.returncode, "topics": len(counts), "messages_in_the_bag": sum(counts.values()),
        "megabytes": round(size)}}


def look_into(path):
    """Return ({topic: number of messages}, texts of faults in them)."""
    counts, stamps, found = collections.Counter(), Stamps(), []
    with rosbag.Bag(str(path)) as bag:
        kinds = {topic: info.msg_type for topic, info in bag.get_type_and_topic_info().topics.items()}
        for topic, raw, _ in bag.read_messages(raw=True):
            counts[topic] += 1
            if kinds[topic] in BULKY or counts[topic] % 10:
                continue
            message = raw[4]()
            message.deserialize(raw[1])
            found += not_finite(topic, kinds[topic], message)
            if topic == "/clock":
                found += stamps.check(topic, message.clock.to_sec())
    return counts, found
