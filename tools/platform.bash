# SPDX-License-Identifier: BSD-3-Clause
# Detects the system, and prints whether the workspace supports it; docs/platforms.md has the long form. Sourced by
# set-up.

OLDEST_PYTHON=3.10

# platform_line OS_RELEASE NOETIC_SETUP MACHINE: one line about the system that a file like /etc/os-release describes
platform_line() {
    local name verdict
    name=$(sed -n 's/^PRETTY_NAME=//p' "$1" 2>/dev/null | tr -d '"')
    case $(sed -n 's/^\(ID\|VERSION_ID\)=//p' "$1" 2>/dev/null | tr -d '"' | sort -r | paste -sd ' ') in
        "debian 12") verdict="supported and tested" ;;
        "debian 13") verdict="tried, not in the regular tests" ;;
        "ubuntu 22.04") verdict="tried, not in the regular tests; ROS 1 has to come from Ubuntu's own packages" ;;
        "ubuntu 24.04" | "ubuntu 26.04") verdict="not supported: it has no ROS 1 packages; use the container" ;;
        "ubuntu 20.04")
            verdict="not supported: its Python is 3.8, the pinned packages need $OLDEST_PYTHON"
            if [[ -f $2 ]]; then verdict+="; ros-noetic is installed and not used"; fi
            ;;
        *) verdict="unknown; the workspace needs apt, ROS 1 packages and Python $OLDEST_PYTHON or newer" ;;
    esac
    if [[ $3 != x86_64 ]]; then verdict+="; on $3 untested: pybullet has no wheel for it and is compiled"; fi
    echo "System: ${name:-unknown}: $verdict (docs/platforms.md)"
}
