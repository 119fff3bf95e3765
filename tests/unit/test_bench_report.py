# SPDX-License-Identifier: BSD-3-Clause
"""The bench's report: medians, ratios within a round, goals, table, JSON, pictures."""
import ast
import importlib
import json
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

BENCH = Path(__file__).resolve().parents[1] / "bench"


@pytest.fixture(scope="module")
def modules():
    sys.path.insert(0, str(BENCH))
    yield {name: importlib.import_module(name) for name in ("report", "pictures")}
    sys.path.remove(str(BENCH))


@pytest.fixture
def report(modules):
    return modules["report"]


def rounds(report, tmp_path, *figures):
    """The results of rounds: each figure is (ours, peer's or None)."""
    found = []
    for ours, peer in figures:
        one = report.Report()
        one.add("thing", ours, "ms", None if peer is None else ("other", peer), ratio_most=0.5)
        one.sample("times", "ms", ours=[ours, 2 * ours])
        one.save(tmp_path / "round.json")
        found.append(json.loads((tmp_path / "round.json").read_text()))
    return found


def test_ratio_is_that_within_the_rounds(report, tmp_path):
    """The third round was disturbed: both are slow there, their ratio is not."""
    (row,), samples = report.put_together("suite", rounds(report, tmp_path, (1.0, 4.0), (1.2, 4.0), (10.0, 40.0)))
    assert row.figure == 1.2
    assert row.ratios == pytest.approx([0.25, 0.3, 0.25])
    assert row.ratio == pytest.approx(0.25)
    assert row.met is True
    assert samples["times"]["values"]["ours"] == [1.0, 2.0, 1.2, 2.4, 10.0, 20.0]


@pytest.mark.parametrize("goal, ours, peer, met", [
    ({"most": 5.0}, 4.0, None, True), ({"most": 5.0}, 6.0, None, False), ({"least": 5.0}, 6.0, None, True),
    ({"least": 5.0}, 4.0, None, False), ({"ratio_most": 0.1}, 1.0, 20.0, True), ({"ratio_most": 0.1}, 1.0, 5.0, False),
    ({"ratio_least": 2.0}, 4.0, 1.0, True), ({"ratio_most": 0.1}, 1.0, None, None), ({}, 1.0, 2.0, None),
])
def test_goals(report, goal, ours, peer, met):
    row = report.Row("s", "w", "", [ours], "p", [] if peer is None else [peer], goal)
    assert row.met is met
    assert report.goal_text(row).endswith({True: "yes", False: "NO", None: "no peer" if goal else ""}[met])


def test_goal_of_an_unknown_kind_is_refused(report):
    with pytest.raises(ValueError, match="ratio_most"):
        report.Report().add("thing", 1.0, at_most=2.0)


def pooled_row(report, tmp_path, *shares, least=99.99):
    """The row that rounds of 2,000 samples make, each with this share [%]."""
    found = []
    for share in shares:
        one = report.Report()
        one.add("solved", share, "%", samples=2000, pooled=True, least=least)
        one.save(tmp_path / "round.json")
        found.append(json.loads((tmp_path / "round.json").read_text()))
    (row,), _ = report.put_together("suite", found)
    return row


def test_a_miss_in_one_round_counts_among_all_samples(report, tmp_path):
    """The median of these rounds is 100 %, although one of 6,000 was missed."""
    row = pooled_row(report, tmp_path, 100.0, 99.95, 100.0)
    assert row.figure == pytest.approx(100.0 - 100.0 / 6000)
    assert row.met is False
    assert pooled_row(report, tmp_path, 100.0, 100.0).met is True


def test_the_table_says_how_many_samples(report, tmp_path):
    row = pooled_row(report, tmp_path, 100.0, 99.95, 100.0)
    assert " 6000 " in report.table([row])[-1]
    assert "| 6000 |" in report.markdown([row])[-1]
    assert "99.98" in report.table([row])[-1]


@pytest.mark.parametrize("samples", [None, 0])
def test_a_share_without_its_samples_is_refused(report, samples):
    with pytest.raises(ValueError, match="number of samples"):
        report.Report().add("solved", 100.0, "%", samples=samples, pooled=True)


def test_table_and_markdown_hold_every_figure(report, tmp_path):
    rows, _ = report.put_together("suite", rounds(report, tmp_path, (0.05, 0.5), (0.07, 0.5)))
    text = "\n".join(report.table(rows))
    for part in ("suite", "thing [ms]", "0.06", "0.05 to 0.07", "other", "0.500", "ratio <= 0.500: yes"):
        assert part in text
    markdown = report.markdown(rows)
    assert len({line.count("|") for line in markdown}) == 1
    assert "0.06 ms" in markdown[-1]


@pytest.mark.parametrize("value, text", [(100.0, "100"), (99.995, "100.00"), (99.98, "99.98"), (0.0671, "0.0671"),
                                         (0.5, "0.500"), (12345.6, "12346"), (1e-9, "1e-09"), (None, "")])
def test_numbers_are_readable(report, value, text):
    assert report.number(value) == text


def test_pictures_are_drawn(modules, tmp_path):
    report, pictures = modules["report"], modules["pictures"]
    rows, samples = report.put_together("suite", rounds(report, tmp_path, (1.0, 4.0), (1.2, 0.1)))
    pictures.ratios(rows, tmp_path / "ratios.png")
    pictures.distribution("times", samples["times"], tmp_path / "times.png")
    for name in ("ratios.png", "times.png"):
        assert cv2.imread(str(tmp_path / name)).std() > 5.0


def test_every_suite_has_its_measure():
    """Read, not imported: a suite may need peers that only the bench installs."""
    tree = ast.parse((BENCH / "run.py").read_text())
    suites = next(ast.literal_eval(node.value) for node in tree.body
                  if isinstance(node, ast.Assign) and node.targets[0].id == "SUITES")
    for module, about in suites.values():
        functions = {node.name: [argument.arg for argument in node.args.args]
                     for node in ast.parse((BENCH / (module + ".py")).read_text()).body
                     if isinstance(node, ast.FunctionDef)}
        assert functions.get("measure") == ["report", "quick", "number"], module
        assert about


def test_runner_names_its_suites_and_refuses_others():
    done = subprocess.run([sys.executable, str(BENCH / "run.py"), "--list"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stdout.startswith("ik ")
    done = subprocess.run([sys.executable, str(BENCH / "run.py"), "chess"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "unknown suite: chess; the suites are ik, verdict, fk" in done.stderr
