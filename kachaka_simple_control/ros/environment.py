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
Check the environment variables of ROS and the network, before ROS is started.

This module needs no ROS: the middleware must be checked before ``rclpy`` is imported.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
import re
import socket
import sys

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.text import escaped, quoted

#: The highest ROS domain for which DDS has ports.
MAX_DOMAIN = 232
#: The values of environment variables that ROS accepts.  ROS misunderstands other values, or
#: refuses them with an error message of dozens of lines.
VARIABLES = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': ('SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT'),
    **dict.fromkeys(('RCUTILS_COLORIZED_OUTPUT', 'RCUTILS_LOGGING_USE_STDOUT',
                     'RCUTILS_LOGGING_BUFFERED_STREAM'), ('0', '1')),
}
DISCOVERY_SERVER = 'ROS_DISCOVERY_SERVER'
#: Whether a client of a discovery server gets all that the server knows.  Humble's Fast DDS does
#: not read it.
SUPER_CLIENT = 'ROS_SUPER_CLIENT'
#: The variables that name a file of Fast DDS profiles, which can have the same effect.
PROFILES_FILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
#: A server by UDP, as Fast DDS reads it: an address or a name, and perhaps a port.
_SERVER = re.compile(r'(?:UDPv[46]:)?(?:\[(?P<v6>[^]]+)\]|(?P<v4>[^:;\[\]]+))(?::(?P<port>\d+))?')
SERVER_PORT = 11811
#: How long the answer of this machine's kernel may take, that nobody has a port [s].
REFUSAL_TIME = 0.05
#: The middleware that every ROS here has.
DEFAULT_MIDDLEWARE = 'rmw_fastrtps_cpp'


def require_middleware() -> None:
    """
    Check that the middleware which RMW_IMPLEMENTATION names can be loaded.

    The import of ``rclpy`` would end the process.

    :raises UsageError: if it is not installed
    """
    name = os.environ.get('RMW_IMPLEMENTATION', '')
    if name in ('', DEFAULT_MIDDLEWARE):
        return
    import subprocess  # not needed otherwise, and slow to import
    tried = subprocess.run(
        [sys.executable, '-c', 'import rclpy; rclpy.get_rmw_implementation_identifier()'],
        capture_output=True, text=True, check=False, errors='replace')
    if tried.returncode and 'exiting with' in tried.stderr:
        raise UsageError(
            f'RMW_IMPLEMENTATION is {quoted(name, 60)}, which is not installed here: install it, '
            'or unset the variable')


def check_environment() -> None:
    """
    Check the environment variables that ROS reads, and that there is a network.

    :raises UsageError: if a variable has no valid value, or nothing can work with its value
    """
    domain = os.environ.get('ROS_DOMAIN_ID', '')
    if domain and not (re.fullmatch('[0-9]{1,9}', domain) and int(domain) <= MAX_DOMAIN):
        raise UsageError(
            f'ROS_DOMAIN_ID is {quoted(domain, 60)}; it must be a whole number from 0 to '
            f'{MAX_DOMAIN}')
    for name, values in VARIABLES.items():
        value = os.environ.get(name, '')
        if value and value not in values:
            raise UsageError(
                f'{name} is {quoted(value, 60)}; it must be one of {", ".join(values)}')
    is_humble = os.environ.get('ROS_DISTRO') == 'humble'  # which does not read the range
    if os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'OFF' and not is_humble:
        raise UsageError(
            'ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: then no program finds another, and no robot is '
            'found; unset it, or set it to SUBNET or LOCALHOST')
    _check_network()
    _check_discovery_server()
    _check_security()


def use_log_folder() -> str | None:
    """
    Let ROS log to a new temporary folder if it cannot log where it would.

    :returns: a text for the user about it; None if ROS can log where it would
    """
    variable = next((name for name in ('ROS_LOG_DIR', 'ROS_HOME') if os.environ.get(name)), 'HOME')
    value = os.environ.get(variable, '')
    # As rcl_logging does it.
    folder = Path(value).expanduser().joinpath(
        *{'ROS_LOG_DIR': (), 'ROS_HOME': ('log',), 'HOME': ('.ros', 'log')}[variable])
    with contextlib.suppress(OSError):
        if value:
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return None
    import tempfile
    os.environ['ROS_LOG_DIR'] = tempfile.mkdtemp(prefix='kachaka_simple_control-log-')
    why = f'{escaped(folder, 100)} cannot be written' if value else 'HOME is not set'
    return (f'{why}: ROS logs to {os.environ["ROS_LOG_DIR"]}; set ROS_LOG_DIR to choose a folder '
            'for its logs')


