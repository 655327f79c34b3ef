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
"""The robot of the tests that only listens."""

from functools import partial

from optional_libraries import MISSING, optional_imports
import pytest

takes_info = MISSING
with optional_imports():
    from listener import takes_info

pytestmark = pytest.mark.needs('rclpy', 'geometry_msgs', 'std_srvs')


class Callbacks:
    """Methods that are callbacks of subscriptions."""

    def one(self, message):
        """Take a message."""

    def two(self, message, info):
        """Take its info, too."""

    def either(self, message, info=None):
        """Take its info, too, if somebody gives it."""


@pytest.mark.parametrize('callback, expected', [
    ([].append, False),
    (lambda message: None, False),
    (lambda message, info: None, True),
    (Callbacks().one, False),
    (Callbacks().two, True),
    (Callbacks().either, False),
    (partial(Callbacks().two, info={}), False),
])
def test_only_a_callback_that_takes_two_arguments_is_given_the_info(callback, expected):
    """As rclpy decides it from Iron on; on Humble our own executor does."""
    assert takes_info(callback) is expected
