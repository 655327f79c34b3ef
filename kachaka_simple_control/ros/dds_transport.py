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
"""By which ways ROS 2 traffic goes: not by shared memory, and on request on this machine alone."""

from __future__ import annotations

import os
from pathlib import Path
import re

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
#: Other machines that are to be found nevertheless.
PEERS = 'ROS_STATIC_PEERS'
#: Humble's, in place of the range.
LOCALHOST_ONLY = 'ROS_LOCALHOST_ONLY'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
#: Files in which people choose transports themselves, by the major version of Fast DDS.
PROFILES = {2: 'FASTRTPS_DEFAULT_PROFILES_FILE', 3: 'FASTDDS_DEFAULT_PROFILES_FILE'}
#: The Fast DDS of Humble, whose rclpy does not know the range.
HUMBLE = (2, 6)
#: Whatever people choose ways with.
CHOICES = (RANGE, PEERS, LOCALHOST_ONLY, TRANSPORTS, *PROFILES.values())
#: Profiles of ours: how to send without shared memory, to everybody or to this machine alone.
UDP, LOOPBACK = (Path(__file__).with_name(name) for name in ('udp.xml', 'loopback.xml'))


def use_udp_transport() -> None:
    """
    Let Fast DDS send by UDP alone in this process and its children, unless told otherwise.

    Its shared memory is common to all programs of a machine, and one of them that was killed
    leaves its part of it locked.  Whoever meets a newcomer then waits for it, a third of a second
    at a time, with every publisher of the process held up: a velocity, or a stop, comes that much
    too late.  What we send is too small to gain anything by shared memory.

    Call it before the first node of a context is made.  Humble's Fast DDS and other middlewares
    keep what they have.
    """
    if not _is_chosen():
        _choose(UDP)


def use_localhost_only() -> None:
    """
    Let this process and its children find nobody on other machines, unless told otherwise.

    A simulated robot has the names of a real one, which must not obey in its place.  With Fast
    DDS a profile does it: ROS's own range LOCALHOST brings shared memory with it, and leaves
    every third newcomer unheard for three seconds.  Call it before ``rclpy.init``.

    The profile greets the first 32 participants of this machine by unicast, too, as ROS's own
    range does: nodes with that range hear no multicast, and greet no others by themselves.  More
    than 32 would reach further, but Fast DDS listens only after it has greeted them all, and the
    answer of a quick robot is lost until then: with 120, every answer was.  Greetings are 320
    small packets a second for five seconds, then 32, all of them on this machine.

    Both profiles also announce a newcomer for five seconds, ten times a second, and then once a
    second.  Fast DDS does so five times in all, and then every three seconds: on a busy machine
    every third robot was found that much later.
    """
    if os.environ.get(RANGE, 'LOCALHOST') != 'LOCALHOST' or LOCALHOST_ONLY in os.environ:
        return
    if _fast_dds() == HUMBLE or os.environ.get('ROS_DISTRO') == 'humble':
        os.environ[LOCALHOST_ONLY] = '1'
    elif _is_chosen() or os.environ.get(PEERS) or not _choose(LOOPBACK):
        os.environ[RANGE] = 'LOCALHOST'
    else:
        os.environ[RANGE] = 'SUBNET'


def is_localhost_requested() -> bool:
    """
    Tell whether ROS is asked to find nobody on other machines.

    :returns: whether ``use_localhost_only`` does the same, and better
    """
    return os.environ.get(RANGE) == 'LOCALHOST'


def is_localhost_only() -> bool:
    """
    Tell whether this process finds nobody on other machines.

    :returns: whether it was told so, by ROS's own variables or by ``use_localhost_only``
    """
    if is_localhost_requested() or os.environ.get(LOCALHOST_ONLY) == '1':
        return not os.environ.get(PEERS)
    return str(LOOPBACK) in (os.environ.get(name) for name in PROFILES.values())


def _choose(profile: Path) -> bool:
    """Let Fast DDS read a profile of ours; return whether it will."""
    version = _fast_dds()
    if version in (None, HUMBLE) or not profile.is_file():
        return False
    os.environ[PROFILES[version[0]]] = str(profile)
    return True


def _is_chosen() -> bool:
    return any(name in os.environ for name in (TRANSPORTS, *PROFILES.values()))


def _fast_dds() -> tuple[int, int] | None:
    """Return the version of Fast DDS that this process sends with; None if it is no such."""
    try:
        from rclpy.utilities import get_rmw_implementation_identifier
        get_rmw_implementation_identifier()  # loads it
        libraries = Path('/proc/self/maps').read_text(errors='replace')
    except (ImportError, OSError):
        return None
    found = re.search(r'/libfast(?:rtps|dds)\.so\.(\d+)\.(\d+)', libraries)
    version = (int(found[1]), int(found[2])) if found else None
    return version if version and version[0] in PROFILES else None
