# SPDX-License-Identifier: BSD-3-Clause
"""Several labs on one machine, each with its own master, at real time and as fast as possible."""
import contextlib
import time

from labs import Lab, memory_mb

from lab_testing.waiting import wait_until

SECONDS = 6.0
SETTLE_S = 2.0  # simulated


def measure(report, quick, number):
    seconds = 1.0 if quick else SECONDS
    one = {}
    for count in (1, 2, 4):
        for speed, title in (("1.0", "real time"), ("0", "as fast as possible")):
            factors, cpu, memory = run(count, speed, seconds)
            one.setdefault(title, (factors, memory))
            report.add("%d labs, %s: slowest factor" % (count, title), min(factors), "x",
                       ("one lab", min(one[title][0])), **({"least": 0.99} if speed != "0" and count < 4 else {}))
            if speed != "0":
                report.add("%d labs, %s: CPU of each /gazebo" % (count, title), cpu, "% of a core")
                report.add("%d labs: memory of each /gazebo" % count, memory, "MB", ("one lab", one[title][1]))


def run(count, speed, seconds):
    """Return (factors, mean CPU [% of a core], mean memory [MB]) of ``count`` labs with their arms moving."""
    with contextlib.ExitStack() as stack:
        labs = [stack.enter_context(Lab(gui="false", enable="true", real_time_factor=speed)) for _ in range(count)]
        for lab in labs:
            lab.part("swing")
        settled = [lab.now() + SETTLE_S for lab in labs]
        wait_until(lambda: all(lab.now() >= time_s for lab, time_s in zip(labs, settled, strict=True)),
                   "the arms to swing", 120.0, 0.1)
        gazebos = [lab.process("/gazebo") for lab in labs]
        begin = [(lab.now(), gazebo.cpu_s(), time.monotonic()) for lab, gazebo in zip(labs, gazebos, strict=True)]
        time.sleep(seconds)
        factors, shares = [], []
        for lab, gazebo, (simulated, used, wall) in zip(labs, gazebos, begin, strict=True):
            elapsed = time.monotonic() - wall
            factors.append((lab.now() - simulated) / elapsed)
            shares.append(100.0 * (gazebo.cpu_s() - used) / elapsed)
        memory = sum(memory_mb(gazebo.pid) for gazebo in gazebos) / count
    return factors, sum(shares) / count, memory
