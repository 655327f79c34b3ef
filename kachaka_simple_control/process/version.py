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
Look up the version of this package and the distribution of ROS.

This is a separate module, because the import of ``importlib.metadata`` is slow.

Tested by test/commands/test_cli.py.
"""

from __future__ import annotations

from importlib import metadata
import os

#: The supported distributions of ROS 2.
DISTROS = ('humble', 'jazzy', 'kilted')


def installed_version() -> str:
    """Return the installed version of this package, such as ``0.1.0``, or ``unknown``."""
    return _version('kachaka_simple_control') or 'unknown'


def ros_distro() -> str:
    """
    Return the name of the ROS distribution in use, such as ``jazzy``, or ``unknown``.

    This is the sourced distribution.  If none is sourced, it is the one installed from PyPI.
    """
    from_pypi = (distro for distro in DISTROS if _version(f'ros-{distro}-rclpy'))
    return os.environ.get('ROS_DISTRO') or next(from_pypi, 'unknown')


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
