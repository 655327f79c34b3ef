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
"""Signals: told to everybody, whatever the program is at."""

import signal

from kachaka_simple_control.control.signals import SignalDispatcher


class Noting:
    """A listener that notes what it is told."""

    def __init__(self):
        """Have heard nothing."""
        self.heard = []
        self.woken = 0

    def on_signal(self, signum):
        """Note it."""
        self.heard.append(signum)

    def wake(self):
        """Note it."""
        self.woken += 1


def test_where_no_thread_can_start_handlers_are_told_all_the_same(monkeypatch):
    """As at the end of Python 3.12 and later, while a thread still drives."""
    def refuse(self):
        raise RuntimeError("can't create new thread at interpreter shutdown")

    dispatcher, first, second = SignalDispatcher(), Noting(), Noting()
    dispatcher._handlers += [first, second]
    monkeypatch.setattr('threading.Thread.start', refuse)
    dispatcher._dispatch(signal.SIGTERM)
    assert first.heard == second.heard == [signal.SIGTERM]
    assert first.woken == second.woken == 1
    assert dispatcher.signum == signal.SIGTERM
