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
"""Flood the WebSocket of a console, as a process; its argument is the port."""

from __future__ import annotations

import contextlib
import json
import socket
import sys
import time

from benchmarks.console_matrix.frames import frame
from benchmarks.console_matrix.raw_client import RawClient, RefusedError

#: A process that is forgotten ends by itself [s].
MAX_DURATION = 120.0
#: What the console has to read and to drop: short and long, valid and invalid messages.
MESSAGES = (
    {'type': 'hand', 'sequence': 1, 'stamp': 1.0, 'linear_x': 0.3, 'angular_z': 0.0},
    {'type': 'list', 'id': 1}, {'type': 'nonsense'},
    {'type': 'preview', 'id': 2, 'text': 'steps:\n' + '- forward: 0.1 m\n' * 100},
    {'type': 'preview', 'id': 3, 'text': '#' * 60_000})
BURST = b''.join(frame(json.dumps({'v': 1, **message}).encode())
                 for message in (*MESSAGES[:4] * 10, MESSAGES[4]))


def main(port: int) -> None:
    """Send without a pause, on a new connection whenever one is closed."""
    end, is_first = time.monotonic() + MAX_DURATION, True
    while time.monotonic() < end:
        with contextlib.suppress(OSError, RefusedError):
            client = RawClient(port)
            client.send('hello')
            if is_first:
                print('flooding', flush=True)
                is_first = False
            while time.monotonic() < end:
                client.send_bytes(BURST)


if __name__ == '__main__':
    with contextlib.suppress(KeyboardInterrupt, socket.timeout):
        main(int(sys.argv[1]))
