#!/usr/bin/env bash
# Check style and docstrings with the releases of the linters that ament runs on Humble, configured
# as ament_flake8 and ament_pep257 configure them there.
#
# usage: tools/check_humble_linters.sh PYTHON ENVIRONMENT
#
# Python 3.12 and newer cannot run them: then another Python takes its place, if there is one.
set -euo pipefail
cd "$(dirname "$0")/.."

fits='import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 11))'
for python in "$1" python3.10 python3.11 none; do
    if "$python" -c "$fits" 2>/dev/null; then break; fi
done
if [ "$python" = none ]; then
    echo 'check: the linters of Humble are skipped, for they need Python 3.10 or 3.11'
    exit 0
fi
"$python" tools/set_up.py --for=humble-linters "$2"

# -I: without the libraries of a ROS that is sourced.
"$2/bin/python" -I -m pydocstyle --config=tools/humble_linters.ini &
docstrings=$!
result=0
"$2/bin/python" -I -m flake8 --config=tools/humble_linters.ini || result=1
wait "$docstrings" || result=1
exit "$result"
