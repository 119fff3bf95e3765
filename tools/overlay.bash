# SPDX-License-Identifier: BSD-3-Clause
# Other people's packages beside ours, in src_overlay/: fetched from rosinstall files, checked, and preferred to our
# packages of the same name. Sourced by set-up.

OVERLAY_MARK="made by set-up: src_overlay has this package"

# import_overlay ROOT FILE: fetch what a .rosinstall or .repos file lists; existing ones are updated.
import_overlay() {
    local root=$1 file=$2
    mkdir -p "$root/src_overlay" && vcs import --input "$file" "$root/src_overlay"
}

# drop_cut_off_clones ROOT: remove incomplete clones of a killed git; git would take such a folder for a complete clone.
drop_cut_off_clones() {
    local git
    for git in "$1"/src_overlay/*/.git; do
        # The index is written last.
        if [[ -d $git && ! -f $git/index ]]; then
            echo "removing ${git%/.git}, which git did not finish"
            rm -rf "${git%/.git}"
        fi
    done
}

# name_of PACKAGE.XML
name_of() { sed -n 's/.*<name>[[:space:]]*\([^<[:space:]]*\).*/\1/p' "$1" | head -n 1; }

# manifests FOLDER: the package.xml files below it, without those excluded from the build
manifests() { find "$1" \( -name .git -o -name meshes -o -name __pycache__ \) -prune -o -name package.xml -print; }

# leave_out_overlaid ROOT: include the overlay in the build, hide our packages of the same names, and show the others
# again. Prints the names of the hidden ones. Fails if the overlay has a name twice.
leave_out_overlaid() {
    local root=$1 manifest name
    local -A theirs=()
    rm -f "$root/src/overlay"
    if [[ -d $root/src_overlay ]]; then
        ln -s ../src_overlay "$root/src/overlay" || return
        while read -r manifest; do
            name=$(name_of "$manifest")
            [[ ! -f ${manifest%/*}/CATKIN_IGNORE ]] || continue
            if [[ -n ${theirs[$name]:-} ]]; then
                echo "src_overlay has the package $name twice: ${theirs[$name]} and ${manifest%/*}; remove one" >&2
                return 1
            fi
            theirs[$name]=${manifest%/*}
        done < <(manifests "$root/src_overlay")
    fi
    while read -r manifest; do
        name=$(name_of "$manifest")
        if [[ -n ${theirs[$name]:-} ]]; then
            echo "$OVERLAY_MARK" >"${manifest%/*}/CATKIN_IGNORE" || return
            echo "$name"
        elif [[ $(cat "${manifest%/*}/CATKIN_IGNORE" 2>/dev/null) == "$OVERLAY_MARK" ]]; then
            rm "${manifest%/*}/CATKIN_IGNORE"
        fi
    done < <(manifests "$root/src")
}
