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
mkdir "$folder"
cd "$folder"
mkdir simulated

drive() {
    report=$1
    shift
    # The options of the floor are several words.
    # shellcheck disable=SC2086
    kachaka_simple_control square --rate 20 --quiet "$@" $floor --report "simulated/$report" > /dev/null
}

echo 'A simulated floor: 5 % and 3 % slow, 2 degrees to the left on each metre, 0.3 s late.'
# shellcheck disable=SC2086
kachaka_calibrate --floor simulated --output measured.yaml $floor
sed 's/delay: .*/delay: 0 s/' measured.yaml > no_delay.yaml
drive 'as it is'
drive calibrated --robot ./measured.yaml
drive 'closed loop' --robot ./measured.yaml --closed-loop
drive 'closed loop, delay ignored' --robot ./no_delay.yaml --closed-loop
kachaka_compare --plot simulated_floor.svg \
    'simulated/as it is' simulated/calibrated 'simulated/closed loop' \
    'simulated/closed loop, delay ignored'
echo 'A person crosses its way: it is held before the person, and goes on by itself.'
drive 'a person crosses' --robot ./measured.yaml --closed-loop --watch --floor crossing
kachaka_compare 'simulated/closed loop' 'simulated/a person crosses'
echo "All of it is in $folder: reports in simulated/, all paths in simulated_floor.svg"
