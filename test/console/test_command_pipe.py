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
"""Each line arrives whole and once, or is refused, whatever its length and the reader."""

from __future__ import annotations

import asyncio
import os

from kachaka_simple_control.console.command_pipe import CAPACITY, CommandPipe


def test_lines_arrive_whole_and_in_order_or_not_at_all():
    async def scenario() -> None:
        pipe, (reading, writing) = CommandPipe(), os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        assert not pipe.write(b'closed\n')
        pipe.open(writing)
        taken, received, refused, cut = bytearray(), bytearray(), 0, 0

        async def read(size: int) -> None:
            received.extend(os.read(reading, size))
            await asyncio.sleep(0.0)  # the rest of a line that was cut follows

        for number in range(300):
            line = b'%d ' % number * (number * 997 % 11_000) + b'\n'
            is_taken = pipe.write(line)
            taken += line if is_taken else b''
            refused += not is_taken
            assert pipe.unread == len(taken) - len(received)
            cut += pipe.unread > CAPACITY
            if number % 5 == 4:
                await read(60_000)
        while pipe.unread:
            await read(CAPACITY)
        assert received == taken
        assert min(refused, cut) > 10
        pipe.close()
        assert not pipe.write(b'closed\n')
        assert not pipe.unread
        os.close(reading)

    asyncio.run(scenario())
