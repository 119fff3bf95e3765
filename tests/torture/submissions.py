# SPDX-License-Identifier: BSD-3-Clause
"""Submissions as nobody sends them by intent: encodings, notebooks, archives, names. No ROS needed."""
import bz2
import gzip
import io
import json
import random
import tarfile
import warnings
import zipfile

ENCODINGS = ("utf-8", "undefined", "rot13", "hex", "idna", "punycode", "utf-7", "utf-16", "utf-32-be",
             "unicode_escape", "raw_unicode_escape", "latin-1", "cp1252", "big5hkscs", "iso2022_jp", "charmap",
             "nothing", "mbcs", "x" * 300, "utf-8-sig", "ascii", "utf_8_\ud800")
TEXTS = ("import rospy\n", "# exercise: wave\n", "def f(:\n", "x = '\ud800'\n", "\0", "\x1a", "\r", "\u2028", "\f",
         "é", "print 'x'\n", "x = 0" + "7" * 50 + "\n", "lambda: (yield)\n", "    x\n", "\tx\n", "'''", "\\",
         "(" * 300, "%%bash\n", "%matplotlib\n", "!ls\n", "f'{x!r:{y}}'\n", "return\n", "class A: pass\n",
         "try:\n  pass\nexcept A, e:\n  pass\n", "x: int = 1\n", "from . import a\n", "import a.b.c\n", "1e999\n",
         "9" * 5000 + "\n", "\ufeff", "\U0010ffff", "match x:\n  case _: pass\n", "print('+AD8-')\n",
         "async def g(): await x\n", "del x, y[0]\n", "nonlocal x\n")
NAMES = ("wave.py", "a/b.py", "", "/", "..", "../x.py", "/etc/x.py", "C:x.py", "a//b.py", "./wave.py", "wave.PY",
         "a.ipynb", "a\0.py", "é.py", "\ud8ff.py", "x" * 300 + ".py", "a\n.py", "a\\b.py", ".py", "__MACOSX/a.py",
         "li.zip", "a.tar", "a.py/b.py", "=1+1.py", "<b>.py", "con.py", "a/../b.py", " .py", "joint_command.py",
         "dir/", "\x1b[31m.py")
VALUES = (None, True, 0, -1, 1e999, float("nan"), "", "code", "x\ud800", [], {}, [[]], ["a", 1], {"source": 1},
          10 ** 400)


def program(choose: random.Random) -> bytes:
    """A program in some encoding, with some bytes changed."""
    text = "".join(choose.choices(TEXTS, k=choose.randint(0, 8)))
    if choose.random() < 0.6:
        text = "# -*- coding: %s -*-\n%s" % (choose.choice(ENCODINGS), text)
    encoding = choose.choice(("utf-8", "utf-8", "utf-16", "latin-1", "utf-8-sig"))
    return damaged(choose, text.encode(encoding, "surrogatepass" if encoding.startswith("utf") else "replace"), 0.3)


def notebook(choose: random.Random) -> bytes:
    """A notebook in which parts have other types, or are missing."""
    def part(right):
        return choose.choice(VALUES) if choose.random() < 0.15 else right

    def cell():
        lines = choose.choices(TEXTS, k=choose.randint(0, 5))
        found = {"cell_type": part(choose.choice(("code", "markdown"))), "metadata": part({}),
                 "source": part(choose.choice((lines, "".join(lines))))}
        return {name: value for name, value in found.items() if choose.random() < 0.95}

    text = json.dumps(part({"cells": part([part(cell()) for _ in range(choose.randint(0, 5))]), "metadata": part({})}))
    if choose.random() < 0.05:
        text = choose.choice(("[", '{"cells":')) * choose.choice((10, 100_000)) + text
    return damaged(choose, text.encode("utf-8", "surrogatepass"), 0.2)


def archive(choose: random.Random, depth: int = 0) -> tuple:
    """(name, bytes) of a zip or tar file with such files in it."""
    files = [(choose.choice(NAMES), content(choose, depth + 1)[1]) for _ in range(choose.randint(0, 5))]
    stream = io.BytesIO()
    kind = choose.choice(("zip", "zip", "tar", "tar.gz", "tar.bz2"))
    if kind == "zip":
        _zip(choose, stream, files)
    else:
        _tar(choose, stream, files)
    data = stream.getvalue()
    data = gzip.compress(data, 1) if kind == "tar.gz" else bz2.compress(data, 1) if kind == "tar.bz2" else data
    return "li." + choose.choice((kind, kind, kind, "zip", "tar")), damaged(choose, data, 0.5)


def _zip(choose, stream, files):
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w") as found:
        warnings.simplefilter("ignore")  # of two files of one name
        for name, data in files:
            info = zipfile.ZipInfo("x")
            info.compress_type = choose.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
            info.external_attr = choose.choice((0, 0o100644, 0o120777, 0o060000, 0o177777)) << 16
            found.writestr(info, data)
            info.filename = name.encode("utf-8", "replace").decode()
            if choose.random() < 0.1:
                info.flag_bits |= 1 << choose.randrange(16)


def _tar(choose, stream, files):
    with tarfile.open(fileobj=stream, mode="w", format=choose.choice((tarfile.PAX_FORMAT, tarfile.GNU_FORMAT)),
                      errors="surrogatepass") as found:
        for name, data in files:
            info = tarfile.TarInfo(name)
            info.type = choose.choice((tarfile.REGTYPE, tarfile.REGTYPE, tarfile.SYMTYPE, tarfile.LNKTYPE,
                                       tarfile.FIFOTYPE, tarfile.DIRTYPE, tarfile.CHRTYPE, tarfile.GNUTYPE_SPARSE))
            info.size, info.linkname = len(data), choose.choice(NAMES)
            try:
                found.addfile(info, io.BytesIO(data))
            except (ValueError, UnicodeError):
                continue  # tarfile does not write such names; damage makes some


def damaged(choose: random.Random, data: bytes, share: float) -> bytes:
    """The bytes, in a part of all cases with some changed, cut out or repeated."""
    data = bytearray(data)
    while data and choose.random() < share:
        at = choose.randrange(len(data))
        how = choose.randrange(4)
        if how == 0:
            data[at] = choose.choice((0, 1, 0x7F, 0x80, 0xFF, choose.randrange(256)))
        elif how == 1:
            del data[at:at + choose.randint(1, 40)]
        elif how == 2:
            data[at:at] = data[at:at + choose.randint(1, 40)]
        else:
            del data[at:]
    return bytes(data)


def content(choose: random.Random, depth: int = 0) -> tuple:
    """(name, bytes) of one submission."""
    kind = choose.random()
    if kind < 0.35:
        return choose.choice(NAMES), program(choose)
    if kind < 0.65 or depth > 1:
        return "wave.ipynb", notebook(choose)
    return archive(choose, depth)
