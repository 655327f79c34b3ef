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
"""How many examples a property test tries."""

from __future__ import annotations

import os

#: What ``make test`` runs is quick, what ``make colcon`` runs once more tries few examples, and
#: ``make test-all`` is thorough: each with its number of examples by that of ``make test``.
SCALES = {'few': 0.2, 'quick': 1.0, 'thorough': 5.0}
PROFILE = os.environ.get('HYPOTHESIS_PROFILE', 'quick')


def examples(count: int) -> int:
    """Return how many examples to try where ``make test`` tries ``count``."""
    return max(1, round(SCALES[PROFILE] * count))
