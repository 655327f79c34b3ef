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
"""The number of examples of a property test whose examples take long."""

from __future__ import annotations

from hypothesis import settings

#: How many times more examples `make test-all` tries than `make test`.
THOROUGH = 5


def examples(count: int) -> int:
    """Return how many examples to try; a number of ``count`` in ``make test``."""
    return count if settings.default.derandomize else THOROUGH * count
