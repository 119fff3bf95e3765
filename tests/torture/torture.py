#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Stress tests of a lab that this program starts: hostile messages, killed nodes, full disks and more.

    ./baxter.sh sim rosrun workspace_tests torture.py fuzz --seed 7 --messages 100000
    ./baxter.sh sim rosrun workspace_tests torture.py machine --seed 7 --minutes 10

Each failure prints the seed and the command that repeats it. Logs, journal and result.json: --out. Exit code: 0 without
failures, 1 with, 77 if the test cannot run on this machine.
"""
import argparse
import importlib
import os
import random
import signal
import sys
import tempfile
import time
import warnings
from pathlib import Path

# Publishing without a queue is intended here: it waits until the message is sent.
warnings.filterwarnings("ignore", "The publisher should be created", SyntaxWarning)
sys.path.insert(0, str(Path(__file__).resolve().parent))

from journal import Journal, Skip, report  # noqa: E402

SKIPPED = 77
# Name: (module with `run(options, journal)`, which returns figures; description).
SUITES = {
    "slice": ("run_slice", "a little of fuzz and machine"),
    "fuzz": ("run_fuzz", "hostile messages on every subscriber and service"),
    "garbage": ("run_garbage", "bytes that are neither TCPROS nor XML-RPC, half-open connections, on all nodes' ports"),
    "handshakes": ("run_handshakes", "hostile handshakes, calls and requests on one node, without a lab"),
    "names": ("run_names", "hostile names in the requests to Gazebo's services, without a lab"),
    "machine": ("run_machine", "a state machine over services and topics, in lock-step (hypothesis)"),
    "faults": ("run_faults", "nodes killed and stopped at random moments; the recovery time of each"),
    "scenes": ("run_scenes", "hostile planning scenes for the planner's core, without a lab"),
    "submissions": ("run_submissions", "hostile programs, notebooks and archives for a grading, without a judge"),
    "disk": ("run_disk", "a full disk under logs and temporary files (root)"),
    "shm": ("run_shm", "a full /dev/shm (root)"),
    "crowd": ("run_crowd", "60 clients for two minutes"),
    "bag": ("run_bag", "rosbag record -a for two minutes"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    abouts = ("%s: %s" % (name, about) for name, (_, about) in SUITES.items())
    parser.add_argument("suite", choices=SUITES, help="; ".join(abouts))
    parser.add_argument("--seed", type=int, default=None, help="default: a random one")
    parser.add_argument("--messages", type=int, default=None, help="number of messages, steps or rounds")
    parser.add_argument("--first", type=int, default=0, help="number of the first message or round")
    parser.add_argument("--minutes", type=float, default=None, help="time limit of the run")
    parser.add_argument("--out", type=Path, default=None, help="folder of logs and results (default: a temporary one)")
    options = parser.parse_args(without_remappings(sys.argv[1:]))
    options.messages_given = options.messages is not None
    if options.messages is None:
        options.messages = 1000 if options.minutes is None else 10**9
    if options.seed is None:
        options.seed = random.SystemRandom().randrange(10**6)
    if options.out is None:
        options.out = Path(tempfile.mkdtemp(prefix="torture_"))
    options.until = None if options.minutes is None else time.monotonic() + 60.0 * options.minutes
    print("%s, seed %d; logs in %s" % (options.suite, options.seed, options.out), flush=True)
    journal = Journal(options.out, options.suite, echo=lambda text: print(text, flush=True))
    try:
        figures = importlib.import_module(SUITES[options.suite][0]).run(options, journal)
    except Skip as reason:
        print("skipped: %s" % reason)
        return SKIPPED
    result = journal.finish(seed=options.seed, **figures)
    print(report(result), flush=True)
    return 1 if journal.failures else 0


def end_as_by_ctrl_c(*_):
    """roslaunch sends a second signal to a test that takes too long; the lab must end with it."""
    raise KeyboardInterrupt


def without_remappings(words):
    """The arguments without those that roslaunch and rosrun add."""
    return [word for word in words if ":=" not in word]


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, end_as_by_ctrl_c)
    code = main()
    sys.stdout.flush()
    # rospy's threads may wait for a lab that has ended.
    os._exit(code)
