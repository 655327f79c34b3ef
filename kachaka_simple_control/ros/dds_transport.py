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
"""Set the DDS transport to UDP without shared memory and, on request, to this machine only."""

from __future__ import annotations

import gc
import os
from pathlib import Path
import re

from kachaka_simple_control.errors import UsageError

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
#: The variable that lists other machines; they are discovered even outside the discovery range.
PEERS = 'ROS_STATIC_PEERS'
#: The variable that Humble reads instead of the discovery range.
LOCALHOST_ONLY = 'ROS_LOCALHOST_ONLY'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
#: Variables that name a file of XML profiles, by the major version of Fast DDS.
PROFILES = {2: 'FASTRTPS_DEFAULT_PROFILES_FILE', 3: 'FASTDDS_DEFAULT_PROFILES_FILE'}
#: The Fast DDS version (major, minor) of Humble.  Humble does not know the discovery range.
HUMBLE = (2, 6)
#: All variables with which a user chooses the transport or the discovery range.
CHOICES = (RANGE, PEERS, LOCALHOST_ONLY, TRANSPORTS, *PROFILES.values())
#: Our XML profiles: UDP without shared memory, to all machines or to this machine only.
UDP, LOOPBACK = (Path(__file__).with_name(name) for name in ('udp.xml', 'loopback.xml'))


def use_udp_transport() -> None:
    """
    Make Fast DDS use UDP only in this process and its children, unless the user chose a transport.

    All processes of a machine share the shared memory of Fast DDS.  A process that was killed
    leaves its part locked.  Another process that discovers a new participant then waits for the
    lock, for a third of a second each time.  All its publishers wait meanwhile, so a velocity or a
    stop is sent too late.  Our messages are small, so shared memory would not make them faster.

    Call this function before the first node of a context is created.  The Fast DDS of Humble and
    other middlewares keep their transport.
    """
    if not _is_transport_chosen():
        _use_profile(UDP)


def use_localhost_only() -> None:
    """
    Limit discovery of this process and its children to this machine, unless the user set a range.

    A simulated robot has the same ROS names as a real robot.  The real robot must not receive the
    velocities for the simulated robot.  With Fast DDS, an XML profile sets the limit.  The ROS
    range LOCALHOST is not used: it enables shared memory, and every third new participant is
    discovered three seconds late.  Call this function before ``rclpy.init``.

    Like the ROS range, the profile also sends announcements by unicast to the first 32
    participants of this machine.  Nodes with the ROS range need this: they receive no multicast,
    and they announce themselves only to these 32 participants.  The number is not larger, because
    Fast DDS receives nothing until it has sent all these announcements, and the answer of a fast
    robot is lost.  With 120 participants, every answer was lost.  The announcements are 320 small
    packets per second for five seconds, then 128 per second, all on this machine.

    Both profiles announce a participant ten times per second for five seconds, then once per
    second (on this machine only: four times per second).  The default of Fast DDS is five
    announcements, then one every three seconds: every second or third robot was discovered three
    seconds late.  ``benchmarks/experiments/driven_robot.py`` measures how long a drive takes to
    start.
    """
    if os.environ.get(RANGE, 'LOCALHOST') != 'LOCALHOST' or LOCALHOST_ONLY in os.environ:
        return
    if _is_humble():
        os.environ[LOCALHOST_ONLY] = '1'
    elif _is_transport_chosen() or os.environ.get(PEERS) or not _use_profile(LOOPBACK):
        os.environ[RANGE] = 'LOCALHOST'
    else:
        os.environ[RANGE] = 'SUBNET'


def start_on_this_machine(own: object) -> None:
    """
    Restrict ROS to this machine, and initialise ROS if needed.

    A simulated robot has the same names as a real robot.  If programs on other machines discovered
    the simulated robot, they would end their drives of a real robot.

    :param own: the node that is being created
    :raises UsageError: if it is too late to restrict ROS to this machine
    """
    import rclpy
    from rclpy.node import Node
    if rclpy.ok() and not is_range_chosen():
        # rclpy has already read its environment variables.  Only the DDS profile is read later,
        # when the first node is created.
        others = (found for found in gc.get_objects()
                  if issubclass(type(found), Node) and found is not own)
        if not can_still_be_localhost_only() or next(others, None) is not None:
            raise UsageError(
                'sim=True comes too late to keep the simulated robot on this machine: make this '
                'node first, before rclpy.init(), which it then calls itself; or set '
                'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST (on Humble ROS_LOCALHOST_ONLY=1)')
    use_localhost_only()
    if not rclpy.ok():
        rclpy.init()


def is_localhost_requested() -> bool:
    """Return whether the environment sets the ROS discovery range to LOCALHOST."""
    return os.environ.get(RANGE) == 'LOCALHOST'


def is_range_chosen() -> bool:
    """Return whether an environment variable or our XML profile sets the discovery range."""
    is_range_read = RANGE in os.environ and not _is_humble()
    return is_range_read or LOCALHOST_ONLY in os.environ or is_localhost_only()


def can_still_be_localhost_only() -> bool:
    """Return whether discovery can still be limited to this machine after ``rclpy.init``."""
    is_profile_read = _fast_dds() not in (None, HUMBLE)
    return is_profile_read and not _is_transport_chosen() and not os.environ.get(PEERS)


def is_localhost_only() -> bool:
    """Return whether the ROS variables or our XML profile limit discovery to this machine."""
    is_range_localhost = is_localhost_requested() and not _is_humble()
    if is_range_localhost or os.environ.get(LOCALHOST_ONLY) == '1':
        return not os.environ.get(PEERS)
    return str(LOOPBACK) in (os.environ.get(name) for name in PROFILES.values())


def _use_profile(profile: Path) -> bool:
    """
    Make Fast DDS read an XML profile.

    :returns: whether Fast DDS will read the profile, because its version is known and the file
        exists
    """
    version = _fast_dds()
    if version in (None, HUMBLE) or not profile.is_file():
        return False
    os.environ[PROFILES[version[0]]] = str(profile)
    return True


def _is_humble() -> bool:
    """Return whether this ROS is Humble, which does not read the discovery range."""
    return _fast_dds() == HUMBLE or os.environ.get('ROS_DISTRO') == 'humble'


def _is_transport_chosen() -> bool:
    return any(name in os.environ for name in (TRANSPORTS, *PROFILES.values()))


def _fast_dds() -> tuple[int, int] | None:
    """
    Return the version (major, minor) of the Fast DDS that this process uses.

    :returns: None for another middleware, or if the version is not known
    """
    try:
        from rclpy.utilities import get_rmw_implementation_identifier
        get_rmw_implementation_identifier()  # loads the middleware
        libraries = Path('/proc/self/maps').read_text(errors='replace')
    except (ImportError, OSError):
        return None
    found = re.search(r'/libfast(?:rtps|dds)\.so\.(\d+)\.(\d+)', libraries)
    version = (int(found[1]), int(found[2])) if found else None
    return version if version and version[0] in PROFILES else None
