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
"""Renew manual control, which a Kachaka grants for a time, while a run lasts.  No clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from kachaka_simple_control.control.timing import LEASE_RENEW_AT_REST, LEASE_RENEW_LATEST
from kachaka_simple_control.errors import RunFaultError


class PendingResponse(Protocol):
    """The response to a request for manual control; it may not have come yet."""

    @property
    def done(self) -> bool:
        """Whether it has come."""

    @property
    def refusal(self) -> str | None:
        """Why manual control was refused; None if it was granted."""


class LeaseRenewer:
    """
    Requests manual control again before it runs out, at rest if the plan rests in time.

    The robot serves the request between velocities.  A response that takes longer than its command
    timeout means that it has stopped in the middle of the motion.

    :param request: sends a request, without waiting
    :param response_timeout: how long a response may take in a run [s]
    """

    def __init__(
            self, request: Callable[[], PendingResponse], response_timeout: float) -> None:
        self._request = request
        self._response_timeout = response_timeout
        self._requested = float('-inf')
        self._pending: PendingResponse | None = None

    def granted(self, requested: float) -> None:
        """
        Record that manual control was granted.

        :param requested: when it was requested [s]; it lasts at least from then
        """
        self._requested = requested
        self._pending = None

    def is_stale(self, now: float) -> bool:
        """Return whether to renew manual control before a run begins."""
        return now - self._requested >= LEASE_RENEW_AT_REST

    def on_sent(self, now: float, rest: float) -> None:
        """
        Send a request if it is time to.

        :param now: the time [s]
        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """
        age = now - self._requested
        can_wait = rest >= self._response_timeout
        if age >= LEASE_RENEW_LATEST or (age >= LEASE_RENEW_AT_REST and can_wait):
            self._requested = now
            self._pending = self._request()

    def poll(self, now: float) -> None:
        """
        Check the pending response, if there is one.

        :param now: the time [s]
        :raises RunFaultError: if it took too long, or manual control was refused
        """
        if self._pending is None:
            return
        if not self._pending.done:
            if now - self._requested > self._response_timeout:
                raise RunFaultError(
                    'manual control was not renewed within '
                    f'{self._response_timeout * 1e3:.0f} ms; the robot may have stopped '
                    'meanwhile, so the motion was given up')
            return
        refusal, self._pending = self._pending.refusal, None
        if refusal is not None:
            raise RunFaultError(f'the robot took manual control away: {refusal}')
