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
"""Convert diagnoses to a ROS 2 message.  Tested by test/ros/test_debug_topics.py."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time
    from diagnostic_msgs.msg import DiagnosticArray
    from kachaka_simple_control.control.diagnosis import Diagnosis


def diagnostics(
        diagnoses: Mapping[tuple[str, str], Diagnosis], stamp: Time) -> DiagnosticArray:
    """
    Return a DiagnosticArray message with one status for each diagnosis.

    :param diagnoses: by the name of the status, and the hardware ID
    """
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        DiagnosticStatus(
            # rclpy represents the message type byte as bytes.
            level=bytes([diagnosis.level]), name=name, message=diagnosis.message,
            hardware_id=hardware,
            values=[KeyValue(key=key, value=value) for key, value in diagnosis.values.items()])
        for (name, hardware), diagnosis in diagnoses.items()]
    return message
