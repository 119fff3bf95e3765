# SPDX-License-Identifier: BSD-3-Clause
# Runs at `catkin_make install`, after catkin has installed its setup files: they must work after the space was moved.
set(prefix "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}")

# catkin's helper starts by the interpreter it was configured with, which is the workspace's; Debian's is always there.
set(helper "${prefix}/_setup_util.py")
if(EXISTS "${helper}")
  file(READ "${helper}" text)
  string(REGEX REPLACE "^#![^\n]*" "#!/usr/bin/python3" text "${text}")
  file(WRITE "${helper}" "${text}")
endif()

# setup.sh and local_setup.sh have the path of the first installation inside; replace it by a search for their own path.
file(READ "${CMAKE_CURRENT_LIST_DIR}/own_place.sh" search)
foreach(name setup.sh local_setup.sh)
  set(file "${prefix}/${name}")
  if(EXISTS "${file}")
    file(READ "${file}" text)
    string(REGEX MATCH ": \\\${_CATKIN_SETUP_DIR:=[^\n]*" fallback "${text}")
    if(fallback STREQUAL "")
      message(FATAL_ERROR "${file} sets no _CATKIN_SETUP_DIR; cmake/own_place.cmake of lab_environment expects catkin 0.8")
    endif()
    if(NOT text MATCHES "_lab_file")
      string(REPLACE "@NAME@" "${name}" own "${search}")
      string(REPLACE "${fallback}" "${own}${fallback}" text "${text}")
      file(WRITE "${file}" "${text}")
    endif()
  endif()
endforeach()
