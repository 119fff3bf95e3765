# SPDX-License-Identifier: BSD-3-Clause
# How set-up runs the commands of its steps: output to the step's log, errors in words, and repair of steps that an
# interrupted run left incomplete. Sourced by setup.bash; LAB_ROOT, STATE, STEPS and TITLES are its.

LOGS=$STATE/logs
# Below this free space [kB] the disk counts as full.
FULL_BELOW_KB=4096
# Without a terminal a step that takes longer than this [s] says what it does, again and again.
LIFE_S=60
step_name="" step_log="" note="" watcher="" step_started=0
# The step in which the run before this one was killed or ran out of disk; "?" if that could not be recorded.
cut_off_step=""

# start_run: one set-up at a time; find out whether the previous one was completed.
start_run() {
    if ! { mkdir -p "$LOGS" && exec 9>>"$STATE/lock"; } 2>/dev/null; then
        echo "Set-up cannot start: it cannot write to $STATE: $(disk_note "a file there is not writable for $(id -un)")" >&2
        exit 1
    fi
    # A launch and a node started together on a fresh clone must not both build. The commands of the steps inherit the
    # lock: set-up waits for commands that outlive a killed set-up.
    if ! flock -n 9; then
        wait_for_other_set_up
        if [[ -f $STATE/done && $(<"$STATE/done") == "$(fingerprint)" ]]; then exit 0; fi
    fi
    if [[ -f $STATE/at_work ]]; then
        cut_off_step=$(<"$STATE/at_work")
        [[ -n ${TITLES[${cut_off_step:-none}]:-} ]] || cut_off_step="?"
        echo "The set-up before this one was cut off in step '${TITLES[$cut_off_step]:-unknown}'; this step is" \
             "repeated."
    fi
    rm -f "$STATE/failure"
    trap interrupted INT
}

# wait_for_other_set_up: take its lock when it has ended; each step of it is told.
wait_for_other_set_up() {
    local told="" now
    until flock -n 9; do
        now=place:$(cut -f 2 "$STATE/progress" 2>/dev/null)
        if [[ $now != "$told" ]]; then
            echo "another set-up is running in this workspace$(set_up_progress); waiting for it to finish"
            told=$now
        fi
        flock -w 2 9 && return
    done
}

# was_cut_off STEP: may an earlier run have left this step incomplete?
was_cut_off() { [[ $cut_off_step == "$1" || $cut_off_step == "?" ]]; }

