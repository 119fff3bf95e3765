# SPDX-License-Identifier: BSD-3-Clause
# The lab on systems without ROS 1: every mode of baxter.sh runs in a container, on the workspace and the home at their own paths,
# as the user. Sourced by baxter.sh. The old bash of macOS reads this file, too.
#
# Each command has its own container. All of them share the host's network, processes, shared memory and /tmp, so that several
# terminals work as on one system. The container is there for Debian's packages, not as a wall.

# Names of variables that a command inside sees, too.
PASSED_ON='ROS_.*|ROSCONSOLE_.*|PIP_.*|LAB_.*|BULLET_.*|NUMBA_.*|RAY_.*|BENCH_.*|TORTURE_.*|LIBGL_.*|QT_.*|MESA_.*|LP_NUM_THREADS'
PASSED_ON+='|NPM_CONFIG_REGISTRY|http_proxy|https_proxy|no_proxy|all_proxy|HTTP_PROXY|HTTPS_PROXY|NO_PROXY|ALL_PROXY|DISPLAY'
PASSED_ON+='|XAUTHORITY|WAYLAND_DISPLAY|XDG_RUNTIME_DIR|XDG_CACHE_HOME|XDG_STATE_HOME|TMPDIR|TERM|COLORTERM'

# wants_container: is this machine one on which the lab runs in a container? Sets container_reason.
wants_container() {
    container_reason=""
    case ${BAXTER_CONTAINER:-} in
        0) return 1 ;;
        1) container_reason="BAXTER_CONTAINER is 1" ;;
        "") container_reason=$(lacks_ros1 /etc/os-release /opt/ros/noetic/setup.bash) ;;
        *)
            container_reason="BAXTER_CONTAINER is '$BAXTER_CONTAINER', which is neither 0 (never) nor 1 (always)"
            return 2
            ;;
    esac
}

# container_engine: podman or docker; fails without either
container_engine() {
    local name
    for name in podman docker; do
        if command -v "$name" >/dev/null; then echo "$name" && return; fi
    done
    return 1
}

# podman_line: the command that installs podman on this system
podman_line() {
    local entry sudo="sudo "
    if [[ $(id -u) == 0 ]]; then sudo=""; fi
    for entry in "apt:apt install podman" "dnf:dnf install podman" "zypper:zypper install podman" "pacman:pacman -S podman" \
        "apk:apk add podman"; do
        if command -v "${entry%%:*}" >/dev/null; then echo "$sudo${entry#*:}" && return; fi
    done
    if command -v brew >/dev/null; then
        echo "brew install podman && podman machine init --now"
    else
        echo "see https://podman.io/docs/installation"
    fi
}

