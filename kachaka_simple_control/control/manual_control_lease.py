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
"""Keep manual control while a run lasts; pure, told the time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from kachaka_simple_control.control.timing import LEASE_RENEW_AT_REST, LEASE_RENEW_LATEST
from kachaka_simple_control.errors import RunFaultError


class PendingResponse(Protocol):
    """The answer to a request for manual control, which may still be on its way."""

    @property
    def done(self) -> bool:
        """Whether it has come."""

    @property
    def refusal(self) -> str | None:
        """Why manual control was refused; None if it was granted."""


class LeaseRenewer:
    """
    Asks for manual control again in time.

    The robot serves that request between velocities, so that an answer which takes long is a hole
    in them: longer than its hold, and it has stopped in mid-motion.
    """

    def __init__(self, request: Callable[[], PendingResponse], patience: float) -> None:
        """
        Make a renewal for a robot that has not been asked yet.

        :param request: asks for manual control, without waiting
        :param patience: how long an answer may take in a run [s]
        """
        self._request = request
        self._patience = patience
        self._asked = float('-inf')
        self._pending: PendingResponse | None = None

    def granted(self, asked: float) -> None:
        """
        Take note that manual control was granted.

        :param asked: when it was asked for [s]; it lasts at least from then
        """
        self._asked = asked
        self._pending = None

    def is_stale(self, now: float) -> bool:
        """
        Tell whether manual control should be asked for before a run begins.

        :param now: the time [s]
        :returns: whether the last request is old enough to use a rest for the next
        """
        return now - self._asked >= LEASE_RENEW_AT_REST

    def on_sent(self, now: float, rest: float) -> None:
        """
        Ask again if it is time to.

        :param now: the time [s]
        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """
        age = now - self._asked
        if age >= LEASE_RENEW_LATEST or (age >= LEASE_RENEW_AT_REST and rest >= self._patience):
            self._asked = now
            self._pending = self._request()

    def poll(self, now: float) -> None:
        """
        Look at the answer that is on its way, if one is.

        :param now: the time [s]
        :raises RunFaultError: if it took too long, or manual control was refused
        """
        if self._pending is None:
            return
        if not self._pending.done:
            self._require_response(now - self._asked)
            return
        refusal, self._pending = self._pending.refusal, None
        if refusal is not None:
            raise RunFaultError(f'the robot took manual control away: {refusal}')

    def _require_response(self, waited: float) -> None:
        if waited > self._patience:
            raise RunFaultError(
                f'manual control was not renewed within {self._patience * 1e3:.0f} ms; the robot '
                'may have stopped meanwhile, so the motion was given up')
