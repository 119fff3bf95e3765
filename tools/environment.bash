# SPDX-License-Identifier: BSD-3-Clause
# The workspace's environment, as functions. Sourced by baxter.sh; LAB_ROOT names the workspace.

DEFAULT_MASTER_URI=http://localhost:11311
# The folders of src whose packages are the lab's; all others are the user's own.
LAB_FOLDERS=(base baxter classroom compat courses lab lab_testing overlay planning probot ros_control simulator web workspace_tests)

# host_of URI: the host in http://host:port/
host_of() {
    local rest=${1#*://}
    rest=${rest%%/*}
    echo "${rest%:*}"
}

# is_loopback HOST: does the name or address mean this machine, and only this machine?
is_loopback() {
    case $1 in
        localhost | 127.* | '[::1]' | ::1) return 0 ;;
        *) return 1 ;;
    esac
}

# Simulator on this machine: all nodes announce themselves as localhost and so listen on 127.0.0.1 only.
use_loopback() {
    if [[ -z ${ROS_MASTER_URI:-} ]] || ! is_loopback "$(host_of "$ROS_MASTER_URI")"; then
        ROS_MASTER_URI=$DEFAULT_MASTER_URI
    fi
    unset ROS_IP
    export ROS_MASTER_URI ROS_HOSTNAME=localhost
}

# use_public [ADDRESS]: the simulator on this machine, for other machines too: all nodes announce an address that they
# can connect to: ADDRESS, or ROS_IP or ROS_HOSTNAME if set, or this machine's address in its network.
use_public() {
    local address=${1:-} variable=ROS_IP port=11311 there=
    if [[ -z $address && -n ${ROS_HOSTNAME:-} ]] && ! is_loopback "$ROS_HOSTNAME"; then
        address=$ROS_HOSTNAME variable=ROS_HOSTNAME
    elif [[ -z $address && -n ${ROS_IP:-} ]] && ! is_loopback "$ROS_IP"; then
        address=$ROS_IP
    fi
    if [[ -z $address ]]; then
        # The route to any external address shows our own address; no packet is sent. Without a route, the first
        # address.
        address=$(ip -4 route get 192.0.2.1 2>/dev/null | sed -n 's/.* src \([0-9.]*\).*/\1/p')
        [[ -n $address ]] || address=$(ip -4 -o address show scope global | sed -n '1s/.* inet \([0-9.]*\).*/\1/p')
    fi
    if [[ -z $address ]]; then
        echo "baxter.sh: this machine has no address that other machines could reach. Connect it to a network, or use" \
             "sim without --public." >&2
        return 2
    fi
    if is_loopback "$(host_of "${ROS_MASTER_URI:-}")" || [[ $(host_of "${ROS_MASTER_URI:-}") == "$address" ]]; then
        port=${ROS_MASTER_URI##*:}
        port=${port%%/*}
    fi
    unset ROS_IP ROS_HOSTNAME
    export ROS_MASTER_URI=http://$address:$port "$variable=$address"
    if [[ $port != 11311 ]]; then there="ROS_MASTER_URI=$ROS_MASTER_URI "; fi
    echo "Open to every machine that reaches $address (docs/security.md). There: $there./baxter.sh $address" >&2
}

# use_robot HOST: a master on another machine, which must be able to connect to the address that we announce. The port of a
# ROS_MASTER_URI that names HOST is kept.
use_robot() {
    local host=$1 address source_address
    address=$(getent ahostsv4 "$host" | awk '{ print $1; exit }')
    if [[ -z $address ]]; then
        echo "baxter.sh: '$host' is neither a command of this script (try ./baxter.sh help) nor a host name or" \
             "IPv4 address that this machine can resolve. Add the robot to /etc/hosts or give its address." >&2
        return 2
    fi
    [[ $(host_of "${ROS_MASTER_URI:-}") == "$host" ]] || ROS_MASTER_URI=http://$host:11311
    export ROS_MASTER_URI
    # A loopback name is a left-over of sim mode; no robot could connect to it.
    if [[ -n ${ROS_HOSTNAME:-} ]] && is_loopback "$ROS_HOSTNAME"; then unset ROS_HOSTNAME; fi
    if [[ -n ${ROS_IP:-} ]] && is_loopback "$ROS_IP"; then unset ROS_IP; fi
    if [[ -n ${ROS_IP:-}${ROS_HOSTNAME:-} ]]; then
        return 0
    fi
    # Before the first set-up of a minimal system there is no ip; the caller asks again after it.
    command -v ip >/dev/null || return 0
    source_address=$(ip -4 route get "$address" 2>/dev/null | sed -n 's/.* src \([0-9.]*\).*/\1/p')
    if [[ -z $source_address ]]; then
        echo "baxter.sh: no route to $host ($address). Connect to the robot's network, or set ROS_IP yourself." >&2
        return 2
    fi
    export ROS_IP=$source_address
}

# own_folders: the folders of src that are not the lab's and have packages, one per line
own_folders() {
    local folder
    for folder in "$LAB_ROOT"/src/*/; do
        folder=${folder%/} folder=${folder##*/}
        [[ $folder != '*' && " ${LAB_FOLDERS[*]} " != *" $folder "* ]] || continue
        if [[ -n $(find -L "$LAB_ROOT/src/$folder" -name package.xml -print -quit) ]]; then echo "$folder"; fi
    done
}

# A hash of everything that a build of the user's own packages reads; empty if there are none.
own_fingerprint() {
    local folders
    mapfile -t folders < <(own_folders)
    [[ ${#folders[@]} -gt 0 ]] || return 0
    (cd "$LAB_ROOT/src" && find -L "${folders[@]}" \( -name __pycache__ -o -name .git \) -prune -o -type f \( -name package.xml \
        -o -name CMakeLists.txt -o -name setup.py -o -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name '*.cfg' \
        -o -path '*/env-hooks/*' \) -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum)
}

# system_name: what a build and a virtual environment are made for; in a container it is another one than outside.
system_name() { sed -n 's/^\(ID\|VERSION_CODENAME\)=//p' /etc/os-release 2>/dev/null | LC_ALL=C sort | paste -sd ' '; }

# A hash of everything whose change makes an earlier set-up stale; the user's own packages do not count. The workspace's
# own path counts too: virtual environments and catkin build folders cannot be moved.
fingerprint() {
    local folder folders=()
    for folder in "${LAB_FOLDERS[@]}"; do
        if [[ -d $LAB_ROOT/src/$folder ]]; then folders+=("src/$folder"); fi
    done
    # The order of the files must not depend on the user's language. -H: some folders of src are links.
    {
        echo "$LAB_ROOT"
        system_name
        cd "$LAB_ROOT" && find -H requirements*.txt tools/*.txt tools/setup.bash ${folders[@]+"${folders[@]}"} $([[ -d src_overlay ]] && echo src_overlay) \
            \( -name meshes -o -name __pycache__ -o -name .git \) -prune -o \
            -type f \( -name package.xml -o -name CMakeLists.txt -o -name setup.py -o -name '*.msg' -o -name '*.srv' \
                -o -name '*.action' -o -name '*.cfg' -o -name '*.xacro' -o -path '*/env-hooks/*' \
                -o -name 'requirements*.txt' -o -path 'tools/*' \) -print0 | LC_ALL=C sort -z | xargs -0 sha256sum
    } | sha256sum
}

# loops_are_compiled: are the inner loops what the last set-up compiled? Else each node that needs them would compile them
# for itself, for two minutes.
loops_are_compiled() {
    local sums=$LAB_ROOT/.baxter/kernels.sums
    [[ ! -s $sums ]] || sha256sum --check --status "$sums" 2>/dev/null
}

# is_set_up FINGERPRINT: does everything exist that the lab needs? A set-up that runs in another shell on unchanged
# files removes nothing; an interrupted one may have removed files.
is_set_up() {
    local state=$LAB_ROOT/.baxter
    [[ -f $state/done && -f $LAB_ROOT/devel/setup.bash && -x $LAB_ROOT/.venv/bin/python3 && $(<"$state/done") == "$1" ]] ||
        return 1
    loops_are_compiled || return 1
    [[ ! -f $state/at_work ]] || ! flock -n "$state/lock" true
}

# set_up_progress: where the running set-up is, as ", in step 6 of 9 (catkin_make) since 40 s"; nothing if that is unknown
set_up_progress() {
    local since place title
    IFS=$'\t' read -r since place title 2>/dev/null <"$LAB_ROOT/.baxter/progress" || return 0
    echo ", in step $place ($title) since $(($(date +%s) - since)) s"
}

# bring_up_to_date [--strict] [COMMAND…]: build everything that COMMAND needs, of the lab and of the user's own
# packages.
bring_up_to_date() {
    local strict=()
    if [[ ${1:-} == --strict ]]; then strict=(--strict) && shift; fi
    set_up_the_lab "${strict[@]}" || return
    build_own ${strict[@]+"${strict[@]}"} "$@" || [[ ${#strict[@]} -eq 0 ]]
}

# names_own WORD…: does one of the words name a package of the user's own, or a path into one?
names_own() {
    local word folder folders
    mapfile -t folders < <(own_folders)
    for word in "$@"; do
        for folder in "${folders[@]}"; do
            [[ "$PWD/" == "$LAB_ROOT/src/$folder/"* || "/$word/" == *"/src/$folder/"* ]] && return 0
            grep -qsrF --include=package.xml "<name>$word</name>" "$LAB_ROOT/src/$folder" && return 0
        done
    done
    return 1
}

# build_own [--strict] [COMMAND…]: build only the user's own packages that have changed. A command that runs one of the
# lab's packages does not wait for that; while another shell builds, only a command that names such a package waits.
build_own() {
    local strict="" state=$LAB_ROOT/.baxter now status=0 folders
    if [[ ${1:-} == --strict ]]; then strict=yes && shift; fi
    now=$(own_fingerprint)
    if [[ -z $now || -f $state/own_done && $(<"$state/own_done") == "$now" ]]; then return 0; fi
    mapfile -t folders < <(own_folders)
    # Before anything else runs, for nothing else says it; its sentences do not stop a shell in which to mend it.
    if ! [[ -f $state/own_sound && $(<"$state/own_sound") == "$now" ]]; then
        if /usr/bin/python3 "$LAB_ROOT/tools/own_manifests.py" "$LAB_ROOT" "${folders[@]}" </dev/null; then
            printf '%s\n' "$now" >"$state/own_sound"
        else
            printf '%s\n' "$now" >"$state/own_failed"
            [[ -z $strict ]]
            return
        fi
    fi
    if [[ -z $strict ]] && ! names_own "$@"; then
        case ${1:-} in rosrun | roslaunch | rosnode | rosservice | rosparam | rviz | roscore) return 0 ;; esac
        if [[ -f $state/own_failed && $(<"$state/own_failed") == "$now" ]]; then
            echo "baxter.sh: a package of your own does not build; continuing without it. Its log: .baxter/logs/own-NAME.log" >&2
            return 0
        fi
        exec 8>>"$state/own_lock"
        flock -n 8 || {
            echo "baxter.sh: another shell is building a package; continuing with the previous build." >&2
            exec 8>&-
            return 0
        }
    else
        exec 8>>"$state/own_lock"
        flock -n 8 || { echo "another shell is building a package of your own; waiting for it to finish" >&2; flock 8; }
        if [[ -f $state/own_done && $(<"$state/own_done") == "$now" ]]; then exec 8>&- && return 0; fi
    fi
    (use_build && exec /usr/bin/python3 "$LAB_ROOT/tools/own_packages.py" "$LAB_ROOT" "${folders[@]}") >&2 8>&- </dev/null ||
        status=$?
    if [[ $status -eq 0 ]]; then printf '%s\n' "$now" >"$state/own_done"; else printf '%s\n' "$now" >"$state/own_failed"; fi
    exec 8>&-
    return "$status"
}

# set_up_the_lab [--strict]: set up what is missing or stale. With an earlier build, a failure does not block its use (a
# student needs a shell to repair a package that does not configure), unless --strict requires an error.
set_up_the_lab() {
    local state=$LAB_ROOT/.baxter now status=0
    now=$(fingerprint)
    if is_set_up "$now"; then return 0; fi
    if [[ ${1:-} == --strict ]] || ! has_earlier_build || [[ ! -f $state/failed || $(<"$state/failed") != "$now" ]]; then
        # Set-up talks on standard error: the output of a command in this environment belongs to the command.
        bash "$LAB_ROOT/tools/setup.bash" >&2 </dev/null || status=$?
        if [[ $status -eq 0 ]]; then return 0; fi
        if [[ $status -eq 130 || ${1:-} == --strict ]] || ! has_earlier_build; then return "$status"; fi
        # A failed set-up fails again; not every command should wait for it.
        printf '%s\n' "$now" >"$state/failed"
    fi
    echo "baxter.sh: set-up has failed; continuing with the previous build. ./baxter.sh setup tries again." >&2
}

has_earlier_build() {
    [[ -f $LAB_ROOT/.baxter/build.stamp && -f $LAB_ROOT/devel/setup.bash && -x $LAB_ROOT/.venv/bin/python3 ]]
}

# Use the environment of the built workspace; its hooks put the virtual environment first in PATH.
use_build() {
    # Left-over settings of another workspace would be chained in front of ours.
    unset CMAKE_PREFIX_PATH ROS_PACKAGE_PATH PYTHONPATH PYTHONHOME ROS_DISTRO
    # shellcheck disable=SC1091
    source "$LAB_ROOT/devel/setup.bash"
}

use_build_if_there() {
    if [[ -f $LAB_ROOT/devel/setup.bash ]]; then use_build; fi
}

# Whether a folder can be written to, or made.
can_write() {
    local folder=$1
    while [[ ! -e $folder && $folder == */* ]]; do folder=${folder%/*}; done
    [[ -d ${folder:-/} && -w ${folder:-/} ]]
}

# Where the home is read-only, or sudo has made folders in it root's, ROS and our caches use a folder of temporary files:
# roslaunch would end with several tracebacks. A line says which folder it is, and what mends it.
use_writable_folders() {
    local home=${ROS_HOME:-$HOME/.ros} spare folder
    for folder in "$home" "${ROS_LOG_DIR:-$home/log}" "${XDG_CACHE_HOME:-$HOME/.cache}"; do
        can_write "$folder" && continue
        spare=${TMPDIR:-/tmp}/baxter_home_$(id -u)
        if ! mkdir -p -m 700 "$spare" || [[ ! -O $spare || ! -w $spare ]]; then
            echo "baxter.sh: you can write neither to $folder nor to $spare, so ROS cannot start: it keeps its logs there." \
                 "Set HOME or ROS_HOME to a folder of yours" >&2
            return
        fi
        echo "baxter.sh: you cannot write to $folder; what would be kept there, such as logs, goes to $spare. If it is" \
             "root's, make it yours: sudo chown -R $(id -un) '$folder'. If your home is read-only, set HOME to a folder" \
             "of yours" >&2
        can_write "${ROS_LOG_DIR:-$home/log}" || export ROS_LOG_DIR=$spare/log
        can_write "$home" || export ROS_HOME=$spare
        can_write "${XDG_CACHE_HOME:-$HOME/.cache}" || export XDG_CACHE_HOME=$spare/cache
        return
    done
}
