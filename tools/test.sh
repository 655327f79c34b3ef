#!/usr/bin/env bash
# Run the pure tests on all cores, then those in real time by more workers: they mostly wait.
#
# usage: PYTEST='python -m pytest' WORKERS=6 tools/test.sh [MARKED]
#
# Documents are left to `make docs`.
set -u
no_test=5  # pytest's exit code; one of the parts may have none
code=$no_test
run() {
    $PYTEST -m "$1 and not document$marked" "${@:2}" test
    local ended=$?
    if [ $ended != $no_test ] && { [ $code = 0 ] || [ $code = $no_test ]; }; then code=$ended; fi
}
marked=${1:+ and ($1)}
run '(not ros and not real_time)' -n "$([ "$WORKERS" = 0 ] && echo 0 || nproc)"
run '(ros or real_time)' -n "$WORKERS" --dist worksteal
exit $code
