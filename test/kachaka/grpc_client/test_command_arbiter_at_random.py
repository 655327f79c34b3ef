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
"""Invariants of the command arbiter under random events."""

from __future__ import annotations

from hypothesis import strategies as st
from hypothesis.stateful import invariant, precondition, rule, RuleBasedStateMachine
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import (
    CommandArbiter,
    RpcKind,
    VelocityCommand,
)
from kachaka_simple_control.kachaka.robot_status import RpcFailure, RpcResult

COMMAND_TIMEOUT = KACHAKA.command_timeout
RESULTS = st.sampled_from([
    RpcResult(code=0), RpcResult(code=0), RpcResult(code=13151), RpcResult(code=21051),
    RpcResult(failure=RpcFailure.LATE), RpcResult(failure=RpcFailure.FAILED)])
PAUSES = st.sampled_from([0.001, 0.02, 0.1, 0.2, 0.4])


class ArbiterAtRandom(RuleBasedStateMachine):
    """A publisher, a robot and a connection that act at random."""

    def __init__(self):
        """Begin connected."""
        super().__init__()
        self.arbiter = CommandArbiter(COMMAND_TIMEOUT)
        self.arbiter.on_connected()
        self.is_connected = True
        self.now = 0.0
        self.last_stop = -1.0
        self.in_flight = []
        self.on_response = {}

    @rule(pause=PAUSES)
    def time_passes(self, pause):
        """Only the time changes."""
        self.now += pause

    @rule(linear=st.sampled_from([0.5, -1.0, 0.1]))
    def motion_comes(self, linear):
        """Receive the newest command."""
        self.now += 0.001
        self.arbiter.on_command(VelocityCommand(linear, 0.0, self.now))

    @rule()
    def stop_comes(self):
        """Receive a zero; it must be sent at once, unless one is in flight."""
        self.now += 0.001
        self.last_stop = self.now
        self.arbiter.on_command(VelocityCommand(0.0, 0.0, self.now))
        if self.is_connected and not any(
                request.kind is RpcKind.STOP for request in self.in_flight):
            request = self.arbiter.next_request(self.now)
            assert request is not None
            assert request.kind is RpcKind.STOP
            self.in_flight.append(request)

    @precondition(lambda self: self.in_flight)
    @rule(data=st.data(), result=RESULTS, pause=PAUSES)
    def call_ends(self, data, result, pause):
        """In any order."""
        request = self.in_flight.pop(data.draw(st.integers(0, len(self.in_flight) - 1)))
        self.now += pause
        self.arbiter.on_response(request, result, self.now)
        self.on_response[request.kind] = self.now

    @rule()
    def link_is_lost(self):
        """Disconnect; calls in flight end later."""
        self.arbiter.on_connection_lost()
        self.is_connected = False

    @rule()
    def link_is_back(self):
        """Also if it was not lost."""
        self.arbiter.on_connected()
        self.is_connected = True

    @rule()
    def robot_is_given_back(self):
        """Manual control is switched off by the service."""
        self.now += 0.001
        self.last_stop = self.now
        self.arbiter.cancel_motion()

    @invariant()
    def only_what_may_be_sent_is_sent(self):
        """At each moment."""
        while (request := self.arbiter.next_request(self.now)) is not None:
            assert self.is_connected
            kinds = [other.kind for other in self.in_flight]
            if request.kind is RpcKind.STOP:
                assert RpcKind.STOP not in kinds
            else:
                assert not kinds, 'one at a time'
            if request.kind is RpcKind.MOTION:
                assert request.command.time > self.last_stop, 'older than a stop'
                assert self.now - request.command.time <= COMMAND_TIMEOUT
            if request.kind is RpcKind.ENABLE:
                assert RpcKind.MOTION in self.on_response, 'only for a motion that was refused'
            self.in_flight.append(request)

    def teardown(self):
        """At the end the publisher stops and the robot responds: it must be at rest."""
        self.now += 0.001
        self.arbiter.on_connected()
        self.arbiter.on_command(VelocityCommand(0.0, 0.0, self.now))
        last, motion_ended = None, -1.0
        for _ in range(20):
            while (request := self.arbiter.next_request(self.now)) is not None:
                assert request.kind is RpcKind.STOP
                self.in_flight.append(request)
                last = (request, self.now)
            if not self.in_flight:
                break
            request = self.in_flight.pop(0)
            self.now += 0.01
            self.arbiter.on_response(request, RpcResult(code=0), self.now)
            if request.kind is RpcKind.MOTION:
                motion_ended = self.now
        assert not self.in_flight
        assert not self.arbiter.may_move
        assert last is None or last[1] >= motion_ended, 'a stop has the last word'


TestArbiterAtRandom = ArbiterAtRandom.TestCase
