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
"""A virtual screen with a window manager, where a window really loses the focus to another."""

from __future__ import annotations

import os
import shutil
import subprocess

PROGRAMS = ('Xvfb', 'openbox')
SIZE = '1280x900x24'
IS_HERE = all(map(shutil.which, PROGRAMS))
MISSING = f'needs {" and ".join(PROGRAMS)}: make browser'


class Screen:
    """
    A virtual X11 screen with a window manager.

    :ivar display: its name, for the environment variable DISPLAY
    """

    def __init__(self) -> None:
        reading, writing = os.pipe()
        self._server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(writing), '-screen', '0', SIZE, '-nolisten', 'tcp'],
            pass_fds=[writing], stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as stream:
            self.display = f':{stream.readline().strip()}'
        self._manager = subprocess.Popen(
            ['openbox'], env={**os.environ, 'DISPLAY': self.display}, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)

    def close(self) -> None:
        """End the window manager and the screen."""
        for process in (self._manager, self._server):
            process.terminate()
            process.wait()
