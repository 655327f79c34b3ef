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
"""Cut a link on the loopback interface with nftables, which drops its packets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import shutil
import subprocess
import time

TABLE = 'inet kachaka_console_matrix'


def missing() -> str:
    """Return what is needed to cut a link; empty if all is there."""
    if shutil.which('nft') is None:
        return 'needs nft: make browser'
    if os.geteuid() != 0:
        return 'needs root for nftables'
    result = subprocess.run(
        ['nft', 'list', 'tables'], capture_output=True, text=True, check=False)
    return result.stderr.strip()


@contextmanager
def cut(address: str, port: int) -> Iterator[float]:
    """
    Drop all packets to and from an address and a port during a ``with`` block.

    :param address: an IPv4 address of this machine
    :param port: a TCP port
    :returns: when it began [s, system clock]
    """
    rules = f"""
        table {TABLE} {{
            chain output {{
                type filter hook output priority 0;
                ip daddr {address} tcp dport {port} drop
                ip saddr {address} tcp sport {port} drop
            }}
        }}"""
    subprocess.run(['nft', '-f', '-'], input=rules, text=True, check=True)
    try:
        yield time.time()
    finally:
        subprocess.run(['nft', 'delete', 'table', *TABLE.split()], check=True)
