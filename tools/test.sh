#!/usr/bin/env bash
# Run the pure tests on all cores, then those in real time by more workers: they mostly wait; then
# those of the console in a browser.
#
# usage: PYTEST='python -m pytest' WORKERS=7 tools/test.sh [MARKED]
#
# WORKERS is for an idle machine: where other programs use the cores, fewer workers run in the rest.
# Documents are left to `make docs`.
set -u
no_test=5  # pytest's exit code; one of the parts may have none
code=$no_test
# Each worker imports all test files that it gets: the workers in real time get only their own.
mapfile -t real_time < <(grep -rlE 'mark\.(ros|real_time)' test --include='test_*.py' | sort)
mapfile -t browser < <(grep -rlE 'mark\.browser' test --include='test_*.py' | sort)
run() {
    $PYTEST -m "$1 and not document$marked" "${@:2}"
    local ended=$?
    if [ $ended != $no_test ] && { [ $code = 0 ] || [ $code = $no_test ]; }; then code=$ended; fi
}
# Print the time that all cores have been idle and the time that has passed, both in ticks.
ticks() {
    awk '/^cpu /{print $5 + $6, $2 + $3 + $4 + $5 + $6 + $7 + $8 + $9}' /proc/stat
}
workers_beside_others() {
    local idle all idle_later all_later
    read -r idle all < <(ticks)
    sleep 2
    read -r idle_later all_later < <(ticks)
    # Rounded up; where 9 tenths of the time are idle, the machine is.
    awk -v idle=$((idle_later - idle)) -v all=$((all_later - all)) -v workers="$WORKERS" 'BEGIN {
        share = idle / all
        print (share < 0.9 && workers > 0) ? int(workers * share) + 1 : workers
    }'
}
marked=${1:+ and ($1)}
cores=$([ "$WORKERS" = 0 ] && echo 0 || nproc)
run '(not ros and not real_time)' -n "$cores" --dist worksteal test
workers=$(workers_beside_others)
[ "$workers" = "$WORKERS" ] || echo "other programs use the cores: $workers workers, not $WORKERS"
run '(ros or real_time) and not browser' -n "$workers" --dist worksteal "${real_time[@]}"
# A browser takes a whole core for a moment, and the tests beside it would be late.
run browser -n "$cores" --dist worksteal "${browser[@]}"
exit $code
