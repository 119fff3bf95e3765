# Added by lab_environment: find the folder of this file. bash and zsh know it; for other shells, the system lists the
# file that the shell opened last.
if [ -z "${_CATKIN_SETUP_DIR:-}" ]; then
  _lab_file=
  if [ -n "${BASH_VERSION:-}" ]; then
    eval '_lab_file=${BASH_SOURCE[0]}'
  elif [ -n "${ZSH_VERSION:-}" ]; then
    eval '_lab_file=${(%):-%x}'
  elif [ -r /proc/self/stat ]; then
    read -r _lab_pid _lab_rest </proc/self/stat
    _lab_last=-1
    for _lab_fd in "/proc/$_lab_pid/fd/"*; do
      _lab_target=$(readlink "$_lab_fd")
      if [ "${_lab_target##*/}" = "@NAME@" ] && [ "${_lab_fd##*/}" -gt "$_lab_last" ]; then
        _lab_file=$_lab_target
        _lab_last=${_lab_fd##*/}
      fi
    done
    unset _lab_pid _lab_rest _lab_last _lab_fd _lab_target
  fi
  case $_lab_file in
    "") ;;
    */*) _CATKIN_SETUP_DIR=$(CDPATH= cd "${_lab_file%/*}" >/dev/null && pwd) ;;
    *) _CATKIN_SETUP_DIR=$PWD ;;
  esac
  unset _lab_file
fi
