# For packages that ask CMake for ros_control's or Gazebo's C++ packages: the lab serves controllers and plugins from
# Python. This file has the name of each of them.
set(_name ${CMAKE_FIND_PACKAGE_NAME})
if(NOT ${_name}_FIND_QUIETLY)
  message(STATUS "${_name} is found without headers: C++ code that includes them does not compile here")
endif()
set(${_name}_FOUND_CATKIN_PROJECT TRUE)
foreach(_variable INCLUDE_DIRS LIBRARY_DIRS LIBRARIES EXPORTED_TARGETS)
  set(${_name}_${_variable} "")
endforeach()
