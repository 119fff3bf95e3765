#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The one entry point: sets the workspace up, enters it, tests it. `./baxter.sh help` says how.

# `sh baxter.sh` starts another shell, which cannot read the lines below.
[ -n "${BASH_VERSION:-}" ] || exec bash "$0" "$@"

LAB_ROOT=$(cd -P "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
export LAB_ROOT

# shellcheck source=tools/environment.bash
source "$LAB_ROOT/tools/environment.bash"
# shellcheck source=tools/platform.bash
source "$LAB_ROOT/tools/platform.bash"
# shellcheck source=tools/container.bash
source "$LAB_ROOT/tools/container.bash"
# The bash of macOS cannot read what follows; that of the container can.
if [[ ${BASH_VERSINFO[0]} -lt 4 ]]; then use_container "$@" || exit; fi

# The one table of modes: two spaces begin a mode, deeper lines belong to it. `MODE --help` and the words of "did you mean"
# come from here.
usage() {
    cat <<'TEXT'
Usage: ./baxter.sh [MODE] [COMMAND…]

  sim [COMMAND…]        the simulator on this machine (also: local; the default). Without a command: a shell.
                        A ROS_MASTER_URI that names this machine and another port is kept: several labs side by side.
  sim --public[=ADDRESS] [COMMAND…]
                        the same, open to other machines, which use it with ./baxter.sh ADDRESS
  HOST [COMMAND…]       a robot, by host name or IP address. ROS_IP is found from the route to it;
                        ROS_IP or ROS_HOSTNAME, if you have set one, wins.
  setup [STEP…]         install and build what is missing; runs by itself the first time anything is used
  setup --with FILE     also fetch the packages of a rosinstall file, and prefer them to ours: rosinstall/README.md
  test [NAMES] [--long] lint, unit tests and rostests. NAMES: packages, test files, or pytest arguments such as -k;
                        --busy[=PERCENT]: with that share of one core (default 40), the main flows
  notebook [NAME]       the labs' notebooks in a browser: starts Jupyter on this machine alone and prints the address
  web                   the lab's page in a browser, beside a running lab: prints its address
  check LAB PROGRAM     run a student's program in a separate lab and judge the result; --list shows the exercises
  grade FOLDER [LAB [EXERCISE…]]
                        judge the submissions of a class, several at a time, and write results and pages
  labs up N | list | start | pause | stop | renew | down | logs
                        labs for a class on this machine, behind one front door
  handout FOLDER        make the students' copy of this workspace: without solutions, and without what reveals them
  learn TASK            learn a task of gym_baxter from an expert's demonstrations, and measure and film the policy
  batch JOB --seeds A:B run a job once for each seed on all processors; --list names the jobs
  batch-node            this machine as one of several for 'batch --engine ray', until Ctrl-C
  bench [NAMES]         run the benchmarks, beside other libraries; --list shows the suites
  sysid [RECORDING]     fit the model of profile:=robot to a recording of a robot's arms, or move an arm (--arm) and record it;
                        --out FILE for serial:=FILE
  conformance [HOST]    compare the robot with a physical Baxter's interface, and print a score by group
  doctor [HOST]         check master, network, clock, build, Python and robot; print a fix for each problem.
                        Without HOST: the master of ROS_MASTER_URI, or else this machine's
  help                  this text; MODE --help says more about a mode; --version

  ./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch
  ./baxter.sh sim rosrun baxter_tools enable_robot.py -e
TEXT
}

# help_of MODE: its lines of the table
help_of() {
    printf 'One of the modes of ./baxter.sh (./baxter.sh help shows all):\n\n'
    usage | awk -v mode="$1" '/^$/ { of_mode = 0 } /^  [^ ]/ { of_mode = $1 == mode } of_mode'
    if [[ $1 == setup ]]; then sed -n 's/^STEPS=(\(.*\))$/\n  A STEP is one of: \1/p' "$LAB_ROOT/tools/setup.bash"; fi
}

# is_mode WORD
is_mode() {
    [[ -n ${PROGRAMS[$1]:-} || $1 == sim || $1 == setup || $1 == doctor || $1 == handout ]]
}

# Is a set-up of this workspace at work, in another terminal?
set_up_runs() {
    [[ -f $LAB_ROOT/.baxter/lock ]] && ! flock -n "$LAB_ROOT/.baxter/lock" true
}

# nearest WORD: the mode that is at most two wrong, missing or additional letters away from WORD; empty if there is none
nearest() {
    usage | awk -v word="${1,,}" '
        function least(a, b) { return a < b ? a : b }
        function distance(a, b,    i, j, d) {
            for (i = 0; i <= length(a); i++) d[i, 0] = i
            for (j = 0; j <= length(b); j++) d[0, j] = j
            for (i = 1; i <= length(a); i++)
                for (j = 1; j <= length(b); j++)
                    d[i, j] = least(d[i - 1, j - 1] + (substr(a, i, 1) != substr(b, j, 1)), 1 + least(d[i - 1, j], d[i, j - 1]))
            return d[length(a), length(b)]
        }
        BEGIN { best = least(3, length(word)) }
        /^  [a-z]/ { if ((found = distance(word, $1)) < best) { best = found; mode = $1 } }
        END { print mode }'
}

version() {
    sed -n 's:.*<version>\(.*\)</version>.*:Baxter lab stack \1:p' "$LAB_ROOT/src/base/lab_environment/package.xml"
}

# The program behind a mode; it runs in the workspace's environment, with a master on this machine.
declare -A PROGRAMS=(
    [test]="python3 $LAB_ROOT/tools/run_tests.py"
    [notebook]="python3 $LAB_ROOT/tools/notebook.py"
    [web]="rosrun lab_web lab_web"
    [check]="python3 $LAB_ROOT/src/courses/rf_checks/scripts/check"
    # -P: no module is taken from the current folder, which may hold submissions.
    [grade]="python3 -P -m rf_grading"
    [labs]="python3 -P -m lab_class"
    [learn]="python3 -m robot_learning"
    [batch]="python3 -m lab_batch"
    [batch-node]="python3 -m lab_batch.ray_node"
    [bench]="python3 $LAB_ROOT/tests/bench/run.py"
    [sysid]="rosrun baxter_sysid sysid"
    [conformance]="rosrun baxter_conformance conformance"
)

# run_program MODE [WORD…]
run_program() {
    local mode=$1 command
    shift
    if ! asks_only help "$@"; then refuse_words "$mode" "$@" || exit; fi
    if ! asks_only help "$@" || has_earlier_build; then use_container "$mode" "$@" || exit; fi
    read -ra command <<<"${PROGRAMS[$mode]}"
    if asks_only "$mode" "$@"; then
        # While set-up is at work, half a build may be there.
        if ! has_earlier_build || set_up_runs; then
            if asks_only help "$@"; then help_of "$mode" && exit; fi
            bring_up_to_date || exit
        fi
        use_loopback
    elif [[ $mode == test ]]; then
        bring_up_to_date --strict || exit
        use_loopback
    elif [[ $mode == batch-node ]]; then
        bring_up_to_date || exit
    elif [[ $mode == conformance && ${1:--} != -* && $1 != localhost ]]; then
        use_robot "$1" || exit
        bring_up_to_date || exit
        use_robot "$1" || exit # set-up may have brought what finds the route
        shift
    else
        if [[ $mode == conformance && ${1:-} == localhost ]]; then shift; fi
        bring_up_to_date || exit
        use_loopback
    fi
    use_build || exit
    use_writable_folders
    exec "${command[@]}" "$@"
}

# Replace this process by a command in the workspace's environment, or by a shell with the lab's prompt.
enter() {
    use_writable_folders
    if [[ $# -gt 0 ]]; then
        exec "$@"
    elif [[ -t 0 ]]; then
        exec bash --rcfile "$LAB_ROOT/tools/shell.bashrc" -i
    else
        exec bash
    fi
}

# refuse_option [WORD…]: no command begins with a dash
refuse_option() {
    [[ ${1:-} != -* ]] || { echo "baxter.sh: unknown option '$1'. ./baxter.sh help shows those that it has" >&2; return 2; }
}

# suggest WORD…: the line that may have been meant
suggest() {
    local mode
    mode=$(nearest "$1")
    shift
    if [[ -n $mode ]]; then
        set -- "$mode" "$@"
        echo "baxter.sh: did you mean ./baxter.sh $*?" >&2
    fi
}

# asks_only MODE WORD…: do the words only ask, for help or, of the check, a list or a skeleton? Then nothing is set up.
asks_only() {
    local mode=$1 word
    for word in "${@:2}"; do
        case $mode:$word in *:-h | *:--help | check:--list | check:--start | check:--start=*) return 0 ;; esac
    done
    return 1
}

# refuse_words MODE WORD…: those that the mode's program would refuse after set-up, where a Python is there to ask it.
refuse_words() {
    if [[ -x /usr/bin/python3 && $(uname -s) != Darwin ]]; then
        /usr/bin/python3 -I -S "$LAB_ROOT/tools/arguments.py" "$LAB_ROOT" "$@" </dev/null
    fi
}

# refuse_missing [COMMAND…]: a path that names nothing, and nothing that set-up makes
refuse_missing() {
    if [[ ${1:-} != */* || -e $1 ]]; then return; fi
    case $(realpath -m -- "$1") in
        "$LAB_ROOT"/.*/* | "$LAB_ROOT"/build/* | "$LAB_ROOT"/devel/* | "$LAB_ROOT"/install/* | "$LAB_ROOT"/src_overlay/*) ;;
        *) echo "baxter.sh: there is no program $1" >&2 && return 127 ;;
    esac
}

# With sudo, set-up and simulator would leave files of root in the user's own workspace, which then cannot be written.
# Where root owns the workspace, as on a server, root may set it up.
refuse_sudo() {
    if [[ $(id -u) == 0 && ${SUDO_UID:-0} != 0 && $(stat -c %u "$LAB_ROOT") == "$SUDO_UID" ]]; then
        echo "baxter.sh: start it without sudo: $LAB_ROOT is yours, and files of root in it would stop you from using it." \
             "Set-up itself asks for sudo where it needs it. Files from an earlier try become yours again with:" \
             "sudo chown -R ${SUDO_USER:-$SUDO_UID} '$LAB_ROOT'" >&2
        return 2
    fi
}

main() {
    local mode=${1:-sim}
    [[ $# -gt 0 ]] && shift
    case $mode in
        help | -h | --help | --version | version | doctor) ;;
        *) refuse_sudo || exit ;;
    esac
    case $mode in
        local | localhost | 127.*) mode=sim ;;
    esac
    # What stands behind a command is the command's.
    case $mode:${1:-} in
        sim:-h | sim:--help | setup:-h | setup:--help | doctor:-h | doctor:--help) help_of "$mode" && exit ;;
        # That of grade also tells which judge gave the points.
        grade:--version) ;;
        *:--version) if is_mode "$mode"; then version && exit; fi ;;
    esac
    case $mode in
        help | -h | --help)
            usage
            ;;
        --version | version)
            version
            ;;
        setup)
            use_container setup "$@" || exit
            exec bash "$LAB_ROOT/tools/setup.bash" "$@"
            ;;
        doctor)
            # Works on a half-built workspace, so it sets nothing up. The doctor itself reports a host that does not
            # resolve or has no route.
            refuse_option "$@" || exit
            use_container doctor "$@" || exit
            if is_loopback "${1:-}"; then
                use_loopback
            elif [[ $# -gt 0 ]]; then
                use_robot "$1" 2>/dev/null || export ROS_MASTER_URI=http://$1:11311
            fi
            # The Python of programs that are started outside of this environment.
            LAB_USERS_PYTHON=$(command -v python3)
            export LAB_USERS_PYTHON
            use_build_if_there
            # The build's hooks set it; without a build one fault is enough.
            if [[ -z ${ROS_MASTER_URI:-} ]]; then use_loopback; fi
            if ! command -v python3 >/dev/null; then
                if set_up_runs; then
                    echo "Set-up is running$(set_up_progress), and has not installed python3 yet. fix: wait until it has ended"
                else
                    echo "There is no python3 on this machine yet. fix: ./baxter.sh setup"
                fi
                exit 1
            fi
            exec python3 "$LAB_ROOT/tools/doctor.py"
            ;;
        handout)
            # Needs no set-up, so it takes the system's Python: the first one in PATH may be conda's.
            PYTHONPATH=$LAB_ROOT/src/courses/rf_checks/src:$LAB_ROOT/src/base/command_line/src \
                exec /usr/bin/python3 -m rf_checks.handout "$@"
            ;;
        sim)
            local public=
            case ${1:-} in --public | --public=*) public=${1#--} && shift ;; esac
            refuse_option "$@" || exit
            refuse_missing "$@" || exit
            use_container sim ${public:+"--$public"} "$@" || exit
            bring_up_to_date "$@" || exit
            if [[ -z $public ]]; then
                use_loopback
            else
                public=${public#public}
                use_public "${public#=}" || exit
            fi
            use_build || exit
            enter "$@"
            ;;
        -*)
            echo "baxter.sh: unknown option '$mode'" >&2
            usage >&2
            exit 2
            ;;
        roslaunch | rosrun | rostopic | rosnode | rosservice | rosparam | rosmsg | rossrv | rosbag | rviz | python | python3 | catkin_make)
            echo "baxter.sh: did you mean ./baxter.sh sim $mode $*?" >&2
            exit 2
            ;;
        *)
            if [[ -n ${PROGRAMS[$mode]:-} ]]; then run_program "$mode" "$@"; fi
            # A host need not be there for that; a slip is told.
            if ! asks_only host "${1:-}" || [[ -n $(nearest "$mode") ]]; then
                use_robot "$mode" || { suggest "$mode" "$@"; exit 2; }
            fi
            if asks_only host "${1:-}"; then help_of HOST && exit; fi
            refuse_option "$@" || exit
            refuse_missing "$@" || exit
            use_container "$mode" "$@" || exit
            bring_up_to_date "$@" || exit
            use_robot "$mode" || exit # set-up may have brought what finds the route
            use_build || exit
            enter "$@"
            ;;
    esac
}

main "$@"
