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
"""A network of two namespaces leaves nothing behind, and says what it needs."""

import contextlib
import os
from pathlib import Path
import sys

from benchmarks.stop_matrix import network
from program import Program, ROOT
import pytest
from waiting import wait_until


def skip_where_impossible():
    """Skip the test, with the reason, where no network can be made."""
    if (reason := network.unavailable_reason()) is not None:
        pytest.skip(reason)


def namespaces(pid):
    """Return the namespaces that a process has made."""
    return sorted(network.NAMESPACES.glob(f'{network.PREFIX}-{pid}-*'))


def test_a_network_is_removed_after_its_block():
    skip_where_impossible()
    ours = Path('/proc/thread-self/ns/net').readlink()
    with contextlib.suppress(KeyError), network.Network() as made, network.Network():
        made.set_loss(30)
        with made.entered(network.NODE):
            assert Path('/proc/thread-self/ns/net').readlink() != ours
        assert Path('/proc/thread-self/ns/net').readlink() == ours
        assert len(namespaces(os.getpid())) == 4
        raise KeyError
    assert namespaces(os.getpid()) == []


def test_leftovers_of_a_killed_run_are_removed_by_the_next():
    skip_where_impossible()
    text = ('import time\nfrom benchmarks.stop_matrix.network import Network\n'
            'Network().__enter__()\ntime.sleep(60)\n')
    with Program([sys.executable, '-c', text], cwd=ROOT) as run:
        pid = run.process.pid
        wait_until(lambda: len(namespaces(pid)) == 2 and run, 20.0)
        network.remove_leftovers()
        assert len(namespaces(pid)) == 2  # the process that made them runs
    network.remove_leftovers()
    assert namespaces(pid) == []


def test_a_missing_command_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(network, '_path', lambda: '/nowhere')
    assert network.unavailable_reason() == (
        'the command ip is missing: install the package iproute2')