def _check_network() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(('127.0.0.1', 9))  # sends nothing
        except OSError as error:
            raise UsageError(
                f'this machine has no network ({error.strerror}), not even within itself: in a '
                'container or a network namespace, `ip link set lo up` brings the loopback '
                'interface up') from None


def _check_discovery_server() -> None:
    text = os.environ.get(DISCOVERY_SERVER, '')
    servers = [server for server in map(str.strip, text.split(';')) if server]
    if servers and all(map(_is_refused, servers)):
        raise UsageError(
            f'{DISCOVERY_SERVER} is {quoted(text, 100)}, and no discovery server is there: '
            'without it nothing is found; start it with `make discovery-server` or `fastdds '
            'discovery`, or unset the variable')
    if servers:
        _become_super_client()


def leave_discovery_server() -> str | None:
    """
    Use no discovery server in this process and its children: their robot is on this machine.

    :returns: a text for the user about it; None if there was none
    """
    server = os.environ.pop(DISCOVERY_SERVER, '')
    os.environ.pop(SUPER_CLIENT, None)
    if not server:
        return None
    return f'{DISCOVERY_SERVER} is left out: what drives and what is driven are on this machine'


def _become_super_client() -> None:
    """
    Let this process see all publishers that the discovery server knows.

    An ordinary client is told of those alone that match its own subscriptions, and could not see
    another program that sends velocities to its robot.

    :raises UsageError: if it cannot
    """
    if any('SUPER_CLIENT' in Path(name).read_text(errors='replace') for name in map(
            os.environ.get, PROFILES_FILES) if name and Path(name).is_file()):
        return
    if os.environ.get('ROS_DISTRO') == 'humble':
        raise UsageError(
            f'{DISCOVERY_SERVER} is set, and a client of Humble does not see who else drives a '
            'robot: name a profile of a SUPER_CLIENT in FASTRTPS_DEFAULT_PROFILES_FILE '
            '(docs/fleet.md has one), or unset the variable')
    os.environ[SUPER_CLIENT] = value = os.environ.get(SUPER_CLIENT) or 'TRUE'
    if value.upper() not in ('TRUE', '1'):
        raise UsageError(
            f'{SUPER_CLIENT} is {quoted(value, 60)}, and an ordinary client of a discovery server '
            'does not see who else drives a robot: set it to TRUE, or unset it')


def _is_refused(server: str) -> bool:
    """Return whether the kernel of the server's machine says that nobody has its port."""
    found = _SERVER.fullmatch(server)
    if found is None:
        return False  # by TCP, for example
    try:
        (family, *_, address), *_ = socket.getaddrinfo(
            found['v6'] or found['v4'], int(found['port'] or SERVER_PORT), type=socket.SOCK_DGRAM)
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect(address)
            probe.settimeout(REFUSAL_TIME)
            probe.send(b'\0')  # no message of DDS: a server ignores it
            probe.recv(1)
    except ConnectionRefusedError:
        return True
    except (OSError, OverflowError):
        pass
    return False


def _check_security() -> None:
    keystore = os.environ.get('ROS_SECURITY_KEYSTORE', '')
    is_enforced = (os.environ.get('ROS_SECURITY_ENABLE') == 'true'
                   and os.environ.get('ROS_SECURITY_STRATEGY') == 'Enforce')
    if is_enforced and not Path(keystore, 'enclaves').is_dir():
        raise UsageError(
            f'ROS_SECURITY_ENABLE is true, and ROS_SECURITY_KEYSTORE is {quoted(keystore, 60)}: '
            'name the keystore that `ros2 security create_keystore` has made, or unset '
            'ROS_SECURITY_ENABLE')
