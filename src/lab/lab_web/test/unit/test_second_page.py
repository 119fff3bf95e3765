# SPDX-License-Identifier: BSD-3-Clause
"""The command for a page where one is served already."""
import pytest

from lab_web import node

ADDRESS = "http://localhost:8090/?token=abc"


@pytest.fixture
def served(monkeypatch):
    """The pages that are served, where one is there already."""
    served = []
    monkeypatch.setattr(node, "_require_lab", lambda: None)
    monkeypatch.setattr(node, "fetched", lambda page: page)
    monkeypatch.setattr(node, "serve", lambda options, page, libraries: served.append(options.port))
    monkeypatch.setattr(node.page_files, "address", lambda master: ADDRESS)
    return served


def test_a_second_command_gives_the_address_of_the_first_and_leaves_its_page_alone(served, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["lab_web"])
    assert node.main() == 0
    assert ADDRESS in capsys.readouterr().out and not served


@pytest.mark.parametrize(("words", "port"), [(["--port", "8100"], 8100), (["__name:=lab_web"], None)])
def test_one_with_options_and_one_of_a_launch_file_serve_another(served, monkeypatch, words, port):
    monkeypatch.setattr("sys.argv", ["lab_web", *words])
    assert node.main() == 0 and served == [port]
