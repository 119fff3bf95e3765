#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The one entry point: sets the workspace up, enters it, tests it. `./baxter.sh help` says how.

# `sh baxter.sh` starts another shell, which cannot read the lines below.
[ -n "${BASH_VERSION:-}" ] || exec bash "$0" "$@"

LAB_ROOT=$(cd -P "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
export LAB_ROOT

# shellcheck source=tools/environment.bash
source "$LAB_ROOT/tools/environment.bash"

usage() {
    cat <<'TEXT'
Usage: ./baxter.sh [MODE] [COMMAND…]

  sim [COMMAND…]        the simulator on this machine (also: local; the default). Without a command: a shell.
                        A ROS_MASTER_URI that names this machine and another port is kept: several labs side by side.
  sim --public[=ADDRESS] [COMMAND…]
                        the same, open to other machines, which use it with ./baxter.sh ADDRESS
  HOST [COMMAND…]       a robot, by host name or IP address. ROS_IP is found from the route to it;
                        ROS_IP or ROS_HOSTNAME, if you have set one, wins.
  setup                 install and build what is missing; runs by itself the first time anything is used
  setup --with FILE     also fetch the packages of a rosinstall file, and prefer them to ours: rosinstall/README.md
  test [NAMES] [--long] lint, unit tests and rostests. NAMES: packages, test files, or pytest arguments such as -k;
                        --busy[=PERCENT]: with that share of one core (default 40), the main flows
  notebook [NAME]       the labs' notebooks in a browser: starts Jupyter on this machine alone and prints the address
  web                   the lab's page in a browser, beside a running lab: prints its address; --help
  check LAB PROGRAM     run a student's program in a separate lab and judge the result; --list, --help
  grade FOLDER [LAB [EXERCISE…]]
                        judge the submissions of a class, several at a time, and write results and pages; --help
  labs up N | list | start | pause | stop | renew | down | logs
                        labs for a class on this machine, behind one front door; --help
  handout FOLDER        make the students' copy of this workspace: without solutions, and without what reveals them
  batch JOB --seeds A:B run a job once for each seed on all processors; --list names the jobs, --help the options
  batch-node            this machine as one of several for 'batch --engine ray', until Ctrl-C; --help
  bench [NAMES]         run the benchmarks, beside other libraries; --list shows the suites
  conformance [HOST]    compare the robot with a physical Baxter's interface, and print a score by group
  doctor [HOST]         check master, network, clock, build, Python and robot; print a fix for each problem
  help                  this text

  ./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch
  ./baxter.sh sim rosrun baxter_tools enable_robot.py -e
TEXT
}

# Replace this process by a command in the workspace's environment, or by a shell with the lab's prompt.
enter() {
    warn_of_logs
    if [[ $# -gt 0 ]]; then
        exec "$@"
    elif [[ -t 0 ]]; then
        exec bash --rcfile "$LAB_ROOT/tools/shell.bashrc" -i
    else
        exec bash
    fi
}

# needs_no_lab WORDS…: do these arguments of the check only request a skeleton, the list or the help?
needs_no_lab() {
    local word
    for word; do
        case $word in --start | --start=* | --list | -h | --help) return 0 ;; esac
    done
    return 1
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
    case $mode in help | -h | --help | doctor) ;; *) refuse_sudo || exit ;; esac
    case $mode in
        help | -h | --help)
            usage
            ;;
        setup)
            exec bash "$LAB_ROOT/tools/setup.bash" "$@"
            ;;
        doctor)
            # Works on a half-built workspace, so it sets nothing up. The doctor itself reports a host that does not
            # resolve or has no route.
            if [[ $# -gt 0 ]]; then use_robot "$1" 2>/dev/null || export ROS_MASTER_URI=http://$1:11311; fi
            # The Python of programs that are started outside of this environment.
            LAB_USERS_PYTHON=$(command -v python3)
            export LAB_USERS_PYTHON
            use_build_if_there
            # The build's hooks set it; without a build one fault is enough.
            if [[ -z ${ROS_MASTER_URI:-} ]]; then use_loopback; fi
            if ! command -v python3 >/dev/null; then
                echo "There is no python3 on this machine yet. fix: ./baxter.sh setup"
                exit 1
            fi
            exec python3 "$LAB_ROOT/tools/doctor.py"
            ;;
        test)
            bring_up_to_date --strict || exit
            use_loopback
            use_build || exit
            exec python3 "$LAB_ROOT/tools/run_tests.py" "$@"
            ;;
        check)
            # With a build, a skeleton or the list of exercises needs no set-up.
            { needs_no_lab "$@" && has_earlier_build; } || bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec python3 "$LAB_ROOT/src/rf_labs/rf_checks/scripts/check" "$@"
            ;;
        grade)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            # -P: no module is taken from the current folder, which may hold submissions.
            exec python3 -P -m rf_grading "$@"
            ;;
        labs)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec python3 -P -m lab_class "$@"
            ;;
        handout)
            # Needs no set-up, so it takes the system's Python: the first one in PATH may be conda's.
            PYTHONPATH=$LAB_ROOT/src/rf_labs/rf_checks/src exec /usr/bin/python3 -m rf_checks.handout "$@"
            ;;
        bench)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec python3 "$LAB_ROOT/tests/bench/run.py" "$@"
            ;;
        conformance)
            # Without a host, or with options first: the simulator on this machine.
            if [[ $# -gt 0 && $1 != -* && $1 != localhost ]]; then
                use_robot "$1" || exit
                shift
            else
                [[ ${1:-} == localhost ]] && shift
                use_loopback
            fi
            bring_up_to_date || exit
            use_build || exit
            exec rosrun baxter_conformance conformance "$@"
            ;;
        batch)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec python3 -m lab_batch "$@"
            ;;
        batch-node)
            bring_up_to_date || exit
            use_build || exit
            exec python3 -m lab_batch.ray_node "$@"
            ;;
        notebook)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec python3 "$LAB_ROOT/tools/notebook.py" "$@"
            ;;
        web)
            bring_up_to_date || exit
            use_loopback
            use_build || exit
            exec rosrun lab_web lab_web "$@"
            ;;
        sim | local | localhost | 127.*)
            local command=("$@")
            if [[ ${1:-} == --public* ]]; then command=("${@:2}"); fi
            bring_up_to_date ${command[@]+"${command[@]}"} || exit
            case ${1:-} in
                --public | --public=*)
                    local address=${1#--public}
                    use_public "${address#=}" || exit
                    shift
                    ;;
                *) use_loopback ;;
            esac
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
            use_robot "$mode" || exit
            bring_up_to_date "$@" || exit
            use_build || exit
            enter "$@"
            ;;
    esac
}

main "$@"
