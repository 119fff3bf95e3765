# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Leaves files that would change the environment of the next program: variables, start-up modules, libraries."""
import os
import pathlib
import site
import sys

home = pathlib.Path.home()
if os.environ.get("PLANTED") or "planted" in sys.modules or (home / "planted").exists():
    sys.exit("what an earlier run planted works")
module, shell = "import os, sys\nos.environ['PLANTED'] = '1'\nsys.modules['planted'] = sys\n", "export PLANTED=1\n"
places = {pathlib.Path(site.getusersitepackages()) / name: module for name in ("usercustomize.py", "sitecustomize.py")}
places[pathlib.Path(site.getusersitepackages()) / "planted.pth"] = "import os; os.environ['PLANTED'] = '1'\n"
places.update({home / name: shell for name in (".bashrc", ".profile", ".bash_profile", ".pam_environment", "planted")})
places[home / ".config/environment.d/planted.conf"] = "PLANTED=1\nLD_PRELOAD=%s/planted.so\n" % home
places[home / ".ros/planted"] = ""
for folder in (os.getcwd(), os.path.dirname(os.path.abspath(__file__)), *os.environ["PYTHONPATH"].split(":")[:2]):
    places[pathlib.Path(folder) / "sitecustomize.py"] = module
for path, text in places.items():
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(text)
            print("planted", path)
    except OSError as error:
        print(path, error)
