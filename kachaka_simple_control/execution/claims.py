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
"""Claims that programs on several machines tell each other of; pure, told the time."""

from __future__ import annotations

from dataclasses import asdict, dataclass
import json

#: How often a claim is told anew [s].
PERIOD = 0.5
#: A claim that was not heard of for this long [s] is over: whoever made it has ended or is frozen.
LEASE = 3 * PERIOD
#: No more claims than this are kept: the network may tell anything.
MOST = 64
#: No more of a text than this is shown.
LONGEST = 200

#: What is claimed: nothing any more; the robot, as soon as nobody else does; the robot, for good.
NOTHING, WANTED, HELD = 'nothing', 'wanted', 'held'


@dataclass(frozen=True)
class Claim:
    """
    What one program tells of itself.

    :param participant: its DDS participant, in hexadecimal digits
    :param state: what it claims: NOTHING, WANTED or HELD
    :param who: what people call it, and since when it holds the claim
    """

    participant: str
    state: str
    who: str

    def packed(self) -> str:
        """Return it as text, for the network."""
        return json.dumps(asdict(self))

    @staticmethod
    def unpacked(text: str) -> Claim | None:
        """
        Read a claim.

        :param text: what came from the network, which may be anything
        :returns: the claim; None if it is none
        """
        try:
            claim = Claim(**json.loads(text))
        except (ValueError, TypeError, RecursionError):
            return None
        if not all(isinstance(value, str) for value in asdict(claim).values()):
            return None
        if claim.state not in (NOTHING, WANTED, HELD):
            return None
        shown = ''.join(c if c.isprintable() else '?' for c in claim.who[:LONGEST])
        return Claim(claim.participant[:LONGEST], claim.state, shown)


class Claims:
    """What is known of the claims of others."""

    def __init__(self, participant: str) -> None:
        """
        Know of none.

        :param participant: the DDS participant of this program, in hexadecimal digits
        """
        self._participant = participant
        self._heard: dict[str, tuple[float, Claim]] = {}

    def hear(self, claim: Claim, now: float) -> None:
        """
        Take note of a claim.

        :param claim: the claim; one of our own says nothing
        :param now: when it was heard [s]
        """
        if claim.participant == self._participant:
            return
        self._heard.pop(claim.participant, None)
        self._heard[claim.participant] = now, claim
        if len(self._heard) > MOST:
            self._heard.pop(next(iter(self._heard)))

    def holder(self, now: float) -> Claim | None:
        """
        Return a claim that somebody else holds.

        :param now: the time [s]
        :returns: the claim; None if nobody does
        """
        return next((claim for claim in self._fresh(now) if claim.state == HELD), None)

    def rival(self, now: float) -> Claim | None:
        """
        Return a claim that we have to yield to, as long as we want the robot and do not hold it.

        :param now: the time [s]
        :returns: one that is held, or else that of another newcomer whose participant comes first
        """
        wanted = (claim for claim in self._fresh(now)
                  if claim.state == WANTED and claim.participant < self._participant)
        return self.holder(now) or next(wanted, None)

    def _fresh(self, now: float) -> list[Claim]:
        return [claim for heard, claim in [*self._heard.values()] if now - heard <= LEASE]
