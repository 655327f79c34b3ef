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
"""Make Fast DDS use UDP instead of shared memory, and limit discovery to this machine."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import gc
import os
from pathlib import Path
import re
import tempfile

from kachaka_simple_control.control.timing import SEARCH_JOIN_PERIOD, SEARCH_LEASE_TIME
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.ros.environment import leave_discovery_server

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

#: Matches the part of a profile that says how often a participant announces itself.
ANNOUNCEMENTS = re.compile('<leaseAnnouncement>.*</initialAnnouncements>', re.DOTALL)


def use_udp_transport() -> None:
    """
    Make Fast DDS use only UDP in this process and its children, unless the user chose a transport.

    With ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, do what ``use_localhost_only`` does.  Call this
    before ``rclpy.init``: later, but before the first node of a context, this range still means
    shared memory.  With Humble's Fast DDS or another middleware, only this range has an effect.

    With shared memory, a killed process can delay the messages of others on its machine by a third
    of a second, and the creation of a node by 2 to 6 s.
    """
    # By default, all processes of a machine use the same shared memory of Fast DDS.  A process
    # that was killed leaves its part of this memory locked.  Each time another process discovers a
    # new participant, this process waits for the lock for a third of a second, and none of its
    # publishers can send meanwhile.  The messages of this package are small, so shared memory
    # would not make them faster.
    #
    # With udp.xml, a participant announces itself 10 times per second for 5 s, then once per
    # second.  By default, Fast DDS sends 5 announcements, then one every 3 s.  With this default,
    # every second or third robot was discovered 3 s late.
    # ``make bench`` measures how long a drive takes to start.
    #
    # By default, the participants of one process discover each other without the network, and Fast
    # DDS sometimes loses one of them for good.  With our profiles, they use UDP for this.
    # Measured with benchmarks/experiments/same_process.py, ten at once: 5 of 1300 were lost.
    if _is_localhost_requested():
        use_localhost_only()
    if not _is_transport_chosen():
        _use_profile(UDP)


def will_share_memory() -> bool:
    """
    Return whether Fast DDS uses shared memory unless ``use_udp_transport`` comes first.

    It does with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, which ``rclpy.init`` reads.
    """
    return (_is_localhost_requested() and _fast_dds() not in (None, HUMBLE)
            and not _is_transport_chosen() and not os.environ.get(PEERS))


def use_localhost_only() -> None:
    """
    Limit DDS discovery of this process and its children to this machine.

    A simulated robot has the names of a real one, which must not receive its velocities.  Call
    this before ``rclpy.init``.  Nothing is done if the user has set ROS_LOCALHOST_ONLY, or
    ROS_AUTOMATIC_DISCOVERY_RANGE to another value than LOCALHOST.  Where the XML profile
    ``loopback.xml`` of Fast DDS cannot be used, a variable of ROS sets the limit.
    """
    # The profile is preferred, because with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST Fast DDS uses
    # shared memory, and every third new participant is discovered 3 s late.
    #
    # With the profile, a participant announces itself 10 times per second for 5 s, then 4 times
    # per second.  It does so by multicast, and by unicast to the first 32 participants of this
    # machine.  These are 320 small unicast packets per second for 5 s, then 128 per second.  Nodes
    # with the ROS setting LOCALHOST need the unicast: they receive no multicast, and announce
    # themselves only to these 32 participants.  A larger number would do harm: Fast DDS receives
    # nothing until it has sent all unicast announcements, so the answer of a fast robot is lost.
    # With 120 participants, every answer was lost.
    if os.environ.get(RANGE, 'LOCALHOST') != 'LOCALHOST' or LOCALHOST_ONLY in os.environ:
        return
    if _is_humble():
        os.environ[LOCALHOST_ONLY] = '1'
    elif _is_transport_chosen() or os.environ.get(PEERS) or not _use_profile(LOOPBACK):
        os.environ[RANGE] = 'LOCALHOST'
    else:
        os.environ[RANGE] = 'SUBNET'


@contextlib.contextmanager
def repeated_joining() -> Iterator[None]:
    """
    Make nodes join the ROS graph again every SEARCH_JOIN_PERIOD (0.25 s), as a context manager.

    Create the first node of the process in the block; all later ones do the same.  They can only
    search, because others match their publishers and subscriptions only for a moment.  No effect
    with Humble's Fast DDS, another middleware, or a transport that the user chose.

    Fast DDS announces a participant before it listens, and others answer it once.  An answer that
    comes too early is lost, and their next announcement comes up to 3 s later.
    """
    # The other participants forget this one after SEARCH_LEASE_TIME, and answer it again at its
    # next announcement, when it listens.
    name = next((name for name in PROFILES.values()
                 if os.environ.get(name) in (str(UDP), str(LOOPBACK))), None)
    if name is None:
        yield
        return
    profile = ANNOUNCEMENTS.sub(
        f'<leaseDuration>{_seconds(SEARCH_LEASE_TIME)}</leaseDuration>'
        # Fast DDS refuses a period that is not shorter than the lease, but not for the
        # announcements at the start.  These last longer than the search.
        f'<leaseAnnouncement>{_seconds(SEARCH_LEASE_TIME / 2.0)}</leaseAnnouncement>'
        '<initialAnnouncements><count>100</count>'
        f'<period>{_seconds(SEARCH_JOIN_PERIOD)}</period></initialAnnouncements>',
        Path(os.environ[name]).read_text())
    with tempfile.NamedTemporaryFile('w', suffix='.xml') as file:
        file.write(profile)
        file.flush()
        os.environ[name] = file.name
        yield


def start_on_this_machine(own: object) -> None:
    """
    Limit ROS to this machine for a simulated robot, and initialise it if need be.

    A program that drives the real robot of the same name would end its drive if it discovered the
    simulated one.

    :param own: the node that is being created and calls this function
    :raises UsageError: if ROS is initialised without a limit that can still be set
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
    leave_discovery_server()
    use_localhost_only()
    if not rclpy.ok():
        rclpy.init()


