# SPDX-License-Identifier: BSD-3-Clause
"""FairLock: nobody waits longer than one turn of each of the others."""
import threading

from baxter_sim_kinematics.fair_lock import FairLock
from lab_testing.waiting import wait_until


def test_the_order_of_asking_is_the_order_of_turns_also_for_a_thread_that_comes_back_at_once():
    lock, order, threads = FairLock(), [], []

    def work(number):
        for _ in range(3):
            with lock:
                order.append(number)
                # Until everybody else is in the queue again.
                wait_until(lambda: len(lock._gates) >= min(3, threads_left()), "the others to ask")

    def threads_left():
        return 4 - sum(order.count(number) == 3 for number in range(4)) - (order.count(order[-1]) < 3)

    with lock:
        for number in range(4):
            threads.append(threading.Thread(target=work, args=(number,)))
            threads[-1].start()
            wait_until(lambda number=number: len(lock._gates) == number + 1, "thread %d to ask" % number)
    for thread in threads:
        thread.join(90.0)
    assert order == [0, 1, 2, 3] * 3


def test_one_at_a_time_and_free_at_the_end():
    lock, inside, most = FairLock(), [], []

    def work():
        for _ in range(200):
            with lock:
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(90.0)
    assert len(most) == 1600 and max(most) == 1
    with lock:
        pass


def test_an_exception_ends_the_turn():
    lock = FairLock()
    for _ in range(2):
        try:
            with lock:
                raise ValueError
        except ValueError:
            pass
    with lock:
        pass