# container_image: the image's name, which changes with the files it is made from; BAXTER_IMAGE names a ready one.
container_image() {
    local sum
    sum=$(cd "$LAB_ROOT" && cat docker/Dockerfile docker/package_mirror.pl docker/certificates/* tools/apt_packages.txt 2>/dev/null | cksum)
    echo "${BAXTER_IMAGE:-localhost/baxter-lab-system:${sum%% *}}"
}

# use_container MODE [WORD…]: on a machine that wants it, replace this process by the mode in a container. Returns 0 elsewhere.
use_container() {
    local engine image status=0
    wants_container || status=$?
    if [[ $status == 1 ]]; then return 0; fi
    if [[ $status == 2 ]]; then echo "baxter.sh: $container_reason" >&2 && return 2; fi
    if ! engine=$(container_engine); then
        echo "baxter.sh: $container_reason, and the lab needs it: with podman, everything runs in a container. This command installs" \
             "it; then try again:" >&2
        echo "  $(podman_line)" >&2
        return 1
    fi
    image=$(container_image)
    if ! "$engine" image inspect "$image" >/dev/null 2>&1; then
        if [[ $1 == doctor ]]; then
            echo "$container_reason, and the image for $engine has not been made yet. fix: ./baxter.sh setup"
            return 1
        fi
        if [[ -n ${BAXTER_IMAGE:-} ]]; then
            "$engine" pull "$image" >&2 || return
        else
            echo "baxter.sh: $container_reason, so everything runs in a container; $engine makes its image now, once" \
                 "(some minutes, 3 GB)." >&2
            build_image "$engine" "$image" >&2 || return
        fi
    fi
    run_container "$engine" "$image" "$@"
}

# build_image ENGINE IMAGE
build_image() {
    local name arguments=()
    for name in BASE_IMAGE DEBIAN_MIRROR PIP_INDEX_URL; do
        if [[ -n ${!name:-} ]]; then arguments+=(--build-arg "$name=${!name}"); fi
    done
    "$1" build --network host ${arguments[@]+"${arguments[@]}"} --target system -t "$2" -f "$LAB_ROOT/docker/Dockerfile" "$LAB_ROOT"
}

# run_container ENGINE IMAGE WORD…: replace this process by baxter.sh WORD… in a container.
run_container() {
    local engine=$1 image=$2 folder name place=$PWD mounted=() options
    shift 2
    options=(run --rm --interactive --network host --pid host --entrypoint "$LAB_ROOT/baxter.sh")
    # Podman takes the host's message queues for --ipc host; a WSL without systemd has none.
    if [[ -d /dev/mqueue || ! -d /dev/shm ]]; then options+=(--ipc host); else options+=(--volume /dev/shm:/dev/shm); fi
    if [[ -t 0 && -t 1 ]]; then options+=(--tty); fi
    if [[ $(uname -s) == Darwin ]]; then options+=(--platform linux/amd64); fi
    if "$engine" --version 2>/dev/null | grep -qi podman; then
        # Without root, --privileged gives no rights but the user's own: devices, and sandboxes for checked programs.
        options+=(--privileged --security-opt label=disable)
        if [[ $(id -u) != 0 ]]; then options+=(--userns keep-id); fi
    else
        options+=(--security-opt seccomp=unconfined --security-opt apparmor=unconfined --security-opt label=disable
            --security-opt systempaths=unconfined)
        if "$engine" info --format '{{.SecurityOptions}}' 2>/dev/null | grep -q rootless; then
            options+=(--user 0:0)
        else
            options+=(--user "$(id -u):$(id -g)")
            for name in $(id -G); do options+=(--group-add "$name"); done
            write_accounts && options+=(--volume "$LAB_ROOT/.baxter/accounts:/etc/passwd:ro")
        fi
        if [[ -d /dev/dri ]]; then options+=(--device /dev/dri); fi
    fi
    case $place in
        / | /bin* | /boot* | /dev* | /etc* | /lib* | /opt* | /proc* | /root | /sbin* | /sys* | /usr* | /var | /var/lib*) place=$LAB_ROOT ;;
    esac
    for folder in "$HOME" "$LAB_ROOT" "$place" /tmp "${XDG_RUNTIME_DIR:-}" /mnt/wslg; do
        if [[ $folder != /?* || ! -d $folder ]]; then continue; fi
        for name in ${mounted[@]+"${mounted[@]}"}; do
            if [[ $folder/ == "$name"/* ]]; then continue 2; fi
        done
        mounted+=("$folder")
        options+=(--volume "$folder:$folder")
    done
    options+=(--workdir "$place" --env "HOME=$HOME" --env BAXTER_CONTAINER=0 --env QT_X11_NO_MITSHM=1)
    if [[ ! -d /dev/dri ]]; then options+=(--env "LIBGL_ALWAYS_SOFTWARE=${LIBGL_ALWAYS_SOFTWARE:-1}"); fi
    for name in $(compgen -e); do
        if [[ $name =~ ^($PASSED_ON)$ ]]; then options+=(--env "$name"); fi
    done
    if [[ -z ${DISPLAY:-}${WAYLAND_DISPLAY:-} && "$1 ${2:-}" == "sim roslaunch" ]]; then
        echo "baxter.sh: there is no screen here; ./baxter.sh web in a second terminal shows the robot in a browser." >&2
    fi
    exec "$engine" "${options[@]}" "$image" "$@"
}

# write_accounts: the user's name for programs inside; docker knows numbers only.
write_accounts() {
    mkdir -p "$LAB_ROOT/.baxter" &&
        printf 'root:x:0:0:root:/root:/bin/bash\n%s:x:%s:%s::%s:/bin/bash\n' "$(id -un)" "$(id -u)" "$(id -g)" "$HOME" \
            >"$LAB_ROOT/.baxter/accounts"
}
