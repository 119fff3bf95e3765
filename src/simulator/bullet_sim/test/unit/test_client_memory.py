# SPDX-License-Identifier: BSD-3-Clause
"""The memory of a new physics client: zeros are given back, and everything keeps its content."""
import mmap
import subprocess
import sys
import threading

import pytest

from bullet_sim import client_memory
from bullet_sim.client_memory import added

PAGE = mmap.PAGESIZE
PROGRAM = """
import mmap, sys
from bullet_sim import World, client_memory

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * mmap.PAGESIZE

found, give_back = [], client_memory.give_back
def noted(before):
    used = resident()
    found.append((give_back(before), used - resident()))
client_memory.give_back = noted
worlds = [World() for _ in range(2)]
for world in worlds:
    world.add_ground_plane()
    for _ in range(3):
        world.step()
print(found)
assert all(size > 10 << 20 and freed > 0.9 * size for size, freed in found), found
"""


@pytest.mark.parametrize("before, after, new", [
    ([], [(1, 3), (5, 9)], [(1, 3), (5, 9)]),
    ([(1, 3)], [(1, 3)], []),
    ([(2, 3), (5, 6)], [(1, 9)], [(1, 2), (3, 5), (6, 9)]),
    ([(1, 5)], [(2, 4), (5, 7)], [(5, 7)]),
    ([(1, 4), (6, 9)], [(3, 7)], [(4, 6)]),
])
def test_only_what_was_not_there_is_new(before, after, new):
    assert list(added(before, after)) == new


def test_pages_with_content_keep_it_and_the_others_read_as_zeros():
    before = client_memory.taken()
    with mmap.mmap(-1, 16 << 20, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) as memory:
        memory.write(bytes(len(memory)))
        used = range(0, len(memory), 5 * PAGE)
        for place in used:
            memory[place + PAGE - 1] = 7
        assert client_memory.give_back(before) >= 0.7 * len(memory)
        assert all(memory[place + PAGE - 1] == 7 for place in used)
        assert sum(memory[:]) == 7 * len(used)


def test_without_a_list_of_areas_nothing_is_given_back(monkeypatch):
    monkeypatch.setattr(client_memory, "open", lambda *_, **__: (_ for _ in ()).throw(FileNotFoundError()),
                        raising=False)
    before = client_memory.taken()
    assert before == (frozenset(), []) and client_memory.give_back(before) == 0


def test_where_a_thread_has_begun_all_is_kept():
    before, ends = client_memory.taken(), threading.Event()
    thread = threading.Thread(target=ends.wait)
    thread.start()
    with mmap.mmap(-1, 16 << 20, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS):
        assert client_memory.give_back(before) == 0
    ends.set()
    thread.join()


def test_a_world_gives_most_of_its_clients_memory_back():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
