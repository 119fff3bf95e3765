#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The kernel of the labs' notebooks: the workspace's Python in the workspace's environment, wherever Jupyter runs.
LAB_ROOT=$(cd -P "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
export LAB_ROOT
# shellcheck source=environment.bash
source "$LAB_ROOT/tools/environment.bash"
use_loopback
use_build || exit
# Errors only: the kernel warns about open ports, but on this machine only root can read its traffic.
exec python3 -m ipykernel_launcher --IPKernelApp.log_level=ERROR "$@"
