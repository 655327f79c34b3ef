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
"""Read from ``/proc`` what processes use: CPU time, memory, threads, ports and traffic."""

from __future__ import annotations

from pathlib import Path
import time
from typing import NamedTuple

#: The ports of DDS: those of a domain begin at the first plus the gain times its number, and the
#: participants of one machine have two each, the first of them even (RTPS 2.2, 9.6.1.1).
FIRST_PORT, DOMAIN_GAIN, PARTICIPANT_OFFSET = 7400, 250, 10


class Traffic(NamedTuple):
    """What was sent, in packets and bytes."""

    packets: int
    size: int

    def since(self, before: Traffic) -> Traffic:
        """Return what was sent since an earlier reading."""
        return Traffic(self.packets - before.packets, self.size - before.size)


def process_time(pid: int) -> float:
    """Return the CPU time of another process [s]; 0 if it has ended."""
    try:
        # The id of a process's CPU clock on Linux; see clock_getcpuclockid(3).
        return time.clock_gettime((~pid << 3) | 2)
    except OSError:
        return 0.0


def peak_memory(pid: int) -> float:
    """Return the peak resident set of a process [MB]; 0 if it has ended."""
    try:
        status = Path(f'/proc/{pid}/status').read_text()
    except OSError:
        return 0.0
    lines = [line for line in status.splitlines() if line.startswith('VmHWM')]
    return int(lines[0].split()[1]) / 1000 if lines else 0.0


def thread_count(pid: int) -> int:
    """Return how many threads a process has; 0 if it has ended."""
    return len([*Path(f'/proc/{pid}/task').glob('*')])


def participants(udp: str, domain: int) -> int:
    """
    Return how many DDS participants this machine has in a ROS domain.

    :param udp: the text of ``/proc/net/udp``
    """
    ports = {int(line.split()[1].rpartition(':')[2], 16) for line in udp.splitlines()[1:]}
    first = FIRST_PORT + DOMAIN_GAIN * domain + PARTICIPANT_OFFSET
    last = FIRST_PORT + DOMAIN_GAIN * (domain + 1)
    return sum(first <= port < last and not (port - first) % 2 for port in ports)


def traffic(devices: str) -> Traffic:
    """
    Return what was sent by all interfaces since they exist; by loopback, what programs here got.

    :param devices: the text of ``/proc/net/dev``
    """
    rows = [line.partition(':')[2].split() for line in devices.splitlines()[2:]]
    return Traffic(sum(int(row[9]) for row in rows), sum(int(row[8]) for row in rows))


def participants_at(pid: int, domain: int) -> int:
    """Return how many DDS participants a ROS domain has where a process has its network."""
    return participants(Path(f'/proc/{pid}/net/udp').read_text(), domain)


def traffic_at(pid: int) -> Traffic:
    """Return what was sent by all interfaces where a process has its network."""
    return traffic(Path(f'/proc/{pid}/net/dev').read_text())
