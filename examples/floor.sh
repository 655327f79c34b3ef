#!/bin/sh
# Copyright 2026 kachaka_simple_control contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# Drive the same square on one simulated floor: as it is, calibrated, in a closed loop, in one that
# ignores the delay of the robot, and past a person who crosses its way.  Leaves reports and a plot
# in a new folder.

set -e
folder=${1:-floor}
floor='--sim --linear-gain 0.95 --angular-gain 0.97 --veer 0.0349066 --dead-time 0.2 --lag 0.1'
drives=
trap '[ -z "$drives" ] || kill $drives; exit 130' INT TERM
mkdir "$folder"
cd "$folder"
mkdir simulated

# Drive in the background: each drive has a robot and a node in a namespace of its own.  It begins
# when the programs of the one before have started, which takes all of the cores.
drive() {
    report=$1
    namespace=$2
    shift 2
    # The options of the floor are several words.
    # shellcheck disable=SC2086
    kachaka_simple_control square --rate 20 --quiet "$@" $floor --report "simulated/$report" \
        --ros-args -r "__ns:=/$namespace" -p "robot_namespace:=/$namespace/kachaka" > /dev/null &
    drives="$drives $!"
    sleep 4
}

echo 'A simulated floor: 5 % and 3 % slow, 2 degrees to the left on each metre, 0.3 s late.'
# shellcheck disable=SC2086
kachaka_calibrate --floor simulated --output measured.yaml $floor
sed 's/delay: .*/delay: 0 s/' measured.yaml > no_delay.yaml
echo 'Five robots drive beside each other; one is held before a person who crosses its way.'
drive 'as it is' plain
drive calibrated calibrated --robot ./measured.yaml
drive 'closed loop' closed --robot ./measured.yaml --closed-loop
drive 'closed loop, delay ignored' no_delay --robot ./no_delay.yaml --closed-loop
drive 'a person crosses' watching --robot ./measured.yaml --closed-loop --watch --floor crossing
for one in $drives; do wait "$one"; done
kachaka_compare --plot simulated_floor.svg \
    'simulated/as it is' simulated/calibrated 'simulated/closed loop' \
    'simulated/closed loop, delay ignored'
kachaka_compare 'simulated/closed loop' 'simulated/a person crosses'
echo "All of it is in $folder: reports in simulated/, all paths in simulated_floor.svg"