# start_step NAME
start_step() {
    step_name=$1 step_log=$LOGS/$1.log note="" step_started=$SECONDS
    # An interrupted step stays marked until it has succeeded.
    if [[ -z $cut_off_step ]]; then write "$STATE/at_work" "$step_name"; fi
    write "$step_log" "# ${TITLES[$step_name]}, $(date)"
    local place=1
    while [[ $place -lt ${#STEPS[@]} && ${STEPS[place - 1]} != "$step_name" ]]; do place=$((place + 1)); done
    write "$STATE/progress" "$(date +%s)"$'\t'"$place of ${#STEPS[@]}"$'\t'"${TITLES[$step_name]}"
}

end_step() { repaired "$step_name"; }

# repaired STEP: its left-overs are repaired; from here on only this run's own step may be interrupted
repaired() {
    if [[ $cut_off_step == "$1" ]]; then
        cut_off_step=""
        write "$STATE/at_work" "$step_name"
    fi
}

# write FILE TEXT: write atomically.
write() {
    if ! { printf '%s\n' "$2" >"$1.part" && mv "$1.part" "$1"; } 2>/dev/null; then
        refuse "cannot write $1: $(disk_note "it is not writable for $(id -un)")"
    fi
}

# run COMMAND…: run it with all output in the step's log; on failure print the error and exit.
run() {
    printf '\n$ %s\n' "$*" >>"$step_log"
    local status=0
    watch_log &
    watcher=$!
    "$@" >>"$step_log" 2>&1 </dev/null || status=$?
    stop_watching
    if [[ $status -ne 0 ]]; then
        fail "$status" "$*"
    fi
}

# What the step does now: the last line of its log; a step may define its own.
activity() {
    if declare -F "activity_$step_name" >/dev/null && "activity_$step_name"; then return; fi
    tail -n 1 "$step_log" | tr -d '\r' | cut -c 1-300
}

# A user is waiting: show on the terminal what is done now, elsewhere a line each minute.
watch_log() {
    exec 9>&-
    local columns pause="" told=$SECONDS
    trap 'kill $pause 2>/dev/null; exit 0' TERM
    columns=$(tput cols 2>/dev/null || echo 80)
    while kill -0 $$ 2>/dev/null; do
        # Nobody waits for a pipe that a left-over sleep holds open; `wait` ends at once where `sleep` would not.
        sleep 0.5 >/dev/null 2>&1 &
        pause=$!
        wait "$pause"
        if [[ -t 1 ]]; then
            printf '\r\033[K      %.*s' $((columns - 8)) "$((SECONDS - step_started)) s: $(activity)"
        elif [[ $((SECONDS - told)) -ge $LIFE_S ]]; then
            printf '      %d s: %.150s\n' $((SECONDS - step_started)) "$(activity)"
            told=$SECONDS
        fi
    done
}

stop_watching() {
    [[ -n $watcher ]] || return 0
    kill "$watcher" 2>/dev/null
    wait "$watcher" 2>/dev/null
    watcher=""
    if [[ -t 1 ]]; then printf '\r\033[K'; fi
}

# fail STATUS COMMAND
fail() {
    # An interrupted command ends with 130, and so does set-up, through its trap.
    if [[ $1 -eq 130 ]]; then interrupted; fi
    local cause
    cause=$(cause_of "$1")
    keep_failure "$cause"
    {
        echo
        echo "Set-up failed in step '${TITLES[$step_name]}' (exit code $1)."
        echo "  cause:   $cause"
        echo "  command: $2"
        echo "  log:     $step_log"
        echo "The log ends with:"
        tail -n 20 "$step_log" | sed 's/^/  | /'
        echo "Fix the cause and run ./baxter.sh setup again; finished steps are skipped."
    } >&2
    # A command that ended by itself has cleaned up; a killed one, or one without disk space, may not have.
    if [[ $1 -le 128 && $cause != "the disk is full"* ]]; then nothing_half_done; fi
    exit "$1"
}

# refuse REASON: a step that cannot even start.
refuse() {
    {
        echo
        echo "Set-up cannot continue in step '${TITLES[$step_name]}': $1"
        echo "  log:     $step_log"
    } >&2
    echo "$1" 2>/dev/null >>"$step_log"
    keep_failure "$1"
    if [[ $1 != *"the disk is full"* ]]; then nothing_half_done; fi
    exit 1
}

# keep_failure CAUSE: for the doctor
keep_failure() { printf '%s\t%s\n' "$step_name" "$1" 2>/dev/null >"$STATE/failure" || true; }

nothing_half_done() {
    if [[ -z $cut_off_step ]]; then rm -f "$STATE/at_work"; fi
}

interrupted() {
    trap - INT
    # It is not waited for: in a trap that has interrupted `wait`, bash may wait for another child instead.
    if [[ -n $watcher ]]; then kill "$watcher" 2>/dev/null; fi
    if [[ -t 1 ]]; then printf '\r\033[K'; fi
    echo >&2
    echo "Set-up was interrupted in step '${TITLES[${step_name:-none}]:-start}' (log: ${step_log:-none});" \
         "./baxter.sh setup continues from there." >&2
    exit 130
}

# full_disks: the folders that set-up writes to and whose disk is full
full_disks() {
    local folder free
    for folder in "$LAB_ROOT" "${TMPDIR:-/tmp}" /var "${HOME:-/}"; do
        free=$(df -Pk "$folder" 2>/dev/null | awk 'NR == 2 { print $4 }')
        if [[ -n $free && $free -lt $FULL_BELOW_KB ]]; then printf '%s\n' "$folder"; fi
    done
}

# disk_note ELSE: a sentence that the disk is full, or ELSE
disk_note() {
    local full
    full=$(full_disks | paste -sd ' ')
    if [[ -n $full ]]; then
        echo "the disk is full: nothing is left for $full (df -h); all of set-up takes some 5 GB"
    else
        echo "$1"
    fi
}

# first_line PATTERN: the first line of the log that matches the (extended, case-insensitive) pattern
first_line() { grep -aiEm 1 "$1" "$step_log" 2>/dev/null | sed 's/^[[:space:]]*//' | cut -c 1-200; }

# cause_of STATUS: the most likely error, in words, with the line of the log that shows it.
cause_of() {
    local line
    line=$(first_line 'no space left on device|disk quota exceeded|enough free space|not enough space in')
    if [[ -n $line ]]; then
        echo "the disk is full (df -h; all of set-up takes some 5 GB): $line"
    elif [[ -n $(full_disks) ]]; then
        disk_note
    elif [[ $1 -eq 137 || $1 -eq 143 ]]; then
        echo "it was killed, by a user or for lack of memory (free -h)"
    elif line=$(first_line 'certificate.?verif|self.signed certificate|unable to get local issuer') && [[ -n $line ]]; then
        echo "a certificate that is not trusted here (a company's proxy? PIP_CERT, update-ca-certificates): $line"
    elif line=$(first_line 'temporary failure|could not resolve|name or service not known|network is unreachable|no route to host|failed to establish a new connection|connection (timed out|refused|failed)|could not connect|read timed out') &&
        [[ -n $line ]]; then
        echo "the network cannot be reached (cable, Wi-Fi, proxy?): $line"
    elif line=$(first_line 'unable to locate package|no installation candidate') && [[ -n $line ]]; then
        echo "a package is missing in the system's sources (docs/platforms.md lists suitable systems): $line"
    elif line=$(first_line 'cannot find -lE?GL|(EGL/egl|GL/gl)\.h: no such file') && [[ -n $line ]]; then
        echo "a Python package is compiled here and misses OpenGL's libraries (sudo apt install libegl-dev libgl-dev): $line"
    elif line=$(first_line 'permission denied|read-only file system') && [[ -n $line ]]; then
        echo "no permission to write files (was set-up run with sudo before?): $line"
    else
        line=$(grep -aiE '(^E:|error|fatal|refused|failed)' "$step_log" 2>/dev/null | tail -n 1 | cut -c 1-200)
        echo "${line:-see the log}"
    fi
}
