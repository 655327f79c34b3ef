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
"""Describe the machine and the software versions of a run, and keep the machine busy."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from importlib import metadata
import os
from pathlib import Path
import platform
import subprocess
import sys

from kachaka_simple_control.process.version import ros_distro

#: The packages whose versions are described.
PACKAGES = ('rclpy', 'ros-rmw-fastrtps-cpp', 'ros-fastrtps', 'geometry_msgs')
#: The program of a busy process, which ends by itself, also if its parent was killed.
WORK = """
import sys, time
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    pass
"""


def describe() -> dict[str, str]:
    """Return the description as table rows, without names of users, hosts or folders."""
    return {
        'processor': processor(),
        'cores': str(len(os.sched_getaffinity(0))),
        'kernel': f'{platform.system()} {platform.release()}',
        'Python': platform.python_version(),
        'ROS 2': ros_distro(),
        'packages': ', '.join(filter(None, map(version, PACKAGES))),
        'load before the run': f'{os.getloadavg()[0]:.2f}'}


def processor() -> str:
    """Return the model of the processor, or the architecture if Linux does not give it."""
    lines = Path('/proc/cpuinfo').read_text().splitlines()
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.machine()


def version(package: str) -> str:
    """Return the name and the version of a package; empty if it is not installed."""
    try:
        return f'{package} {metadata.version(package)}'
    except metadata.PackageNotFoundError:
        return ''


@contextlib.contextmanager
def busy(count: int, max_duration: float = 600.0) -> Iterator[None]:
    """Run busy processes during the ``with`` block, for a longest duration [s]."""
    processes = [
        subprocess.Popen([sys.executable, '-c', WORK, str(max_duration)]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
