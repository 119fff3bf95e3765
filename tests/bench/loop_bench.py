# SPDX-License-Identifier: BSD-3-Clause
"""The lab at real time with both arms moving: its share of a core, the jitter of its ticks, the delay of a command."""
import json
import multiprocessing
import statistics
import time

from labs import Lab, arrivals, plan_of

SECONDS = 10.0
RATE_HZ = 100


def bare_timer(seconds, queue):
    """Return the times of the beats of a loop that only sleeps until its next beat, in a separate process."""
    times, beat = [], time.monotonic()
    end = beat + seconds
    while beat < end:
        beat += 1.0 / RATE_HZ
        time.sleep(max(0.0, beat - time.monotonic()))
        times.append(time.monotonic())
    queue.put(times)


def gaps_ms(times):
    return [1e3 * (b - a) for a, b in zip(times, times[1:], strict=False)]


def measure(report, quick, number):
    seconds = 2.0 if quick else SECONDS
    with Lab(gui="false", enable="true", joint_state_rate=str(RATE_HZ)) as lab:
        lab.part("swing")
        gazebo = lab.process("/gazebo")
        for count, goal in ((0, 40.0), (5, 40.0), (20, 50.0)):
            used, wall = gazebo.cpu_s(), time.monotonic()
            if count == 0:
                time.sleep(seconds)
                share = 100.0 * (gazebo.cpu_s() - used) / (time.monotonic() - wall)
                idle = share
                report.add("CPU of /gazebo, no subscribers", share, "% of a core", most=goal)
                continue
            fresh = multiprocessing.get_context("spawn")
            queue = fresh.Queue()
            timer = fresh.Process(target=bare_timer, args=(seconds, queue))
            timer.start()
            states, clock = arrivals(lab, plan_of(count), ("/robot/joint_states", "/clock"), seconds)
            share = 100.0 * (gazebo.cpu_s() - used) / (time.monotonic() - wall)
            bare = gaps_ms(queue.get())
            timer.join()
            report.add("CPU of /gazebo, %d raw sinks" % count, share, "% of a core", ("no subscribers", idle),
                       most=goal)
            found, ticks = gaps_ms(states), gaps_ms(clock)
            bound = 2.0 * statistics.stdev(bare) + 0.3
            report.add("joint_states at %d Hz, %d sinks: sd" % (RATE_HZ, count), statistics.stdev(found), "ms",
                       ("twice a bare timer + 0.3", bound), samples=len(found), ratio_most=1.0)
            report.add("joint_states, %d sinks: sd" % count, statistics.stdev(found), "ms",
                       ("a bare timer", statistics.stdev(bare)), samples=len(found), most=1.5)
            report.add("joint_states, %d sinks: rate" % count, 1e3 / statistics.mean(found), "Hz",
                       samples=len(found))
            report.add("clock, %d sinks: p99 of the gap" % count, statistics.quantiles(ticks, n=100)[98], "ms",
                       samples=len(ticks))
            report.sample("gaps with %d sinks" % count, "ms", **{"joint_states": found, "clock": ticks,
                                                                 "bare timer": bare})
        clients = [lab.part("client") for _ in range(5)]
        used, wall = gazebo.cpu_s(), time.monotonic()
        time.sleep(seconds)
        share = 100.0 * (gazebo.cpu_s() - used) / (time.monotonic() - wall)
        report.add("CPU of /gazebo, 5 rospy clients", share, "% of a core", ("no subscribers", idle), most=40.0)
        report.add("real-time factor, 5 rospy clients", lab.factor(seconds), "x", least=0.99)
        for client in clients:
            client.terminate()
    with Lab(gui="false", enable="true") as lab:
        latency = lab.part("latency", 5 if quick else 20)
        found = json.loads(latency.stdout.readline())
        report.add("command to first motion", found["median"], "ticks of 2 ms",
                   samples=len(found["ticks"]), most=2)
