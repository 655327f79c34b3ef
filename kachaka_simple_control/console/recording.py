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
"""Record the velocities that were really sent by hand as a motion of ``move`` steps."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from datetime import datetime
from functools import partial
from typing import Any

from kachaka_simple_control.console.folder import MAX_TEXT
from kachaka_simple_control.console.open_pages import OpenPages, Page
from kachaka_simple_control.console.page_protocol import Recorded
from kachaka_simple_control.console.page_work import in_thread
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.files.protocol import Log
from kachaka_simple_control.motion.steps import Motion, Move

#: How long a recording waits for the last segments after its end [s].
LAST_SEGMENTS = 0.3
#: The bytes of the text without the steps, at most.
_HEAD = 1000


class Recording:
    """
    A recording that grows by segments; a segment is a velocity that was held for a time.

    :ivar is_full: whether a further segment would make the text too long; it then takes no more
    """

    def __init__(self) -> None:
        self.is_full = False
        self._steps: list[Move] = []
        self._size = _HEAD

    def add(self, segments: Iterable[tuple[float, float, float]]) -> None:
        """
        Append segments; one with the velocity of the segment before it is merged with that.

        :param segments: the linear velocity [m/s], the angular velocity [rad/s] and the duration
            [s] of each
        """
        for linear_x, angular_z, duration in segments:
            step = Move(linear_x, angular_z, duration)
            if self.is_full or not duration:
                continue
            if self._steps and self._steps[-1].velocity == step.velocity:
                held = self._steps[-1].duration + duration
                self._steps[-1] = Move(linear_x, angular_z, held)
                continue
            size = len(f'  - move: {{linear_x: {linear_x!r} m/s, angular_z: {angular_z!r} rad/s, '
                       f'duration: {duration!r} s}}') + 10
            if self._size + size > MAX_TEXT:
                self.is_full = True
                continue
            self._size += size
            self._steps.append(step)

    def motion(self, name: str, description: str = '') -> Motion | None:
        """Return the recorded motion, without rests at both ends; None if nothing was driven."""
        moving = [index for index, step in enumerate(self._steps) if not step.velocity.is_zero]
        if not moving:
            return None
        return Motion(name, tuple(self._steps[moving[0]:moving[-1] + 1]), description)

    def text(self, name: str, description: str = '') -> str:
        """Return the text of a motion file; empty if nothing was driven."""
        motion = self.motion(name, description)
        return '' if motion is None else dump(motion)


class Recorder:
    """
    Begins and ends the recordings of a console, and sends each to the page that has driven.

    :param spawn: begins a task that ends with the console
    :param on_change: is called when ``is_on`` has changed
    """

    def __init__(
            self, pages: OpenPages, spawn: Callable[[Coroutine[Any, Any, None]], None],
            on_change: Callable[[], None]) -> None:
        self._pages, self._spawn, self._on_change = pages, spawn, on_change
        self._recording: Recording | None = None

    @property
    def is_on(self) -> bool:
        """Return whether the hand is recorded."""
        return self._recording is not None

    def switch(self, page: Page, is_on: bool) -> tuple[bool, str]:
        """Begin or end a recording for a page; return whether that is done, and a text."""
        if is_on:
            self._recording = Recording()
        elif self._recording is None:
            return False, 'nothing is recorded'
        else:
            self.finish(page)
        self._on_change()
        return True, 'recording' if is_on else 'recorded'

    def take(self, segments: Iterable[tuple[float, float, float]], driver: Page | None) -> None:
        """Record segments if a recording is on; when it is full, the page that drives gets it."""
        if self._recording is None:
            return
        try:
            self._recording.add(segments)
        except InvalidMotionError as error:
            self._pages.log(Log('error', f'a segment cannot be recorded: {error}'))
        if self._recording.is_full and driver is not None:
            self._pages.log(Log(
                'warning', 'the recording has ended: a motion has no room for more'))
            self.finish(driver)

    def finish(self, page: Page) -> None:
        """End the recording, if one is on; a page gets its text a little later."""
        if self._recording is not None:
            self._spawn(self._finish(page, self._recording))

    async def _finish(self, page: Page, recording: Recording) -> None:
        # The last velocity is reported when the next one is sent.
        await asyncio.sleep(LAST_SEGMENTS)
        if self._recording is not recording:
            return
        self._recording = None
        self._on_change()
        now = datetime.now().astimezone()
        text = await in_thread(partial(
            recording.text, f'hand {now:%Y-%m-%d %H.%M.%S}',
            f'Driven by hand on {now:%Y-%m-%d} at {now:%H:%M:%S}.'))
        page.send(Recorded(text))
