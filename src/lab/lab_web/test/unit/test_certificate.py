# SPDX-License-Identifier: BSD-3-Clause
"""The page by https: a certificate for this machine's names, made once."""
import socket
import ssl
import subprocess
from pathlib import Path

import pytest
from tornado import web

from lab_web import certificate as module
from lab_web.certificate import CertificateError, certificate
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving, tls_context


def test_a_server_with_it_is_who_it_says(tmp_path):
    files = certificate(tmp_path, ["localhost", "127.0.0.1"])
    assert Path(files[1]).stat().st_mode & 0o077 == 0
    assert certificate(tmp_path, ["localhost", "127.0.0.1"]) == files
    loop = LoopThread()
    serving = Serving(loop, web.Application([]), 0, "127.0.0.1", tls_context(*files))
    try:
        trust = ssl.create_default_context(cafile=files[0])
        for name in ("localhost", "127.0.0.1"):
            with socket.create_connection(("127.0.0.1", serving.port), 10.0) as raw, trust.wrap_socket(
                    raw, server_hostname=name) as secure:
                secure.sendall(b"GET / HTTP/1.0\r\n\r\n")
                assert secure.recv(64).startswith(b"HTTP/1.1 404")
        with socket.create_connection(("127.0.0.1", serving.port), 10.0) as raw, pytest.raises(ssl.SSLError):
            trust.wrap_socket(raw, server_hostname="elsewhere")
    finally:
        serving.close()
        loop.stop()


def test_one_that_ends_soon_and_another_name_get_a_new_one(tmp_path, monkeypatch):
    first = certificate(tmp_path, ["localhost"])
    before = Path(first[0]).read_text()
    assert certificate(tmp_path, ["robot"]) != first
    monkeypatch.setattr(module, "_SOON_S", 1000 * 86400)
    assert certificate(tmp_path, ["localhost"]) == first and Path(first[0]).read_text() != before


def test_without_openssl_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CertificateError, match="apt install openssl"):
        certificate(tmp_path, ["localhost"])
    monkeypatch.undo()
    monkeypatch.setattr(module.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 1, "", "bad\nname"))
    with pytest.raises(CertificateError, match="name"):
        certificate(tmp_path, ["localhost"])