def is_range_chosen() -> bool:
    """Return whether the user or this program has already set how far DDS discovery reaches."""
    is_range_read = RANGE in os.environ and not _is_humble()
    return is_range_read or LOCALHOST_ONLY in os.environ or is_localhost_only()


def can_still_be_localhost_only() -> bool:
    """
    Return whether a program that has called ``rclpy.init`` can still limit DDS to this machine.

    Only an XML profile can, which Fast DDS reads with the first node: not with Humble or another
    middleware, nor with variables that choose a transport or ROS_STATIC_PEERS.
    """
    is_profile_read = _fast_dds() not in (None, HUMBLE)
    return is_profile_read and not _is_transport_chosen() and not os.environ.get(PEERS)


def is_localhost_only() -> bool:
    """
    Return whether discovery is limited to this machine, by variables of ROS or a profile.

    With ROS_STATIC_PEERS the variables are no limit.
    """
    is_range_localhost = _is_localhost_requested() and not _is_humble()
    if is_range_localhost or os.environ.get(LOCALHOST_ONLY) == '1':
        return not os.environ.get(PEERS)
    return str(LOOPBACK) in (os.environ.get(name) for name in PROFILES.values())


def _use_profile(profile: Path) -> bool:
    """Make Fast DDS read an XML profile; return False if it cannot, as that of Humble."""
    version = _fast_dds()
    if version in (None, HUMBLE) or not profile.is_file():
        return False
    os.environ[PROFILES[version[0]]] = str(profile)
    return True


def _seconds(duration: float) -> str:
    """Return a duration [s] of less than a second, as Fast DDS profiles write it."""
    return f'<sec>0</sec><nanosec>{round(duration * 1e9)}</nanosec>'


def _is_localhost_requested() -> bool:
    """Return whether the environment variable ROS_AUTOMATIC_DISCOVERY_RANGE is ``LOCALHOST``."""
    return os.environ.get(RANGE) == 'LOCALHOST'


def _is_humble() -> bool:
    """Return whether this is ROS Humble, which does not read ROS_AUTOMATIC_DISCOVERY_RANGE."""
    return _fast_dds() == HUMBLE or os.environ.get('ROS_DISTRO') == 'humble'


def _is_transport_chosen() -> bool:
    return any(name in os.environ for name in (TRANSPORTS, *PROFILES.values()))


def _fast_dds() -> tuple[int, int] | None:
    """
    Return the major and minor version of Fast DDS in this process.

    :returns: None if the middleware is another one, or the version is unknown
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
