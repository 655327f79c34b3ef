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
"""
Keep what is sent on this machine, in a ROS domain of its own.

To be called before anything loads rclpy: no robot and no other run may receive what is sent here.
It imports no ROS itself, so that tests and benchmarks can import it first.
"""

from __future__ import annotations

import os
import random

from kachaka_simple_control.ros.dds_transport import use_localhost_only


def use_random_domain() -> None:
    """Choose a ROS domain at random, unless the environment names one."""
    os.environ.setdefault('ROS_DOMAIN_ID', str(random.randint(1, 100)))


def isolate_ros() -> None:
    """Choose a ROS domain, and keep discovery on this machine, unless the user chose."""
    use_random_domain()
    use_localhost_only()
