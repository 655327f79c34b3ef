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
"""Keep ROS 2 traffic on this machine."""

from __future__ import annotations

import os

NEWER = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
HUMBLE = 'ROS_LOCALHOST_ONLY'


def stay_on_this_machine() -> None:
    """
    Let this process and its children find nobody on other machines, unless told otherwise.

    A simulated robot has the names of a real one, which must not obey in its place.  Call it
    before ``rclpy.init``.
    """
    if NEWER in os.environ or HUMBLE in os.environ:
        return
    # Later distributions warn about Humble's variable, and Humble ignores theirs.
    if os.environ.get('ROS_DISTRO') == 'humble':
        os.environ[HUMBLE] = '1'
    else:
        os.environ[NEWER] = 'LOCALHOST'
