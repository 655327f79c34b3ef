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
A map of a floor as a picture, as a Kachaka has one: its walls and posts, without people.

Tested by test/kachaka/simulator/test_grpc_laser.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
import math
import struct
import zlib

from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Point

#: The size of a pixel [m], and how much floor is shown around all that stands there and around
#: the start [m]; both chosen.
RESOLUTION = 0.05
BORDER = 1.0
#: The grey of walls and of free floor: the manufacturer's bridge tells them by these values
#: (mapping_component.cpp in pf-robotics/kachaka-api).
OCCUPIED, FREE = 174, 253


@dataclass(frozen=True)
class FloorMap:
    """
    A picture of a floor.

    :param png: the picture, with x to the right and y upwards
    :param corner: where its lower left corner is on the floor [m]
    :param width: of the picture [pixels], as ``height``
    """

    png: bytes
    corner: Point
    width: int
    height: int


@lru_cache(maxsize=1)
def floor_map(floor: Floor) -> FloorMap:
    """Return a map of a floor; of an empty one that of some free floor around the start."""
    points = [(0.0, 0.0), *(point for wall in floor.walls for point in wall)]
    for post in floor.posts:
        (x, y), radius = post.at, post.radius
        points += [(x - radius, y - radius), (x + radius, y + radius)]
    left, bottom = (
        RESOLUTION * math.floor((min(values) - BORDER) / RESOLUTION) for values in zip(*points))
    right, top = (max(values) + BORDER for values in zip(*points))
    width, height = (math.ceil(size / RESOLUTION) for size in (right - left, top - bottom))
    rows = [bytearray([FREE]) * width for _ in range(height)]
    for x, y in _occupied(floor):
        # The first row of a picture is its top.
        rows[height - 1 - int((y - bottom) / RESOLUTION)][int((x - left) / RESOLUTION)] = OCCUPIED
    return FloorMap(_png(width, height, rows), (left, bottom), width, height)


def _occupied(floor: Floor) -> Iterator[Point]:
    """Yield points of walls and posts, at least one for each pixel that they fill."""
    step = RESOLUTION / 2.0
    for start, end in floor.segments:
        count = math.ceil(math.dist(start, end) / step)
        for index in range(count + 1):
            part = index / count
            yield start[0] + (end[0] - start[0]) * part, start[1] + (end[1] - start[1]) * part
    for post in floor.posts:
        yield post.at
        size = math.ceil(post.radius / step)
        for column in range(-size, size + 1):
            for row in range(-size, size + 1):
                if math.hypot(column, row) * step <= post.radius:
                    yield post.at[0] + column * step, post.at[1] + row * step


def _png(width: int, height: int, rows: list[bytearray]) -> bytes:
    """Return a picture in 256 greys, in the format PNG (ISO/IEC 15948)."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack('>I', len(data)) + kind + data + struct.pack(
            '>I', zlib.crc32(kind + data))
    # 8 bits, grey, and no filter before each row: the byte 0.
    header = struct.pack('>IIBBBBB', width, height, 8, 0, 0, 0, 0)
    return b''.join((
        b'\x89PNG\r\n\x1a\n', chunk(b'IHDR', header),
        chunk(b'IDAT', zlib.compress(b''.join(b'\0' + row for row in rows))),
        chunk(b'IEND', b'')))
