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
"""Who stops the robot, and the time limits for that."""

from __future__ import annotations

NODE, GUARDIAN, NOTHING = 'the node', 'the guardian', 'nothing to stop: it runs on'
COMMAND_TIMEOUT = 'the robot: its command timeout'
#: The time limits [s] for a signal, SIGKILL and SIGSTOP (docs/safety.md, "What is guaranteed"),
#: and for lost odometry and a lost subscriber (docs/safety.md).
SIGNAL, KILLED, FROZEN = 0.02, 0.05, 0.15
ODOMETRY, GRAPH = 1.3, 23.0
#: The time limit for a frozen guardian [s]: GUARDIAN_TIMEOUT and a few heartbeats.
GUARDIAN_FROZEN = 0.6
#: The time limits for velocities from a new publisher, and from a discovered publisher [s].
NEW_PUBLISHER, KNOWN_PUBLISHER = 0.5, 0.05
#: The time limit for a second program [s]; a program publishes its claim every 0.5 s.
CLAIM = 1.0
#: Time limit of a program that ends while other threads drive [s], with the end of Python.
EXIT = 0.1
