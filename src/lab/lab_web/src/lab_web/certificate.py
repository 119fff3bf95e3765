# SPDX-License-Identifier: BSD-3-Clause
"""A certificate of this machine's own, for pages on other machines: browsers give WebXR to https alone. No ROS."""
from __future__ import annotations

import hashlib
import ipaddress
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

#: For how long it is valid [days], and when another one is made [s before its end].
_DAYS, _SOON_S = 397, 7 * 86400
_PATIENCE_S = 30.0


class CertificateError(Exception):
    """There is no certificate; the text says why, and what helps."""


def certificate(folder: Path, names: Sequence[str]) -> tuple[str, str]:
    """The files (certificate, key) for a machine of these ``names`` and addresses, kept in ``folder``; made where they
    are missing or end soon. Raises CertificateError."""
    place = folder / ("tls-" + hashlib.sha256("\n".join(names).encode()).hexdigest()[:16])
    files = str(place / "certificate.pem"), str(place / "key.pem")
    if not _is_valid(files[0]):
        folder.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(dir=folder))  # its owner's alone from the beginning, as the key must be
        try:
            _make(draft, names)
            shutil.rmtree(place, ignore_errors=True)
            draft.rename(place)
        except OSError:
            if not _is_valid(files[0]):  # else another page has just made it
                raise
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    return files


def _is_valid(file: str) -> bool:
    return os.path.exists(file) and not _openssl("x509", "-noout", "-checkend", str(_SOON_S), "-in", file).returncode


def _make(folder: Path, names: Sequence[str]) -> None:
    entries = ",".join("%s:%s" % ("IP" if _is_address(name) else "DNS", name) for name in names)
    made = _openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days",
                    str(_DAYS), "-subj", "/CN=%s" % names[0][:64], "-addext", "subjectAltName=" + entries,
                    "-keyout", str(folder / "key.pem"), "-out", str(folder / "certificate.pem"))
    if made.returncode:
        raise CertificateError("openssl made no certificate for %s: %s" % (
            ", ".join(names), (made.stderr.strip().splitlines() or ["no message"])[-1]))


def _openssl(*arguments: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(["openssl", *arguments], capture_output=True, text=True, timeout=_PATIENCE_S)
    except FileNotFoundError:
        raise CertificateError("there is no openssl to make a certificate; sudo apt install openssl") from None
    except subprocess.TimeoutExpired:
        raise CertificateError("openssl did not end within %g s" % _PATIENCE_S) from None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
