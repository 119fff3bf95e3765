# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh batch-node`: this machine as one of a Ray cluster, until Ctrl-C.

    ./baxter.sh batch-node --head --listen 10.0.0.1         # on one machine; --cpus 0: it only distributes
    ./baxter.sh batch-node --address 10.0.0.1:6379 --listen 10.0.0.2      # on the others
    ./baxter.sh batch JOB --seeds 0:1000 --engine ray --address 10.0.0.1:6379

All machines need this workspace in the same place, the same Python and the same token (docs/security.md).
"""
from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from command_line.options import MAX_WORKERS, Parser, number

from . import ray_engine
from .job import JobError

RAY = (sys.executable, "-m", "ray.scripts.scripts")
PORT = 6379
# Fixed, so that a firewall can name them. Ray draws the others.
FIXED = {"--node-manager-port": 6380, "--object-manager-port": 6381, "--runtime-env-agent-port": 6382,
         "--dashboard-agent-grpc-port": 6383, "--dashboard-agent-listen-port": 6384, "--metrics-export-port": 6385,
         "--min-worker-port": 10002, "--max-worker-port": 10999}


def parse(argv: list[str] | None) -> argparse.Namespace:
    parser = Parser(prog="./baxter.sh batch-node", description=__doc__,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    role = parser.add_mutually_exclusive_group(required=True)
    role.add_argument("--head", action="store_true", help="the machine that the others and batches connect to")
    role.add_argument("--address", metavar="HOST:PORT", help="of the head")
    parser.add_argument("--listen", required=True, metavar="ADDRESS",
                        help="this machine's address in the cluster's network")
    parser.add_argument("--port", type=number(int, 1, 65535), default=PORT, help="of the head (default: %(default)s)")
    parser.add_argument("--cpus", type=number(int, 0, MAX_WORKERS), default=os.cpu_count(), metavar="N",
                        help="episodes at a time on this machine (default: one for each processor, %(default)s)")
    return parser.parse_args(argv)


def command_of(options: argparse.Namespace) -> list[str]:
    """The words of the command `ray start` for the options of :func:`parse`."""
    role = (["--head", "--port", str(options.port), "--include-dashboard", "false"] if options.head
            else ["--address", options.address])
    fixed = [word for name, port in FIXED.items() for word in (name, str(port))]
    return [*RAY, "start", "--block", "--disable-usage-stats", *role,
            "--node-ip-address", options.listen, "--num-cpus", str(options.cpus), *fixed]


def main(argv: list[str] | None = None) -> int:
    options = parse(argv)
    try:
        ray_engine.ensure_installed(Path(os.environ.get("LAB_ROOT", Path.cwd())))
    except JobError as error:
        print("batch-node: %s" % error, file=sys.stderr)
        return 1
    # Without this a head whose user has no token yet would let any machine run code.
    environment = {"RAY_AUTH_MODE": "token", **ray_engine.ENVIRONMENT, **os.environ}
    if options.head:
        made = subprocess.run([*RAY, "get-auth-token", "--generate"], env=environment, capture_output=True, text=True)
        if made.returncode != 0:
            print("batch-node: Ray has no token: %s" % made.stderr.strip(), file=sys.stderr)
            return 1
    words = command_of(options)
    os.execvpe(words[0], words, environment)


if __name__ == "__main__":
    sys.exit(main())
