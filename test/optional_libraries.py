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
"""Libraries that only some tests need, which are skipped in their turn without them."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import functools
import importlib
from pathlib import Path
from unittest.mock import MagicMock

#: What a skipped test says that it needs, where the name of the module is not enough.
NEEDED = {
    'argcomplete.shell_integration': 'argcomplete 3',
    'ament_copyright.main': 'ament_copyright, which comes with ROS',
    'ament_flake8.main': 'ament_flake8, which comes with ROS',
    'ament_pep257.main': 'ament_pep257, which comes with ROS',
    'grpc': 'the extra "kachaka"',
    'jinja2': 'Jinja2',
    'kachaka_api': 'the SDK of the robot',
    'kachaka_api.generated': 'the SDK of the robot',
    'mcap': 'what writes recordings',
    'rclpy': 'ROS 2',
    'yaml': 'PyYAML',
}
#: What stands for a name of a missing library where a module of tests is executed: it can be
#: called, and is an empty sequence.
MISSING = MagicMock(name='missing library')
#: Modules whose own absence is an error.
OURS = {'benchmarks', 'kachaka_simple_control',
        *(path.stem for path in Path(__file__).parent.glob('*.py'))}


@contextlib.contextmanager
def optional_imports() -> Iterator[None]:
    """Go on without the imports in this context where a library is not there."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition('.')[0] in OURS:
            raise


@functools.cache
def lack(name: str) -> str | None:
    """
    Return why tests that need a module are to be skipped.

    :returns: the reason; None if the module is there
    """
    try:
        importlib.import_module(name)
    except ImportError:
        return f'needs {NEEDED.get(name, name)}'
    return None
