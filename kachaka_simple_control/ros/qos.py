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
"""Quality of service: that of our services, and why a subscriber cannot hear a publisher."""

from __future__ import annotations

from rclpy.qos import qos_check_compatible, QoSCompatibility, QoSProfile

#: By default a service keeps ten requests, and forgets the eleventh that comes while it serves
#: one: nobody would ever answer it.
SERVICE_QOS = QoSProfile(depth=1000)
#: Policies that must fit: the words for a person, and the name in ``QoSProfile``.
_POLICIES = ('reliability', 'durability', 'deadline', 'liveliness', 'liveliness_lease_duration')


def incompatibility(offered: QoSProfile, requested: QoSProfile) -> str:
    """
    Tell what keeps a subscriber from hearing a publisher.

    :param offered: the quality of service of the publisher
    :param requested: that of the subscriber
    :returns: the policies that do not fit, with both values; empty if it can hear
    """
    if _fits(offered, requested):
        return ''
    # One policy at a time, all others as the publisher offers them: it is at fault alone.
    return ', '.join(
        f'{policy} (it asks for {_value(requested, policy)}, and {_value(offered, policy)} is '
        'offered)'
        for policy in _POLICIES if not _fits(offered, _with(offered, requested, policy)))


def _fits(offered: QoSProfile, requested: QoSProfile) -> bool:
    return bool(qos_check_compatible(offered, requested)[0] != QoSCompatibility.ERROR)


def _with(offered: QoSProfile, requested: QoSProfile, policy: str) -> QoSProfile:
    profile = QoSProfile(depth=1, **{name: getattr(offered, name) for name in _POLICIES})
    setattr(profile, policy, getattr(requested, policy))
    return profile


def _value(profile: QoSProfile, policy: str) -> str:
    value = getattr(profile, policy)
    if hasattr(value, 'nanoseconds'):
        # What is not set is endless.
        seconds = value.nanoseconds / 1e9
        return f'{seconds:g} s' if 0.0 < seconds < 1e9 else 'none'
    return str(value.name).lower()
