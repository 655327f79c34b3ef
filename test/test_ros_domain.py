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
"""Sessions of tests on one machine have ROS domains of their own."""

from __future__ import annotations

import subprocess
import sys

import pytest
import ros_domain

CLAIM = 'import ros_domain; print(ros_domain.claim_domain(), flush=True); input()'


def test_a_claimed_domain_is_free_again_at_the_end_of_its_process(monkeypatch):
    with subprocess.Popen(
            [sys.executable, '-c', CLAIM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={'PYTHONPATH': ':'.join(sys.path)}, text=True) as other:
        domain = int(other.stdout.readline())
        monkeypatch.setattr(ros_domain, 'DOMAINS', [domain])
        with pytest.raises(RuntimeError, match='are claimed'):
            ros_domain.claim_domain()
        other.communicate('\n')
    assert ros_domain.claim_domain() == domain


def test_more_domains_may_be_used_one_after_the_other_than_there_are(monkeypatch):
    domain = ros_domain.claim_domain()
    ros_domain.release_domain(domain)
    monkeypatch.setattr(ros_domain, 'DOMAINS', [domain])
    for _ in range(3):
        ros_domain.release_domain(ros_domain.claim_domain())
