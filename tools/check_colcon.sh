#!/usr/bin/env bash
# Build the package in a ROS workspace, run what was installed, and run the quick tests there.
#
# usage: tools/check_colcon.sh ENVIRONMENT
#
# The environment has colcon and ROS but not this package, and the workspace has a copy of the
# source, so that nothing but the installed package can be what runs.  The tests that start nodes
# or take long are left to `make test`: what is at stake here is whether colcon finds the tests,
# runs them beside the installed package and counts them.
set -euo pipefail

name=kachaka_simple_control
environment=$(realpath "$1")
root=$(cd "$(dirname "$0")/.." && pwd)
workspace=$(mktemp -d "${TMPDIR:-/tmp}/$name.XXXXXX")
trap 'rm -rf "$workspace"' EXIT

export PATH="$environment/bin:$PATH"
export COLCON_HOME="$workspace/.colcon"  # nobody's own settings
# Where the system has the very release that the environment wants, there is no command in the
# environment, and the system's would test with the system's Python.
colcon() { python -m colcon "$@"; }
mkdir -p "$workspace/src/$name"
tar -C "$root" --exclude='./.[!.]*' --exclude=__pycache__ --exclude='*.egg-info' \
    --exclude=./build --exclude=./install --exclude=./log -cf - . \
    | tar -C "$workspace/src/$name" -xf -
cd "$workspace"

colcon build --event-handlers console_cohesion+
set +u  # setup.bash reads variables that may not be set
source install/setup.bash
set -u

program="install/$name/lib/$name/$name"
test -x "$program" || { echo "colcon: $program is missing, 'ros2 run' would not find it"; exit 1; }
python - "$workspace/install" <<END
import sys, $name
sys.exit(0 if $name.__file__.startswith(sys.argv[1]) else f'colcon: {$name.__file__} runs')
END
"$program" --sim

rm -r "src/$name/$name"  # pytest would find it before the installed package
selection='not ros and not real_time and not slow'
export HYPOTHESIS_PROFILE=few

# Plug-ins may keep tests from being found, and then nothing fails: as many tests must have run as
# a pytest without any of them finds.
collection=$(cd "src/$name" && PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 \
    python -m pytest --collect-only --quiet -p no:cacheprovider -m "$selection") \
    || { echo "$collection"; echo 'colcon: the tests cannot be collected'; exit 1; }
expected=$(grep -c '::' <<<"$collection") || { echo 'colcon: there are no tests'; exit 1; }

colcon test --return-code-on-test-failure --event-handlers console_cohesion+ \
    --pytest-args -n "$(nproc)" -m "$selection"
results=$(colcon test-result --verbose)
echo "$results"
ran=$(sed -n 's/^Summary: \([0-9]*\) tests.*/\1/p' <<<"$results")
if [ "${ran:-0}" -lt "$expected" ]; then
    echo "colcon: ${ran:-0} of $expected tests ran"
    exit 1
fi
