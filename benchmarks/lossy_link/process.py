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
"""Processes at one end of the network, whose DDS uses the network and not shared memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import sys
from typing import Any

from benchmarks import ROOT
from benchmarks.lossy_link.network import Network
from kachaka_simple_control.ros.dds_transport import CHOICES
from program import environment, JsonProcess

#: The longest response time of a process [s]; with packet loss, a service may need many tries.
RESPONSE_TIMEOUT = 60.0
#: The environment that makes DDS use the network instead of the shared memory of both ends.
SETTINGS = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}


class NetworkProcess(JsonProcess):
    """
    A Python program at one end of the network, which responds to JSON arrays.

    :param network: the network
    :param end: the end of the network
    :param arguments: the arguments of Python, for example ``-m MODULE``
    :param on_value: called in a thread with each value; None to keep the values for ``ask``
    """

    def __init__(
            self, network: Network, end: str, arguments: Sequence[str],
            on_value: Callable[[Any], None] | None = None) -> None:
        super().__init__(
            network.command(end, [sys.executable, *arguments]), on_value, cwd=ROOT,
            env=network_environment())

    def ask(self, *words: object) -> Any:
        """Send the program words as one JSON array; return the program's response."""
        self.write(words)
        return self.read(RESPONSE_TIMEOUT)


def network_environment() -> dict[str, str]:
    """Return the environment of this process, changed so that DDS uses the network."""
    kept = {name: value for name, value in environment().items() if name not in CHOICES}
    return {**kept, **SETTINGS}
