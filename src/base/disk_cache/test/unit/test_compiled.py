# SPDX-License-Identifier: BSD-3-Clause
"""Where compiled code is kept: by the text of its sources, in the first place that can be written."""
import os
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import pytest

from disk_cache.compiled import compiler, folder


def test_folder_is_named_after_all_of_the_sources(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    one, two = tmp_path / "one.py", tmp_path / "two.py"
    names = set()
    for first, second in (("a", "b"), ("ab", ""), ("", "ab"), ("a", "c"), ("a", "b")):
        one.write_text(first)
        two.write_text(second)
        path = Path(folder("some", [two, one], environment))
        assert path.is_dir() and path.parent == tmp_path / "cache"
        assert path == Path(folder("some", [one, two], environment))
        names.add(path.name)
    assert len(names) == 4


def test_folders_of_old_states_go_and_nothing_else(tmp_path):
    environment, source = {"NUMBA_CACHE_DIR": str(tmp_path)}, tmp_path / "one.py"
    (tmp_path / "some-thing").mkdir()
    paths = []
    for k in range(8):
        source.write_text(str(k))
        paths.append(Path(folder("some", [source], environment)))
        os.utime(paths[-1], (k, k))
    left = [path for path in paths if path.exists()]
    assert left == paths[-len(left):] and 2 <= len(left) <= 5
    assert (tmp_path / "some-thing").exists()


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Three places, each for one user: beside the source, in the cache of a user, among temporary files."""
    source = tmp_path / "package" / "one.py"
    source.parent.mkdir()
    source.write_text("text")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return source, {"XDG_CACHE_HOME": str(tmp_path / "home")}


def test_the_first_place_that_can_be_written_is_taken(places, tmp_path):
    source, environment = places
    assert Path(folder("some", [source], environment)).parent == source.parent / "__pycache__"
    assert Path(folder("some", [source], {**environment, "NUMBA_CACHE_DIR": str(tmp_path)})).parent == tmp_path
    os.rename(source.parent / "__pycache__", tmp_path / "away")
    (source.parent / "__pycache__").write_text("a file is in the way")
    assert Path(folder("some", [source], environment)).parent == tmp_path / "home" / "numba"
    os.rename(tmp_path / "home", tmp_path / "home_away")
    (tmp_path / "home").write_text("and here")
    last = Path(folder("some", [source], environment)).parent
    assert last.parent == tmp_path / "tmp" and stat.S_IMODE(last.stat().st_mode) == 0o700


def test_a_temporary_folder_that_others_can_write_is_not_trusted(places, tmp_path):
    source, environment = places
    for name in ("package/__pycache__", "home"):
        (tmp_path / name).write_text("a file is in the way")
    (tmp_path / "tmp" / ("some_%d" % os.getuid())).mkdir()
    (tmp_path / "tmp" / ("some_%d" % os.getuid())).chmod(0o777)
    last = Path(folder("some", [source], environment)).parent
    assert last.name != "some_%d" % os.getuid() and stat.S_IMODE(last.stat().st_mode) == 0o700


def test_functions_are_compiled_into_their_folder_and_nothing_else_is(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    numba.config.reload_config()
    double = compiler("some", [__file__], error_model="numpy")(_double)
    assert double(21) == 42 and numba.config.CACHE_DIR == str(tmp_path)
    assert list(tmp_path.glob("some-*/**/*.nbi"))


def _double(value):
    return 2 * value


def test_sources_of_compiled_code_are_listed_where_that_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setenv("LAB_COMPILED_SOURCES", str(tmp_path / "sources"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for _ in range(2):
        compiler("some", iter([Path(__file__)]))
    assert (tmp_path / "sources").read_text() == 2 * f"{__file__}\n"


def test_without_numba_it_says_so_when_something_is_to_be_compiled(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ImportError):
        compiler("some", [__file__])


PROGRAM = """
import sys
import numba
import numpy as np
from disk_cache.compiled import compiler

@compiler("program", [__file__])
def total(values):
    found = 0.0
    for value in values * values[np.argmin(values)]:
        found += value
    return found

def tables():
    return [name for name in ("arraymath", "arrayobj", "npyimpl") if "numba.np." + name in sys.modules]

def words(text):
    return text.replace(" ", "_")

print(total(np.arange(1.0, 3.0)), sum(total.stats.cache_hits.values()), bool(tables()) and words(str(tables())))
try:
    total(np.empty(0))
except ValueError as error:
    print(words(str(error)))
one_more = numba.njit(lambda values: total(values) + 1.0)
print(one_more(np.arange(1.0, 3.0)), total(np.arange(1, 3)))
"""


def test_what_comes_from_the_cache_needs_no_compiler_until_something_is_compiled(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    runs = [subprocess.run([sys.executable, program], capture_output=True, text=True, check=True).stdout.split()
            for _ in range(2)]
    (value, hits, has_tables, *further), (again, hits_again, has_tables_again, *further_again) = runs
    assert hits == "0" and "npyimpl" in has_tables
    assert (hits_again, has_tables_again) == ("1", "False")
    assert value == again and further == further_again and "empty" in further[0]
