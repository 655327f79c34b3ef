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
"""What the robot's error codes mean."""

from __future__ import annotations

import json

from kachaka_simple_control.robot.simulated import (
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOT_A_VELOCITY,
)

#: Code, kind and title, in our words.  The robot's own list is not published; codes below 0 are
#: ours, for what the robot would answer with a code that is not.
TITLES = (
    (ERROR_NO_MANUAL_CONTROL, 'Error', 'A velocity came while manual control is off'),
    (ERROR_NOT_A_VELOCITY, 'Error', 'A velocity is not a finite number'),
)


def as_json() -> str:
    """
    Return the list of errors as the robot gives it.

    :returns: JSON: objects with code, error_type, title, description, both in English, ref_url
    """
    return json.dumps([
        {'code': code, 'error_type': kind, 'title': title, 'description': '',
         'title_en': title, 'description_en': '', 'ref_url': ''}
        for code, kind, title in TITLES])
