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
"""Load the processors for a time."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import subprocess
import sys

#: The program of a busy process, which ends by itself, also if its parent was killed.
WORK = """
import sys, time
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    pass
"""


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
