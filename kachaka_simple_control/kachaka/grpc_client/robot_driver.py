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
"""A robot behind gRPC: driven, watched, and left at rest."""

from __future__ import annotations

from collections.abc import Callable
import math
import threading
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.control.timing import SHUTDOWN_RPC_TIMEOUT
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.kachaka.error_codes import ErrorTexts, Level
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import (
    CommandArbiter,
    RpcKind,
    RpcRequest,
    VelocityCommand,
)
from kachaka_simple_control.kachaka.grpc_client.connection_state import (
    ConnectionEvent,
    ConnectionState,
    RpcFailure,
    RpcResult,
)

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.grpc_client.client import RobotClient

#: A motion may be under way, and beside it a stop that overtakes it.
WORKERS = 2
#: How long it may take to switch manual control on or off for somebody else [s].
MANUAL_CONTROL_DEADLINE = 3.0
#: How often a worker without work looks at the clock [s].
WORKER_PERIOD = 0.1
GOES_ON = 'moves again after a zero, or after 1 s without velocities'


class RobotDriver:
    """
    Threads that make the calls which a ``CommandArbiter`` decides on.

    May be used by many threads.  Nothing is sent before ``note`` has heard of an answer.
    """

    def __init__(
            self, client: RobotClient, hold: float, texts: ErrorTexts,
            tell: Callable[[Level, str], None],
            give_up: Callable[[str], None] = lambda _: None) -> None:
        """
        Be ready to drive.

        :param client: its calls
        :param hold: how long the robot keeps a velocity [s]
        :param texts: what its errors mean
        :param tell: called with what a person should know; must return at once
        :param give_up: called with the reason when motions are cut short; likewise
        """
        self._client = client
        self._hold = hold
        self._arbiter = CommandArbiter(hold)
        self._tell = tell
        self._give_up = give_up
        self._changed = threading.Condition()
        self._is_over = False
        self._has_control = False
        self._workers = [
            threading.Thread(target=self._work, name=f'robot-{number}', daemon=True)
            for number in range(WORKERS)]
        self.link = ConnectionState()
        self.texts = texts
        #: how long the robot took to answer a velocity last [s]
        self.round_trip = math.nan
        for worker in self._workers:
            worker.start()

    @property
    def dropped(self) -> int:
        """Return how many motions were never sent, for newer ones or for their age."""
        return self._arbiter.dropped

    def drive(self, command: VelocityCommand) -> None:
        """
        Let the robot have a command as soon as it can; returns at once.

        :param command: the newest command
        """
        with self._changed:
            self._arbiter.on_command(command)
            self._changed.notify()

    def set_manual_control(self, enabled: bool) -> RpcResult:
        """
        Let the robot take velocities, or none; returns when it has answered.

        :param enabled: whether it takes them
        :returns: how that ended
        """
        if not enabled:
            # What came before must not take the robot again.
            with self._changed:
                self._arbiter.cancel_motion()
                self._changed.notify()
        begun = time.monotonic()
        outcome = self._client.set_manual_control(enabled, MANUAL_CONTROL_DEADLINE)
        with self._changed:
            self._note(outcome, begun)
            if outcome.is_success:
                self._controls(enabled)
        return outcome

    def note(self, outcome: RpcResult, begun: float) -> None:
        """
        Learn from a call that somebody else made whether the robot is in reach.

        :param outcome: how it ended
        :param begun: when it began [s, steady clock]
        """
        with self._changed:
            self._note(outcome, begun)

    def close(self) -> None:
        """Leave the robot at rest, and give it back; at the latest after 2 s."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()
            may_move, has_control = self._arbiter.may_move, self._has_control
        if may_move:
            self._client.set_velocity(0.0, 0.0, SHUTDOWN_RPC_TIMEOUT)
        for worker in self._workers:
            worker.join(SHUTDOWN_RPC_TIMEOUT)
        if may_move:
            # Once more, for a motion was perhaps under way.
            self._client.set_velocity(0.0, 0.0, SHUTDOWN_RPC_TIMEOUT)
        if has_control:
            self._client.set_manual_control(False, SHUTDOWN_RPC_TIMEOUT)
        self._client.close()

    def _work(self) -> None:
        with self._changed:
            while not self._is_over:
                now = time.monotonic()
                order = self._arbiter.next_request(now)
                if order is not None:
                    self._execute(order)
                    continue
                self._pause(now)

    def _pause(self, now: float) -> None:
        """Wait for something to do; and notice when this program was frozen meanwhile."""
        look = self._arbiter.next_check
        timeout = WORKER_PERIOD if look is None else max(0.0, min(look - now, WORKER_PERIOD))
        self._changed.wait(timeout)
        self._detect_stall(now, timeout)

    def _detect_stall(self, begun: float, allowed: float) -> None:
        """Notice that something took longer than it can: this program was frozen."""
        woken = time.monotonic()
        if woken - begun > allowed + self._hold and not self._is_over:
            if self._arbiter.may_move:
                text = f'the bridge was held up for {woken - begun:.1f} s; the robot {GOES_ON}'
                self._tell(Level.WARN, text)
            self._arbiter.on_stall(woken)

    def _execute(self, order: RpcRequest) -> None:
        self._changed.release()
        begun = time.monotonic()
        try:
            outcome = self._perform(order)
        except Exception as error:  # whatever it is, the next zero must be able to leave
            text = escaped(f'{type(error).__name__}: {error}')
            outcome = RpcResult(failure=RpcFailure.FAILED, text=text)
        finally:
            self._changed.acquire()
        was_barred = self._arbiter.is_blocked
        self._arbiter.on_response(order, outcome, time.monotonic())
        if order.command is not None and outcome.got_response:
            self.round_trip = time.monotonic() - begun
        if order.kind is RpcKind.ENABLE and outcome.is_success:
            self._controls(True)
        self._note(outcome, begun)
        if self._arbiter.is_blocked and not was_barred and self.link.is_up:
            self._report_abort(order, outcome)
        # What came while a call was frozen is as old as what came while nothing was done.
        self._detect_stall(begun, order.deadline)
        self._changed.notify()

    def _perform(self, order: RpcRequest) -> RpcResult:
        command = order.command
        if command is None:
            return self._client.set_manual_control(True, order.deadline)
        return self._client.set_velocity(command.linear, command.angular, order.deadline)

    def _note(self, outcome: RpcResult, begun: float) -> None:
        if self._is_over:
            return  # calls that the end cut short say nothing about the link
        change = self.link.on_result(outcome, begun, time.monotonic())
        if change is ConnectionEvent.LOST:
            moved = self._arbiter.may_move
            self._arbiter.on_connection_lost()
            self._tell(Level.ERROR, f'the link to the robot is lost: {self.link.reason}')
            if moved:
                self._give_up(f'the link to the robot was lost: {self.link.reason}')
        elif change is not None:
            self._arbiter.on_connected()
            if change is ConnectionEvent.BACK:
                self._tell(Level.WARN, f'the link to the robot is back; it {GOES_ON}')
            self._changed.notify()

    def _report_abort(self, order: RpcRequest, outcome: RpcResult) -> None:
        if outcome.failure is not None:
            reason = f'the robot did not answer a velocity: {outcome.text}'
        else:
            what = 'manual control' if order.kind is RpcKind.ENABLE else 'a velocity'
            reason = f'the robot refused {what}: {self.describe(outcome)}'
        self._tell(Level.ERROR, f'{reason}; it {GOES_ON}')
        self._give_up(reason)

    def _controls(self, enabled: bool) -> None:
        self._has_control = enabled
        self._tell(Level.OK, f"manual control {'enabled' if enabled else 'disabled'}")

    def describe(self, outcome: RpcResult) -> str:
        """
        Say why the robot did not do something.

        :param outcome: how that ended
        :returns: the error's code and text, or what kept the answer away
        """
        return outcome.text if outcome.code is None else self.texts.describe(outcome.code)
