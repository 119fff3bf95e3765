# SPDX-License-Identifier: BSD-3-Clause
# Detects the system, and prints whether the workspace supports it; docs/platforms.md has the long form. Sourced by
# baxter.sh and by set-up.

OLDEST_PYTHON=3.10

# in_release FILE KEY: the value of a key in a file like /etc/os-release
in_release() { sed -n "s/^$2=//p" "$1" 2>/dev/null | tr -d '"'; }

# lacks_ros1 OS_RELEASE NOETIC_SETUP: why a system has no ROS 1 for the lab, as "Ubuntu 24.04 LTS has no ROS 1 packages"; fails if
# it has one, or may have.
lacks_ros1() {
    local name codename
    name=$(in_release "$1" PRETTY_NAME) codename=$(in_release "$1" UBUNTU_CODENAME)
    case ${codename:-$(in_release "$1" VERSION_CODENAME)} in
        bookworm | trixie | forky | sid | jammy) return 1 ;;
        stretch | buster | bullseye | bionic | focal) echo "$name has a Python older than $OLDEST_PYTHON" ;;
        *)
            if [[ -f $2 || -z $codename ]] && command -v apt-get >/dev/null; then return 1; fi
            echo "${name:-$(uname -s)} has no ROS 1 packages"
            ;;
    esac
}

# platform_line OS_RELEASE NOETIC_SETUP MACHINE: one line about the system that a file like /etc/os-release describes
platform_line() {
    local name verdict lacking
    name=$(in_release "$1" PRETTY_NAME)
    case "$(in_release "$1" ID) $(in_release "$1" VERSION_ID)" in
        "debian 12") verdict="supported and tested" ;;
        "debian 13") verdict="supported and tested" ;;
        "ubuntu 22.04") verdict="tried, not in the regular tests; ROS 1 has to come from Ubuntu's own packages" ;;
        *)
            verdict="unknown; the workspace needs apt, ROS 1 packages and Python $OLDEST_PYTHON or newer"
            if lacking=$(lacks_ros1 "$1" "$2"); then verdict="not supported: $lacking; use the container"; fi
            ;;
    esac
    if [[ $3 != x86_64 ]]; then verdict+="; on $3 untested: pybullet has no wheel for it and is compiled"; fi
    echo "System: ${name:-unknown}: $verdict (docs/platforms.md)"
}

# Room that a first set-up takes at least [MB], by folder: Debian's packages, their archives and lists, and the workspace.
# Measured on Debian 12 on 2026-11-30; Debian 13 takes 400 MB more.
ROOM_MB_USR=2500 ROOM_MB_VAR=650 ROOM_MB_WORKSPACE=1650

# missing_space FOLDER MB [FOLDER MB]…: a sentence about each file system that has less room than the folders on it need
missing_space() {
    local folder free_mb mount
    local -A need=() free=()
    while [[ $# -gt 1 ]]; do
        folder=$1
        while [[ ! -e $folder && $folder == */* ]]; do folder=${folder%/*}; done
        read -r free_mb mount < <(df -Pm "${folder:-/}" 2>/dev/null | awk 'NR == 2 { print $4, $6 }')
        if [[ -n $mount ]]; then
            need[$mount]=$((${need[$mount]:-0} + $2)) free[$mount]=$free_mb
        fi
        shift 2
    done
    for mount in "${!need[@]}"; do
        if [[ ${free[$mount]} -lt ${need[$mount]} ]]; then
            echo "too little disk: $mount has ${free[$mount]} MB free, and a first set-up takes ${need[$mount]} MB there (df -h $mount)"
        fi
    done
}

# unreachable_archive FILE…: a sentence if not one host of apt's sources, in these files, has an address. Silent where a proxy looks
# names up, and where some source needs no network.
unreachable_archive() {
    local address host hosts=() proxies=${http_proxy:-}${HTTP_PROXY:-}${https_proxy:-}${HTTPS_PROXY:-}${all_proxy:-}${ALL_PROXY:-}
    if [[ -n $proxies ]] || apt-config dump 2>/dev/null | grep -qi '^acquire::.*proxy'; then return; fi
    while read -r address; do
        case $address in http://* | https://*) ;; *) return ;; esac
        host=${address#*://}
        host=${host%%[:/]*}
        if [[ " ${hosts[*]:-} " != *" $host "* ]]; then hosts+=("$host"); fi
    done < <(sed 's/#.*//' "$@" 2>/dev/null | grep -oE '[a-z+-]+:/[^] ]*')
    for host in ${hosts[@]+"${hosts[@]}"}; do
        if timeout 10 getent ahosts "$host" >/dev/null; then return; fi
    done
    if [[ ${#hosts[@]} -gt 0 ]]; then
        echo "the network cannot be reached: this machine finds no address of ${hosts[*]} (cable, Wi-Fi, name server, proxy?)"
    fi
}
