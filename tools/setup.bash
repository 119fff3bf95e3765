#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Install and build what the workspace needs, step by step; finished steps are skipped.
# Needs bash, apt and coreutils only: on a minimal Debian everything else is what this script installs.
set -uo pipefail

export LAB_ROOT
LAB_ROOT=$(cd -P "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck source=environment.bash
source "$LAB_ROOT/tools/environment.bash"
# shellcheck source=stand_ins.bash
source "$LAB_ROOT/tools/stand_ins.bash"
# shellcheck source=overlay.bash
source "$LAB_ROOT/tools/overlay.bash"
# shellcheck source=platform.bash
source "$LAB_ROOT/tools/platform.bash"
CALLED_FROM=$PWD
cd "$LAB_ROOT" || exit 1

STATE=$LAB_ROOT/.baxter
VENV=$LAB_ROOT/.venv
NOETIC=/opt/ros/noetic/setup.bash
DESCRIPTION=$LAB_ROOT/src/baxter/baxter_common/baxter_description
GRIPPERS=$LAB_ROOT/src/baxter/baxter_common/rethink_ee_description
STEPS=(apt venv overlay pip meshes build urdf kernels pictures)
# Robots whose collision spheres are computed in advance, so that the first plan need not wait.
PLANNED_FOR=("$DESCRIPTION/urdf/baxter.urdf.xacro" "$LAB_ROOT/src/probot/probot_description/urdf/probot_anno.xacro")
# What their servos need besides.
SERVO=$LAB_ROOT/src/planning/moveit_servo/config
PREPARE_SERVOS="rosrun moveit_servo prepare_servo $(printf '%q ' "${PLANNED_FOR[0]}" \
    "$LAB_ROOT/src/baxter/baxter_moveit_config/config/baxter.srdf.xacro" "$SERVO/baxter.yaml") && \
    rosrun moveit_servo prepare_servo $(printf '%q ' "${PLANNED_FOR[1]}" \
    "$LAB_ROOT/src/probot/probot_anno_moveit_config/config/probot_anno.srdf" "$SERVO/probot.yaml")"
# Python packages with compiled inner loops: `python3 -m NAME` fills their cache. Those in one group have code in common
# and run one after the other, the groups beside each other. The collision spheres are cached beside the compiled code.
COMPILED=("python3 -m arm_kinematics && python3 -m baxter_sim_hardware && python3 -m baxter_sysid"
    "python3 -m motion_planning && python3 -m moveit_servo && rosrun motion_planning prepare_robots $(printf '%q ' "${PLANNED_FOR[@]}") && $PREPARE_SERVOS")
# Robots whose meshes are made ready for pictures.
PICTURED=("${PLANNED_FOR[@]}" "$LAB_ROOT/src/courses/cwru_baxter_sim/cwru_baxter.urdf.xacro")
PREPARE_PICTURES="timeout 900 python3 -m sensor_renderer.prepare $(printf '%q ' "${PICTURED[@]}")"
declare -A TITLES=(
    [apt]="Debian packages"
    [venv]="virtual environment"
    [pip]="Python packages"
    [meshes]="Baxter's meshes"
    [overlay]="other people's packages"
    [build]="catkin_make"
    [urdf]="baxter.urdf"
    [kernels]="compiled inner loops"
    [pictures]="robots for pictures"
)
# shellcheck source=setup_run.bash
source "$LAB_ROOT/tools/setup_run.bash"

# A step does its work only if its stamp does not hold the given key; step_done writes it.
stamp_is() { [[ -f $STATE/$step_name.stamp && $(<"$STATE/$step_name.stamp") == "$1" ]]; }
stamp() { write "$STATE/$step_name.stamp" "$1"; }
hash_of() { sha256sum "$@" 2>/dev/null | sha256sum; }

# --- the steps --------------------------------------------------------------------------------------------------------

# Packages of tools/apt_packages.txt that are not installed, one per line. Before `apt-get update` the system lists no
# optional ones.
missing_packages() {
    local have wanted name kind
    mapfile -t wanted < <(sed 's/#.*//' tools/apt_packages.txt | while read -r name kind; do
        if [[ -z $name || $kind == ros && -f $NOETIC ]]; then continue; fi
        if [[ $kind == optional ]] && ! apt-cache show "$name" >/dev/null 2>&1; then continue; fi
        echo "$name"
    done)
    have=$(dpkg-query -W -f '${db:Status-Abbrev}${Package}\n' "${wanted[@]}" 2>/dev/null | sed -n 's/^ii *//p')
    LC_ALL=C comm -23 <(printf '%s\n' "${wanted[@]}" | LC_ALL=C sort) <(LC_ALL=C sort <<<"$have")
}

# Checked first, to avoid a useless download of a gigabyte.
require_python() {
    /usr/bin/python3 -c "import sys; sys.exit(sys.version_info < (${OLDEST_PYTHON/./, }))" 2>>"$step_log" ||
        refuse "the packages in requirements.txt need Python $OLDEST_PYTHON or newer; this is $(/usr/bin/python3 --version)"
}

# require_space PACKAGES: refuse what cannot fit, before anything is fetched
require_space() {
    local room=() too_little
    # Without most of the packages of the list, the machine is fresh.
    if [[ $1 -gt $(($(grep -vc '^#' tools/apt_packages.txt) / 2)) ]]; then room+=(/usr "$ROOM_MB_USR" /var/cache "$ROOM_MB_VAR"); fi
    if [[ ! -d $VENV ]]; then room+=("$LAB_ROOT" "$ROOM_MB_WORKSPACE"); fi
    too_little=$(missing_space "${room[@]}")
    [[ -z $too_little ]] || refuse "$too_little"
}

step_apt() {
    local missing unreachable as_root=()
    if [[ -x /usr/bin/python3 ]]; then require_python; fi
    mapfile -t missing < <(missing_packages)
    require_space "${#missing[@]}"
    if [[ ${#missing[@]} -eq 0 ]]; then
        note="all there"
        return
    fi
    unreachable=$(unreachable_archive /etc/apt/sources.list /etc/apt/sources.list.d/*)
    [[ -z $unreachable ]] || refuse "$unreachable"
    command -v apt-get >/dev/null || refuse "this machine has no apt-get; install these yourself: ${missing[*]}"
    if [[ $EUID -ne 0 ]]; then
        command -v sudo >/dev/null || refuse "not root, and no sudo. As root: apt-get install ${missing[*]}"
        # Ask for the password here, where the prompt is visible: the commands below write to the log.
        sudo -v || refuse "sudo was refused. As root: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    as_root+=(env DEBIAN_FRONTEND=noninteractive)
    # A service that a package starts must not keep set-up's lock.
    {
        run wait_for_apt
        # After a killed installation, apt refuses to continue by itself.
        run "${as_root[@]}" sh -c 'dpkg --configure -a || echo "the rest is for --fix-broken"'
        run "${as_root[@]}" apt-get update
        mapfile -t missing < <(missing_packages)
        run "${as_root[@]}" apt-get install -y --no-install-recommends --fix-broken
        run "${as_root[@]}" apt-get install -y --no-install-recommends "${missing[@]}"
    } 9>&-
    note="${#missing[@]} requested"
}

# Wait until no other program installs packages: a background update, or a process of a killed set-up.
wait_for_apt() {
    local file inodes=()
    for file in /var/lib/dpkg/lock-frontend /var/lib/dpkg/lock /var/lib/apt/lists/lock; do
        if [[ -e $file ]]; then inodes+=(-e ":$(stat -c %i "$file") "); fi
    done
    for _ in {1..300}; do
        if [[ ${#inodes[@]} -eq 0 ]] || ! grep -qF "${inodes[@]}" /proc/locks; then return 0; fi
        echo "waiting for another program that installs packages"
        sleep 2
    done
    echo "E: another program has been installing packages for ten minutes; find it with: ps -ef | grep -E 'apt|dpkg'"
    return 1
}

# With the virtual environment's Python, installed executables get a first line that finds its packages.
# -j without -l, which catkin_make would add: on a busy machine make would then wait for other processes.
build_all() { catkin_make "-DPYTHON_EXECUTABLE=$VENV/bin/python3" "-j$(nproc)" "$@"; }

# The first configuration takes one core for a minute, and pip waits for the network: they run beside each other.
# If it fails, step build does it again, and tells.
configuring="" configured_in_part=$STATE/configuring
start_configuring() {
    if [[ -d build ]]; then return; fi
    write "$configured_in_part" "until CMake has read all packages"
    trap stop_configuring EXIT
    set -m # a process group of its own, which can be stopped as a whole
    { build_all cmake_check_build_system && rm -f "$configured_in_part"; } >"$LOGS/configure.log" 2>&1 </dev/null &
    configuring=$!
    set +m
}

stop_configuring() { if [[ -n $configuring ]]; then kill -- "-$configuring" 2>/dev/null; fi; }

finish_configuring() {
    if [[ -n $configuring ]]; then
        wait "$configuring" || true
        configuring=""
        cat "$LOGS/configure.log"
    fi
    # What was killed may have half-written files, which CMake takes as finished.
    if [[ -e $configured_in_part ]]; then rm -rf build devel "$configured_in_part"; fi
}

# A usable environment is Debian's Python's, sees Debian's packages, and was made in this very folder.
venv_is_ours() {
    [[ -x $VENV/bin/pip ]] && head -n 1 "$VENV/bin/pip" | grep -qF "$VENV/bin/python" &&
        grep -qx 'include-system-site-packages = true' "$VENV/pyvenv.cfg" &&
        "$VENV/bin/python3" -c 'import sys; sys.exit(sys.base_prefix != "/usr" or sys.prefix != sys.argv[1])' "$VENV"
}

step_venv() {
    if was_cut_off venv || was_cut_off pip || ! venv_is_ours 2>/dev/null; then
        make_venv
    else
        note="all there"
    fi
}

make_venv() {
    require_python
    rm -f "$STATE/pip.stamp"
    # Always Debian's Python: rospy is installed for that one, not the first one in PATH.
    run /usr/bin/python3 -m venv --clear --system-site-packages "$VENV"
    # This also removes packages that a killed pip left incomplete.
    repaired pip
}

step_pip() {
    local key wheels_only=()
    key=$(hash_of requirements.txt requirements-nodeps.txt)
    if [[ $cut_off_step == pip ]]; then make_venv; fi
    # A user's own `pip install` may bring it, and it hides Debian's: requirements-nodeps.txt says what breaks.
    if compgen -G "$VENV/lib/python3*/site-packages/rospkg" >/dev/null; then
        run "$VENV/bin/python3" -m pip uninstall -y rospkg
    fi
    if stamp_is "$key"; then
        link_xacro  # an update may have moved it
        note="all there"
        return
    fi
    start_configuring
    # Wheels exist for all; without one, compiling takes minutes to hours. Other processors have no wheel of pybullet.
    if [[ $(uname -m) == x86_64 ]]; then wheels_only=(--only-binary :all:); fi
    # Half of pip's time would be byte code: the step of the inner loops makes it, on the core that it leaves idle.
    run "$VENV/bin/python3" -m pip install --no-compile --progress-bar off "${wheels_only[@]}" -r requirements.txt
    run "$VENV/bin/python3" -m pip install --no-compile --progress-bar off "${wheels_only[@]}" --no-deps \
        -r requirements-nodeps.txt
    link_xacro
    stamp "$key"
}

# While pip copies files it prints nothing for minutes: say how far it is, and what came last.
activity_pip() {
    local packages last
    [[ $(tail -n 1 "$step_log") != *Collecting* && $(tail -n 1 "$step_log") != *Downloading* ]] || return
    mapfile -t packages < <(find "$VENV"/lib/python3*/site-packages -maxdepth 1 -name '*.dist-info' -printf '%T@ %f\n' | sort -n)
    [[ ${#packages[@]} -gt 1 ]] || return
    last=${packages[-1]#* }
    echo "${#packages[@]} packages are there, the last one ${last%.dist-info}"
}

# PyPI's xacro command knows neither --inorder nor the paths of ROS 1 packages; users must get ours.
link_xacro() {
    if [[ -f src/base/xacro/xacro && ! $VENV/bin/xacro -ef src/base/xacro/xacro ]]; then
        run ln -sf ../../src/base/xacro/xacro "$VENV/bin/xacro"
    fi
}

# The vendor's meshes come with example-robot-data; copies, so that `catkin_make install` installs files and not links.
step_meshes() {
    local source key
    source=$(compgen -G "$VENV/lib/python3*/site-packages/cmeel.prefix/share/example-robot-data/robots/baxter_description/meshes")
    [[ -d $source ]] || refuse "example-robot-data in $VENV has no Baxter meshes; delete $VENV and run ./baxter.sh setup"
    if [[ ! -d $DESCRIPTION || ! -d $GRIPPERS ]]; then
        note="skipped: no baxter_description or rethink_ee_description in src/"
        return
    fi
    key=$(hash_of requirements-nodeps.txt)
    if stamp_is "$key" && [[ -d $DESCRIPTION/meshes/torso && -d $GRIPPERS/meshes/electric_gripper ]]; then
        note="all there"
        return
    fi
    rm -f "$STATE/meshes.stamp"
    run rm -rf "$DESCRIPTION/meshes" "$GRIPPERS/meshes"
    run mkdir -p "$DESCRIPTION/meshes" "$GRIPPERS/meshes"
    local part
    for part in "$source"/*; do
        if [[ $(basename "$part") == electric_gripper ]]; then
            run cp -r "$part" "$GRIPPERS/meshes/"
        else
            run cp -r "$part" "$DESCRIPTION/meshes/"
        fi
    done
    stamp "$key"
}

# With --with FILE: fetch. In any case: check the packages in src_overlay, and prefer them to ours.
step_overlay() {
    local file hidden
    if was_cut_off overlay; then run drop_cut_off_clones "$LAB_ROOT"; fi
    for file in ${overlay_files[@]+"${overlay_files[@]}"}; do
        command -v vcs >/dev/null ||
            refuse "this system has no vcstool, which reads $file; clone what it lists into $LAB_ROOT/src_overlay yourself"
        run import_overlay "$LAB_ROOT" "$file"
    done
    leave_out_stand_ins "$LAB_ROOT" "${NOETIC%/*}/share" /usr/share
    if [[ -d src_overlay ]]; then run /usr/bin/python3 tools/check_overlay.py src_overlay; fi
    hidden=$(leave_out_overlaid "$LAB_ROOT" 2>>"$step_log") || refuse "$(tail -n 1 "$step_log")"
    note="none"
    if [[ -d src_overlay ]]; then note="$(manifests src_overlay | wc -l) in src_overlay"; fi
    if [[ -n $hidden ]]; then note+=", instead of ours: ${hidden//$'\n'/ }"; fi
    # Files that a package of the same name left in the build would still be found.
    if ! stamp_is "$hidden"; then
        [[ -f $STATE/overlay.stamp || -n $hidden ]] && run rm -rf build devel
        stamp "$hidden"
    fi
}

# Relays in devel to deleted scripts: catkin_make keeps them, and one in devel/bin hides the system's program.
remove_dead_relays() {
    local relay
    { grep -rlsE "^python_script = '" devel/bin devel/lib || true; } | while IFS= read -r relay; do
        [[ -e $(sed -n "s/^python_script = '\(.*\)'\$/\1/p" "$relay") ]] || rm -f "$relay"
    done
}

step_build() {
    local key
    # Without the workspace's own CMakeLists.txt, which catkin_make writes.
    key="$LAB_ROOT $ROS_LANG_DISABLE $(cd src && find -L . -mindepth 2 \( -name meshes -o -name .git \) -prune -o -type f \( -name package.xml -o -name CMakeLists.txt \
        -o -name setup.py -o -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name '*.cfg' \
        -o -name CATKIN_IGNORE -o -path '*/env-hooks/*' \) -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum)"
    # First in PATH, before catkin's own.
    run ln -sfn ../../tools/catkin_make "$VENV/bin/catkin_make"
    run finish_configuring
    # make takes a file that a killed compiler has half written as finished.
    if was_cut_off build; then
        run rm -rf build devel
        repaired build
    fi
    if stamp_is "$key" && [[ -f devel/setup.bash && -f build/CMakeCache.txt ]]; then
        note="up to date"
        return
    fi
    # A build folder made elsewhere makes CMake refuse, so a moved or copied workspace is built from scratch.
    if [[ -f build/CMakeCache.txt ]] && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$LAB_ROOT/src" build/CMakeCache.txt; then
        run rm -rf build devel
    fi
    run build_all cmake_check_build_system
    run "$VENV/bin/python3" tools/generate_messages.py build
    run build_all
    remove_dead_relays
    stamp "$key"
    note="$(find src -name CATKIN_IGNORE -prune -o -name package.xml -print | wc -l) packages"
}

# The lab sheets mention these files; nothing reads them at run time.
step_urdf() {
    local targets=("$DESCRIPTION/urdf/baxter.urdf" src/courses/cwru_baxter_sim/cwru_baxter.urdf) target key
    if [[ ! -f ${targets[0]}.xacro || ! -d src/base/xacro ]]; then
        note="skipped: no baxter.urdf.xacro or base/xacro in src/"
        return
    fi
    key=$(find src -name '*.xacro' -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum)
    if stamp_is "$key" && [[ -s ${targets[0]} && -s ${targets[1]} ]]; then
        note="up to date"
        return
    fi
    for target in "${targets[@]}"; do
        run bash -c 'source "$1/tools/environment.bash" && use_build &&
            rosrun xacro xacro --inorder "$2.xacro" >"$2.part" && mv "$2.part" "$2"' expand "$LAB_ROOT" "$target"
    done
    stamp "$key"
}

# Without this, the first launch would compile for a minute or two and seem to hang. The robots for pictures are made beside
# it, by the core that is free first; the step after this one tells what became of them.
step_kernels() {
    local group groups=("${COMPILED[@]}")
    if pictures_missing; then
        write "$STATE/pictures.key" "$pictures_key"
        groups+=("$PREPARE_PICTURES && mv $(printf '%q ' "$STATE"/pictures.{key,stamp}) || true")
        pictures_tried_in=$step_log
    fi
    # Some packages have files that are no Python of this version.
    groups+=("python3 -m compileall -q $(printf '%q' "$VENV")/lib/python3*/site-packages >/dev/null || true")
    rm -f "$STATE/kernels.list"
    # On all cores. What fails, perhaps for lack of memory, is repeated alone and told: numba does not compile again what
    # is in the cache.
    run bash -c 'source "$1/tools/environment.bash" && use_build && export LAB_COMPILED_SOURCES=$2 && shift 2 &&
        printf "%s\0" "$@" | xargs -0 -P "$(nproc)" -n 1 bash -c || echo "A group failed; each is repeated alone."' compile "$LAB_ROOT" \
        "$STATE/kernels.list" "${groups[@]}"
    if [[ -f $STATE/kernels.list ]]; then
        sort -u "$STATE/kernels.list" | tr '\n' '\0' | xargs -0 sha256sum >"$STATE/kernels.sums.new"
        mv "$STATE/kernels.sums.new" "$STATE/kernels.sums"
    fi
    if grep -q "^A group failed" "$step_log"; then
        for group in "${COMPILED[@]}"; do
            run bash -c 'source "$1/tools/environment.bash" && use_build && eval "$2"' compile "$LAB_ROOT" "$group"
        done
    fi
    # Message packages are much generated code, 9 MB for moveit_msgs alone. Where Python is not to write bytecode, each node
    # would compile it at every start: a second, and 20 MB.
    if [[ -d devel/lib/python3/dist-packages ]]; then
        run "$VENV/bin/python3" -m compileall -q -j "$(nproc)" devel/lib/python3/dist-packages
    fi
}

# pictures_missing: are robots to be made ready for pictures? Sets `pictures_key`, what they are made of; empty if this
# workspace has no part that draws. Their levels of detail are in the user's cache.
pictures_missing() {
    local cache=${XDG_CACHE_HOME:-${HOME:-}/.cache}/bullet_gazebo
    pictures_key=""
    [[ -d src/simulator/sensor_renderer ]] || return 1
    pictures_key="$cache $(find src/simulator/{sensor_renderer,world_picture}/src "$DESCRIPTION" "$GRIPPERS" \
        src/{probot/probot_description,courses/cwru_baxter_sim} -type f ! -name '*.pyc' -print0 2>/dev/null |
        LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum)"
    [[ ! -d $cache/results || ! -f $STATE/pictures.stamp || $(<"$STATE/pictures.stamp") != "$pictures_key" ]]
}

# Without this, the first pictures wait for the meshes' levels of detail: half a minute, on a busy machine some.
pictures_tried_in=""
step_pictures() {
    if ! pictures_missing; then
        note=${pictures_key:+up to date}
        note=${note:-skipped: no simulator/sensor_renderer in src/}
        return
    fi
    # A machine that cannot draw needs no pictures; one that can makes them at the first start.
    if [[ -n $pictures_tried_in ]]; then
        note="not made, see $pictures_tried_in; the first start makes them"
    elif bash -c 'source "$1/tools/environment.bash" && use_build && eval "$2"' prepare "$LAB_ROOT" "$PREPARE_PICTURES" \
        >>"$step_log" 2>&1 </dev/null; then
        stamp "$pictures_key"
    else
        note="not made, see $step_log; the first start makes them"
    fi
}

# --- main -------------------------------------------------------------------------------------------------------------

case $LAB_ROOT in
    *[[:space:]]*)
        echo "Set-up cannot continue: catkin does not build in a folder whose path has spaces: '$LAB_ROOT'." >&2
        echo "Move the workspace, for example to ~/ros_ws, and try again." >&2
        exit 1
        ;;
esac

usage="Usage: ./baxter.sh setup [--with FILE.rosinstall]… [STEP…], where a STEP is one of: ${STEPS[*]}"
overlay_files=() chosen=()
while [[ $# -gt 0 ]]; do
    case $1 in
        --with | --with=*)
            if [[ $1 == --with ]]; then
                [[ $# -gt 1 ]] || { echo "--with needs a file. $usage" >&2; exit 2; }
                set -- "--with=$2" "${@:3}"
            fi
            overlay_files+=("$(cd "$CALLED_FROM" && realpath -m "${1#--with=}")")
            [[ -f ${overlay_files[-1]} ]] ||
                { echo "there is no file ${overlay_files[-1]}; rosinstall/ has those that come with the workspace" >&2; exit 2; }
            ;;
        *)
            [[ " ${STEPS[*]} " == *" $1 "* ]] || { echo "unknown argument '$1'. $usage" >&2; exit 2; }
            chosen+=("$1")
            ;;
    esac
    shift
done

# Nothing of another Python, workspace or virtual environment may leak into the build. Debian's own tools come first.
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV CMAKE_PREFIX_PATH ROS_PACKAGE_PATH ROS_DISTRO PKG_CONFIG_PATH
# A third of the messages' code would be in Lisp, which nothing here uses; ROS_LANG_DISABLE= makes it, too.
export ROS_LANG_DISABLE=${ROS_LANG_DISABLE-genlisp}
export PATH=$VENV/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin:$PATH
if [[ -f $NOETIC ]]; then
    set +u
    # shellcheck disable=SC1090
    source "$NOETIC"
    set -u
fi

start_run
started=$SECONDS
# Later changes are not part of this set-up. The fingerprint of the previous one is valid while nothing has changed.
fingerprint_at_start=$(fingerprint) own_at_start=$(own_fingerprint)
if [[ -f $STATE/done && $(<"$STATE/done") != "$fingerprint_at_start" ]]; then rm -f "$STATE/done"; fi
rm -f "$STATE/failed"
# Compiled code and virtual environments of another system cannot be used here.
if [[ -f $STATE/system && $(<"$STATE/system") != "$(system_name)" ]]; then
    echo "This workspace was set up on another system, $(<"$STATE/system"); starting from the beginning."
    rm -rf build devel "$VENV" "$STATE"/*.stamp "$STATE/own"
fi
echo "Setting up $LAB_ROOT"
platform_line /etc/os-release "$NOETIC" "$(uname -m)"
for index in "${!STEPS[@]}"; do
    [[ ${#chosen[@]} -eq 0 || " ${chosen[*]} " == *" ${STEPS[index]} "* ]] || continue
    start_step "${STEPS[index]}"
    printf '[%d/%d] %s …\n' $((index + 1)) ${#STEPS[@]} "${TITLES[$step_name]}"
    "step_$step_name"
    end_step
    printf '[%d/%d] %s: %s (%d s)\n' $((index + 1)) ${#STEPS[@]} "${TITLES[$step_name]}" "${note:-done}" \
        $((SECONDS - step_started))
done
# A run of only some steps is not a complete set-up.
if [[ ${#chosen[@]} -eq 0 ]]; then
    cut_off_step=""
    write "$STATE/done" "$fingerprint_at_start"
    write "$STATE/system" "$(system_name)"
    if [[ -n $own_at_start ]]; then write "$STATE/own_done" "$own_at_start"; fi
fi
if [[ -z $cut_off_step ]]; then rm -f "$STATE/at_work"; fi
echo "Set-up finished in $((SECONDS - started)) s."
