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
Keep what is sent on this machine, in a ROS domain of its own.

To be called before anything loads rclpy: no robot and no other run may receive what is sent here.
It imports no ROS itself, so that tests and benchmarks can import it first.
"""

from __future__ import annotations

import os
import random
import socket

from kachaka_simple_control.ros.dds_transport import use_localhost_only

#: The ROS domains to choose from.  The ports of higher domains may overlap Linux's own ports.
DOMAINS = range(1, 101)
#: For each domain that this process has claimed, the socket that holds it.
_CLAIMS: dict[int, socket.socket] = {}


def claim_domain() -> int:
    """
    Return a ROS domain that no other process of this machine has claimed; this one keeps it.

    Two test sessions in one domain would find each other's robots.  A claim is a TCP port among
    those that DDS gives to the domain, where DDS itself uses UDP; it ends with the process.

    :raises RuntimeError: if all are claimed
    """
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        claim = socket.socket()
        try:
            # By the DDS specification a domain has 250 ports; this one is its last.
            claim.bind(('127.0.0.1', 7400 + 250 * domain + 249))
        except OSError:
            claim.close()
        else:
            _CLAIMS[domain] = claim
            return domain
    raise RuntimeError('all ROS domains from 1 to 100 are claimed by other tests')


def release_domain(domain: int) -> None:
    """End this process's claim on a ROS domain, which nothing uses any longer."""
    _CLAIMS.pop(domain).close()


def use_own_domain() -> None:
    """Claim a ROS domain for this process and its children, unless the environment names one."""
    if 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = str(claim_domain())


def isolate_ros() -> None:
    """Choose a ROS domain, and keep discovery on this machine, unless the user chose."""
    use_own_domain()
    use_localhost_only()
