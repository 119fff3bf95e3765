# SPDX-License-Identifier: BSD-3-Clause
import argparse

import pytest

from command_line.options import Parser, counted, did_you_mean, number, seconds


@pytest.mark.parametrize("text", ["1", "10", " 7"])
def test_numbers_within_the_bounds_are_taken(text):
    assert number(int, 1, 10)(text) == int(text)
    assert number(float, 1, 10)(text) == float(text)


@pytest.mark.parametrize("kind", [int, float])
@pytest.mark.parametrize("text", ["0", "11", "-3", "nan", "inf", "1e400", "10" * 3000, "", "two", "1,5"])
def test_others_are_refused_with_the_bounds(kind, text):
    with pytest.raises(argparse.ArgumentTypeError, match="from 1, at most 10") as refusal:
        number(kind, 1, 10)(text)
    assert len(str(refusal.value)) < 200


def test_a_bound_may_be_left_out():
    assert seconds()("1e-9") == 1e-9
    for text in ("0", "1e300"):
        with pytest.raises(argparse.ArgumentTypeError, match="above 0, at most 1000000000"):
            seconds()(text)


def test_a_slip_is_answered_with_the_nearest_name():
    assert "notebook" in did_you_mean("notebok", ("check", "notebook", "web"))
    assert did_you_mean("xyz", ("check", "notebook")) == ""


@pytest.mark.parametrize(("words", "meant"), [
    (["dwn"], "did you mean down?"), (["down", "--flder", "x"], "did you mean --folder?"), (["down", "--xyz"], None)])
def test_an_error_asks_for_what_a_slip_may_have_meant(words, meant, capsys):
    parser = Parser()
    parser.add_argument("--folder")
    parser.add_argument("verb", choices=("up", "down", "list"))
    with pytest.raises(SystemExit):
        parser.parse_args(words)
    told = capsys.readouterr().err
    assert meant in told if meant else "did you mean" not in told


def test_singular_and_plural_agree():
    assert [counted(count, "row") for count in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]
    assert counted(1, "stretch", "stretches") == "1 stretch" and counted(3, "stretch", "stretches") == "3 stretches"
