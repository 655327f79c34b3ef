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
"""Two network namespaces and the cable between them; made here, and removed whatever happens."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import json
import os
from pathlib import Path
import shutil
import subprocess
from types import TracebackType

#: All namespaces are called this, the number of the process that made them, and their end.
PREFIX = 'kachaka_lossy'
NODE, ROBOT = 'node', 'robot'
#: Addresses that are set aside for measuring networks (RFC 2544); nobody outside sees them.
ADDRESSES = {NODE: '198.18.0.1', ROBOT: '198.18.0.2'}
INTERFACE = 'cable'
#: The commands that are needed, and the packages they are in.
TOOLS = {'ip': 'iproute2', 'nft': 'nftables'}
NAMESPACES = Path('/run/netns')

#: Only what came through the cable is in the lottery: a multicast also comes back to its sender.
RULES = """
table ip loss {{
    chain arriving {{
        type filter hook input priority 0; policy accept;
        ip saddr {peer} jump lottery
    }}
    chain lottery {{
        {lottery}
        counter
    }}
}}
"""


class NetworkError(RuntimeError):
    """Such a network cannot be made, here or by this user; says why."""


class Network:
    """A node's end and a robot's end, joined by a cable; enter it to have it."""

    def __init__(self) -> None:
        """Name the ends; nothing is made yet."""
        self._names = {end: f'{PREFIX}-{os.getpid()}-{end}' for end in ADDRESSES}

    def __enter__(self) -> Network:
        """
        Make it, and remove what earlier runs that were killed have left.

        :raises NetworkError: if it cannot be made; nothing is left of it
        """
        remove_leftovers()
        try:
            self._make()
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(
            self, kind: type[BaseException] | None, error: BaseException | None,
            traceback: TracebackType | None) -> None:
        """Remove it."""
        self._remove()

    def command(self, end: str, command: Sequence[str]) -> list[str]:
        """
        Return what runs a command at one end.

        :param end: which one
        :param command: the command
        :returns: the command, which keeps the number of the process that is started
        """
        return [_tool('ip'), 'netns', 'exec', self._names[end], *command]

    def lose(self, percent: int) -> None:
        """
        Lose a part of the packets from now on, in both directions, each one by itself.

        :param percent: how many of a hundred
        """
        for end, peer in ((NODE, ROBOT), (ROBOT, NODE)):
            lottery = f'numgen random mod 100 < {percent} counter drop' if percent else ''
            self._nft(end, 'flush ruleset')
            self._nft(end, RULES.format(peer=ADDRESSES[peer], lottery=lottery))

    def counts(self) -> tuple[int, int]:
        """
        Count the packets since ``lose``, of both directions.

        :returns: how many were lost, and how many arrived
        """
        lost = arrived = 0
        for end in ADDRESSES:
            for rule in self._rules(end):
                packets = next((e['counter']['packets'] for e in rule if 'counter' in e), 0)
                if any('drop' in expression for expression in rule):
                    lost += packets
                else:
                    arrived += packets
        return lost, arrived

    def pull(self) -> None:
        """Pull the cable, at the robot's end: there the interface is down, here it is dead."""
        self._ip(ROBOT, 'link', 'set', INTERFACE, 'down')

    def plug(self) -> None:
        """Put the cable back."""
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
        # DDS finds its peers by multicast; an interface that went down has lost its routes.
        self._ip(end, 'route', 'replace', '224.0.0.0/4', 'dev', INTERFACE)

    def _remove(self) -> None:
        for name in self._names.values():
            if (NAMESPACES / name).exists():
                # What still runs there keeps the namespace, without a name, until it ends.
                _run('ip', 'netns', 'delete', name)

    def _ip(self, end: str, *arguments: str) -> None:
        _run('ip', '-n', self._names[end], *arguments)

    def _nft(self, end: str, text: str) -> None:
        _run(*self.command(end, [_tool('nft'), '-f', '-']), text=text)

    def _rules(self, end: str) -> list[list[dict[str, dict[str, int]]]]:
        printed = _run(*self.command(end, [_tool('nft'), '-j', 'list', 'ruleset']))
        return [entry['rule']['expr'] for entry in json.loads(printed)['nftables']
                if 'rule' in entry]


def why_not() -> str | None:
    """
    Return what keeps this machine from having such a network, after trying.

    :returns: the reason, and what to do; None if there is none
    """
    for tool, package in TOOLS.items():
        if shutil.which(tool, path=_path()) is None:
            return f'the command {tool} is missing: install the package {package}'
    if os.geteuid() != 0:
        return 'only root may make network namespaces'
    try:
        with Network() as network:
            network.lose(50)
    except NetworkError as error:
        return str(error)
    return None


def remove_leftovers() -> None:
    """Remove the namespaces of runs that were killed, and no others."""
    for file in sorted(NAMESPACES.glob(f'{PREFIX}-*-*')):
        pid = file.name.split('-')[1]
        if pid.isdigit() and not Path('/proc', pid).exists():
            with contextlib.suppress(NetworkError):  # another run may be doing the same
                _run('ip', 'netns', 'delete', file.name)


def _path() -> str:
    # Where these commands are is not on everybody's path.
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
        said = ' '.join(done.stderr.split()) or f'exit code {done.returncode}'
        raise NetworkError(f'{" ".join(command)}: {said}')
    return done.stdout
