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
"""Two network namespaces with a link, which are removed also after an error or a kill."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import ctypes
import itertools
import os
from pathlib import Path
import re
import shutil
import subprocess

from kachaka_simple_control.ros.dds_transport import CHOICES
from program import environment

_NUMBERS = itertools.count(1)
#: The prefix of a namespace's name; process id, end and number follow.
PREFIX = 'kachaka_link'
NODE, ROBOT = 'node', 'robot'
#: Addresses reserved for network benchmarks (RFC 2544).
ADDRESSES = {NODE: '198.18.0.1', ROBOT: '198.18.0.2'}
INTERFACE = 'veth0'
#: The required commands, and their packages.
TOOLS = {'ip': 'iproute2', 'nft': 'nftables'}
NAMESPACES = Path('/run/netns')
CLONE_NEWNET = 0x40000000
#: With these, DDS uses the network; without them, the shared memory of both ends, or loopback.
SETTINGS = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}

#: Only packets from the peer are dropped, because a multicast also returns to its sender.
RULES = """
table ip loss {{
    chain arriving {{
        type filter hook input priority 0; policy accept;
        ip saddr {peer} jump loss_rule
    }}
    chain loss_rule {{
        {loss_rule}
        counter
    }}
}}
"""
#: Drops all multicast; the server of discovery is found by its address.
NO_MULTICAST = """
table ip no_multicast {
    chain leaving {
        type filter hook output priority 0; policy accept;
        ip daddr 224.0.0.0/4 drop
    }
    chain arriving {
        type filter hook input priority 0; policy accept;
        ip daddr 224.0.0.0/4 drop
    }
}
"""


class NetworkError(RuntimeError):
    """The network cannot be made on this machine or by this user; the text gives the reason."""


class Network:
    """A context manager for a network with a node's end and a robot's end."""

    def __init__(self) -> None:
        number = next(_NUMBERS)
        self._names = {end: f'{PREFIX}-{os.getpid()}-{end}-{number}' for end in ADDRESSES}

    def __enter__(self) -> Network:
        """Make the network; a NetworkError leaves nothing of it."""
        remove_leftovers()
        try:
            self._make()
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Remove the network."""
        self._remove()

    def command(self, end: str, command: Sequence[str]) -> list[str]:
        """Return the command line that runs a command at one end of the network."""
        return [_tool('ip'), 'netns', 'exec', self._names[end], *command]

    @staticmethod
    def environment(**variables: str) -> dict[str, str]:
        """Return the environment of a program at an end, with more variables."""
        kept = {name: value for name, value in environment().items() if name not in CHOICES}
        return {**kept, **SETTINGS, **variables}

    @contextlib.contextmanager
    def entered(self, end: str) -> Iterator[None]:
        """Let the sockets and threads that this thread makes in a block belong to one end."""
        libc = ctypes.CDLL(None, use_errno=True)
        with Path('/proc/thread-self/ns/net').open('rb') as ours, (
                NAMESPACES / self._names[end]).open('rb') as there:
            if libc.setns(there.fileno(), CLONE_NEWNET):
                raise NetworkError(os.strerror(ctypes.get_errno()))
            try:
                yield
            finally:
                libc.setns(ours.fileno(), CLONE_NEWNET)

    def set_loss(self, percent: int) -> None:
        """Set the packet loss [%]: drop packets at random in both directions."""
        for end, peer in ((NODE, ROBOT), (ROBOT, NODE)):
            loss_rule = f'numgen random mod 100 < {percent} drop' if percent else ''
            self._nft(end, 'flush ruleset')
            self._nft(end, RULES.format(peer=ADDRESSES[peer], loss_rule=loss_rule))

    def block_multicast(self) -> None:
        """Let no multicast leave either end, nor arrive there."""
        for end in ADDRESSES:
            self._nft(end, NO_MULTICAST)

    def arrived(self) -> int:
        """Return the number of packets that arrived at either end since ``set_loss``."""
        return sum(int(count) for end in ADDRESSES for count in re.findall(
            r'counter packets (\d+)',
            _run(*self.command(end, [_tool('nft'), 'list', 'ruleset']))))

    def disconnect(self) -> None:
        """Disconnect the ends: set the robot's interface down, so the node's loses its carrier."""
        self._ip(ROBOT, 'link', 'set', INTERFACE, 'down')

    def connect(self) -> None:
        """Reconnect the ends."""
        self._up(ROBOT)

    def _make(self) -> None:
        for name in self._names.values():
            _run('ip', 'netns', 'add', name)
        self._ip(NODE, 'link', 'add', INTERFACE, 'type', 'veth',
                 'peer', 'name', INTERFACE, 'netns', self._names[ROBOT])
        for end, address in ADDRESSES.items():
            self._ip(end, 'link', 'set', 'lo', 'up')
            self._ip(end, 'address', 'add', f'{address}/24', 'dev', INTERFACE)
            self._up(end)

    def _up(self, end: str) -> None:
        self._ip(end, 'link', 'set', INTERFACE, 'up')
        # DDS finds its peers by multicast; an interface that was down has lost its routes.
        self._ip(end, 'route', 'replace', '224.0.0.0/4', 'dev', INTERFACE)

    def _remove(self) -> None:
        for name in self._names.values():
            if (NAMESPACES / name).exists():
                # A process that still runs there keeps the unnamed namespace until it ends.
                _run('ip', 'netns', 'delete', name)

    def _ip(self, end: str, *arguments: str) -> None:
        _run('ip', '-n', self._names[end], *arguments)

    def _nft(self, end: str, text: str) -> None:
        _run(*self.command(end, [_tool('nft'), '-f', '-']), text=text)


def unavailable_reason() -> str | None:
    """Try to make a network; return the reason of a failure and the remedy, or None."""
    for tool, package in TOOLS.items():
        if shutil.which(tool, path=_path()) is None:
            return f'the command {tool} is missing: install the package {package}'
    if os.geteuid() != 0:
        return 'only root may make network namespaces'
    try:
        with Network() as network:
            network.set_loss(50)
    except NetworkError as error:
        return str(error)
    return None


def remove_leftovers() -> None:
    """Remove the namespaces of runs that were killed."""
    for file in sorted(NAMESPACES.glob(f'{PREFIX}-*-*')):
        pid = file.name.split('-')[1]
        if pid.isdigit() and not Path('/proc', pid).exists():
            with contextlib.suppress(NetworkError):  # another run may remove the same
                _run('ip', 'netns', 'delete', file.name)


def _path() -> str:
    # These folders may be missing in a user's PATH.
    return os.pathsep.join([os.environ.get('PATH', os.defpath), '/usr/sbin', '/sbin'])


def _tool(name: str) -> str:
    return shutil.which(name, path=_path()) or name


def _run(tool: str, *arguments: str, text: str = '') -> str:
    command = [_tool(tool), *arguments]
    try:
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NetworkError(f'{" ".join(command)}: {error}') from None
    if done.returncode != 0:
        reason = ' '.join(done.stderr.split()) or f'exit code {done.returncode}'
        raise NetworkError(f'{" ".join(command)}: {reason}')
    return done.stdout
