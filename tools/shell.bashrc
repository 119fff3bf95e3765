# SPDX-License-Identifier: BSD-3-Clause
# Start-up file of the lab's interactive shell: the user's own settings first, then the workspace's on top, because a
# .bashrc often puts another Python first in PATH or names another master.
_lab_master=$ROS_MASTER_URI _lab_hostname=${ROS_HOSTNAME:-} _lab_ip=${ROS_IP:-}
if [[ -f ~/.bashrc ]]; then
    source ~/.bashrc
fi
export ROS_MASTER_URI=$_lab_master
unset ROS_HOSTNAME ROS_IP
if [[ -n $_lab_hostname ]]; then export ROS_HOSTNAME=$_lab_hostname; fi
if [[ -n $_lab_ip ]]; then export ROS_IP=$_lab_ip; fi
unset _lab_master _lab_hostname _lab_ip

source "$LAB_ROOT/tools/environment.bash"
use_build
PS1='[baxter - $ROS_MASTER_URI] \w\$ '
