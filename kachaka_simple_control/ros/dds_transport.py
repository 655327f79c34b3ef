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
"""The transport of DDS: no shared memory and, on request, no other machines."""

from __future__ import annotations

import os
from pathlib import Path
import re

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
#: Other machines that are discovered nevertheless.
PEERS = 'ROS_STATIC_PEERS'
#: Humble's, in place of the range.
LOCALHOST_ONLY = 'ROS_LOCALHOST_ONLY'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
#: Variables that name a file of XML profiles, by the major version of Fast DDS.
PROFILES = {2: 'FASTRTPS_DEFAULT_PROFILES_FILE', 3: 'FASTDDS_DEFAULT_PROFILES_FILE'}
#: The Fast DDS of Humble, whose rclpy does not know the range.
HUMBLE = (2, 6)
#: All variables by which a user chooses the transport or the range.
CHOICES = (RANGE, PEERS, LOCALHOST_ONLY, TRANSPORTS, *PROFILES.values())
#: Our XML profiles: UDP without shared memory, to all machines or to this one alone.
UDP, LOOPBACK = (Path(__file__).with_name(name) for name in ('udp.xml', 'loopback.xml'))


def use_udp_transport() -> None:
    """
    Make Fast DDS send by UDP alone in this process and its children, unless the user chose.

    Its shared memory is common to all processes of a machine, and one that was killed leaves its
    part locked.  A process that discovers a newcomer then waits for it, a third of a second at a
    time, with all its publishers held up: a velocity, or a stop, comes that much too late.  Our
    messages are too small to gain anything by shared memory.

    To be called before the first node of a context is created.  Humble's Fast DDS and other
    middlewares keep their transport.
    """
    if not _is_transport_chosen():
        _use_profile(UDP)


def use_localhost_only() -> None:
    """
    Keep discovery of this process and its children on this machine, unless the user chose.

    A simulated robot has the names of a real one, which must not obey in its place.  With Fast
    DDS a profile does it: ROS's own range LOCALHOST brings shared memory with it, and every third
    newcomer is discovered three seconds late.  To be called before ``rclpy.init``.

    As ROS's own range does, the profile announces itself to the first 32 participants of this
    machine by unicast too: nodes with that range receive no multicast, and announce themselves to
    no others.  More than 32 would reach further, but Fast DDS receives nothing until it has
    announced itself to all of them, and the answer of a quick robot is lost: with 120, every
    answer was.  The announcements are 320 small packets a second for five seconds, then 128, all
    on this machine.

    Both profiles announce a participant ten times a second for five seconds, then once a second,
    or four times on this machine alone.  By default Fast DDS does so five times in all, and then
    every three seconds: every second or third robot was discovered that much later.
    ``benchmarks/experiments/driven_robot.py`` measures how long a drive takes to start.
    """
    if os.environ.get(RANGE, 'LOCALHOST') != 'LOCALHOST' or LOCALHOST_ONLY in os.environ:
        return
    if _is_humble():
        os.environ[LOCALHOST_ONLY] = '1'
    elif _is_transport_chosen() or os.environ.get(PEERS) or not _use_profile(LOOPBACK):
        os.environ[RANGE] = 'LOCALHOST'
    else:
        os.environ[RANGE] = 'SUBNET'


def is_localhost_requested() -> bool:
    """Return whether the environment sets ROS's range LOCALHOST, for ``use_localhost_only``."""
    return os.environ.get(RANGE) == 'LOCALHOST'


def is_range_chosen() -> bool:
    """Return whether the environment says how far discovery goes, or our profile does."""
    is_range_read = RANGE in os.environ and not _is_humble()
    return is_range_read or LOCALHOST_ONLY in os.environ or is_localhost_only()


def can_still_be_localhost_only() -> bool:
    """Return whether a process that has initialised ROS can still be kept on this machine."""
    is_profile_read = _fast_dds() not in (None, HUMBLE)
    return is_profile_read and not _is_transport_chosen() and not os.environ.get(PEERS)


def is_localhost_only() -> bool:
    """Return whether ROS's variables or our profile keep discovery on this machine."""
    is_range_localhost = is_localhost_requested() and not _is_humble()
    if is_range_localhost or os.environ.get(LOCALHOST_ONLY) == '1':
        return not os.environ.get(PEERS)
    return str(LOOPBACK) in (os.environ.get(name) for name in PROFILES.values())


def _use_profile(profile: Path) -> bool:
    """Make Fast DDS read an XML profile; return whether it will."""
    version = _fast_dds()
    if version in (None, HUMBLE) or not profile.is_file():
        return False
    os.environ[PROFILES[version[0]]] = str(profile)
    return True


def _is_humble() -> bool:
    """Return whether this is Humble, which does not read the range."""
    return _fast_dds() == HUMBLE or os.environ.get('ROS_DISTRO') == 'humble'


def _is_transport_chosen() -> bool:
    return any(name in os.environ for name in (TRANSPORTS, *PROFILES.values()))


def _fast_dds() -> tuple[int, int] | None:
    """Return the version of the Fast DDS that this process uses; None for another middleware."""
    try:
        from rclpy.utilities import get_rmw_implementation_identifier
        get_rmw_implementation_identifier()  # loads it
        libraries = Path('/proc/self/maps').read_text(errors='replace')
    except (ImportError, OSError):
        return None
    found = re.search(r'/libfast(?:rtps|dds)\.so\.(\d+)\.(\d+)', libraries)
    version = (int(found[1]), int(found[2])) if found else None
    return version if version and version[0] in PROFILES else None
