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
"""Signals: every handler is called, whatever the program is doing."""

import signal
import time

from kachaka_simple_control.process.signals import SignalDispatcher


class RecordingHandler:
    """A handler that records its calls."""

    def __init__(self):
        """Begin without calls."""
        self.received = []
        self.woken = 0

    def on_signal(self, signum):
        """Record it."""
        self.received.append(signum)

    def wake(self):
        """Record it."""
        self.woken += 1


def test_handlers_are_called_even_if_no_thread_can_start(monkeypatch):
    """As at the end of Python 3.12 and later, while a thread still drives."""
    def refuse(self):
        raise RuntimeError("can't create new thread at interpreter shutdown")

    dispatcher, first, second = SignalDispatcher(), RecordingHandler(), RecordingHandler()
    dispatcher._handlers += [first, second]
    monkeypatch.setattr('threading.Thread.start', refuse)
    dispatcher._dispatch(signal.SIGTERM)
    assert first.received == second.received == [signal.SIGTERM]
    assert first.woken == second.woken == 1
    assert dispatcher.signum == signal.SIGTERM


class SlowHandler(RecordingHandler):
    """Takes its time to stop a robot."""

    def uncaught(self, error):
        """Record when it begins and ends."""
        self.received.append(time.monotonic())
        time.sleep(0.3)
        self.woken += 1


def test_after_an_uncaught_error_no_stop_waits_for_another(monkeypatch):
    """Two robots that other threads drive: the second one drove on for 0.4 s."""
    dispatcher = SignalDispatcher()
    dispatcher._handlers += [SlowHandler(), SlowHandler(), SlowHandler()]
    monkeypatch.setattr(dispatcher, '_excepthook', lambda *_: None)
    dispatcher._except(ValueError, ValueError('of the user'), None)
    assert [handler.woken for handler in dispatcher._handlers] == [1, 1, 1]
    times = [begun for handler in dispatcher._handlers for begun in handler.received]
    assert max(times) - min(times) < 0.2  # less than one takes


def test_after_an_uncaught_error_all_are_stopped_even_if_no_thread_can_start(monkeypatch):
    def refuse(self):
        raise RuntimeError("can't start new thread")

    dispatcher = SignalDispatcher()
    dispatcher._handlers += [SlowHandler(), SlowHandler()]
    monkeypatch.setattr(dispatcher, '_excepthook', lambda *_: None)
    monkeypatch.setattr('threading.Thread.start', refuse)
    dispatcher._except(ValueError, ValueError('of the user'), None)
    assert [handler.woken for handler in dispatcher._handlers] == [1, 1]
