# SPDX-License-Identifier: BSD-3-Clause
# roscd, rosed and tab completion: Debian ships them, but no setup file of a workspace loads them.
if ! typeset -f roscd >/dev/null; then
  for _lab_file in /opt/ros/noetic/share/rosbash/rosbash /usr/share/bash-completion/completions/rosbash; do
    if [ -f "$_lab_file" ]; then
      . "$_lab_file"
      break
    fi
  done
  unset _lab_file
fi
