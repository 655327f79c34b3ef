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
"""Signals that end a program, and waiting for them."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import Any, Protocol

from kachaka_simple_control.control.timing import SIGNAL_DEBOUNCE

#: What asks a program to end.
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class SignalHandler(Protocol):
    """Who must know of a signal."""

    def on_signal(self, signum: int) -> None:
        """
        React at once; runs in a thread of its own and may take its time.

        :param signum: the signal's number
        """

    def wake(self) -> None:
        """Make a main thread that waits in foreign code return to Python."""

    def uncaught(self, error: BaseException) -> None:
        """
        React to an exception that ends the main thread.

        :param error: what nobody caught
        """


class SignalDispatcher:
    """
    Watches for the signals that end a program; one for the whole process.

    Each signal is heard twice.  A thread reads it from the wake-up descriptor, at once, even
    while the main thread sits in foreign code, and tells the listeners.  Then Python's own
    handler runs in the main thread: it raises KeyboardInterrupt for SIGINT, as Python does, and
    SystemExit(128 + N) for the others, so that ``finally`` and ``with`` blocks run.
    """

    def __init__(self) -> None:
        """Make a watch that hears nothing yet."""
        self._listeners: list[SignalHandler] = []
        self._previous: dict[int, Any] = {}
        self._first: float | None = None
        self._reader: socket.socket | None = None
        self._writer: socket.socket | None = None
        self._excepthook = sys.excepthook
        #: the first signal that was heard; None before it
        self.signum: int | None = None

    def register(self, listener: SignalHandler) -> bool:
        """
        Tell somebody of each ending signal from now on.

        :param listener: who is told
        :returns: whether signals can be heard; false outside the main thread before the first
            listener, for Python sets handlers in its main thread alone
        """
        if not self._previous and not self._install():
            return False
        self._listeners.append(listener)
        return True

    def unregister(self, listener: SignalHandler) -> None:
        """
        Tell somebody no more.

        :param listener: as given to ``register``
        """
        with contextlib.suppress(ValueError):
            self._listeners.remove(listener)

    def reinstall(self) -> None:
        """Take the signals back from whoever took them after ``register``; main thread only."""
        if self._previous and threading.current_thread() is threading.main_thread():
            for signum in self._previous:
                if signal.getsignal(signum) == self._handle:
                    signal.signal(signum, self._handle)

    def _install(self) -> bool:
        if threading.current_thread() is not threading.main_thread():
            return False
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        for signum in ENDING_SIGNALS:
            # Ignored from the start (nohup): stays ignored.
            if signal.getsignal(signum) != signal.SIG_IGN:
                self._previous[signum] = signal.signal(signum, self._handle)
        self._excepthook, sys.excepthook = sys.excepthook, self._except
        threading.Thread(target=self._read, name='signals', daemon=True).start()
        return True

    def _read(self) -> None:
        assert self._reader is not None
        while heard := self._reader.recv(64):
            for signum in heard:
                if signum in self._previous:
                    self._dispatch(signum)

    def _dispatch(self, signum: int) -> None:
        self._note(signum)
        for listener in [*self._listeners]:
            # A thread each: one robot's stop must not wait for another's.
            try:
                threading.Thread(target=listener.on_signal, args=(signum,), daemon=True).start()
            except RuntimeError:  # no thread can start, as at Python's end from 3.12 on
                listener.on_signal(signum)
            listener.wake()

    def _note(self, signum: int) -> None:
        if self.signum is None:
            self.signum = signum

    def _handle(self, signum: int, frame: FrameType | None) -> None:
        self._note(signum)
        now = time.monotonic()
        if self._first is not None and now - self._first < SIGNAL_DEBOUNCE:
            return
        self._first = now
        previous = self._previous[signum]
        if callable(previous) and previous is not signal.default_int_handler:
            previous(signum, frame)
        elif signum == signal.SIGINT:
            raise KeyboardInterrupt
        else:
            raise SystemExit(128 + signum)

    def _except(
            self,
            kind: type[BaseException],
            error: BaseException,
            traceback: TracebackType | None) -> None:
        # A prompt survives its errors, and so do its robots.
        for listener in [] if hasattr(sys, 'ps1') else [*self._listeners]:
            listener.uncaught(error)
        # After Ctrl+C Python ends with the right status by itself; a traceback would help nobody.
        if not (kind is KeyboardInterrupt and self.signum == signal.SIGINT):
            self._excepthook(kind, error, traceback)


#: Python has one set of handlers and one wake-up descriptor, so there is one watch.
signal_dispatcher = SignalDispatcher()


#: What asks a program to end.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class ShutdownEvent:
    """
    Something to wait for; enter it in the main thread, before anything that takes its time.

    Signals are noted in a pipe and otherwise left without effect, so that none of them interrupts
    a start or leaves a traceback.  One that was ignored (nohup) stays ignored.
    """

    def __init__(self) -> None:
        """Wait for nothing yet."""
        self._reader, self._writer = os.pipe()
        # Python writes to it from within the signal, where waiting is no choice.
        os.set_blocking(self._writer, False)

    def __enter__(self) -> ShutdownEvent:
        """Listen to signals from now on, for the rest of the process."""
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        for signum in SIGNALS:
            if signal.getsignal(signum) != signal.SIG_IGN:
                signal.signal(signum, lambda *_: None)
        return self

    def __exit__(
            self,
            kind: type[BaseException] | None,
            error: BaseException | None,
            traceback: TracebackType | None) -> None:
        """Keep the handlers, so that a second signal does not cut the ending short."""

    def end(self) -> None:
        """End; from any thread."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._writer, b'\0')

    def wait(self, with_parent: bool) -> None:
        """
        Return when it is time to end.

        :param with_parent: whether to end, too, when standard input does: a parent that holds
            its other end can be killed without leaving this process behind
        """
        sources = [self._reader] + with_parent * [sys.stdin.fileno()]
        while True:
            readable = select.select(sources, [], [])[0]
            if self._reader in readable or not os.read(readable[0], 4096):
                return
