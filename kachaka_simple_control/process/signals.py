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
Handle the signals that end a program: SIGINT, SIGTERM and SIGHUP.

A program that drives uses ``signal_dispatcher``: its handlers stop the robots at once.  Other
programs, such as the simulator, use ``ShutdownEvent``: they wait for a signal, and end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
from functools import partial
import os
import select
import signal
import sys
import threading
import time
from traceback import extract_tb, walk_tb
from types import FrameType, TracebackType
from typing import Any, Protocol

from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.process.exit_codes import code_of, SIGNALLED
from kachaka_simple_control.text import escaped, escaped_lines, MAX_LINE_LENGTH

#: An error message does not name lines of code in these modules: this package, and the standard
#: library, which calls it in a thread or in a context manager.
OWN = {__name__.partition('.')[0], *sys.stdlib_module_names}
#: If this environment variable is not empty, an uncaught error of this package prints its
#: traceback.
TRACEBACK_VARIABLE = 'KACHAKA_SIMPLE_CONTROL_TRACEBACK'
#: The signals that request a program to end.
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: For this time after the first signal [s], further signals do not interrupt the main thread: a
#: second Ctrl+C must not end the stop early.  Chosen: longer than a stop, also over a lost link.
SIGNAL_DEBOUNCE = 4.0


def wakeup_pipe() -> tuple[int, int]:
    """
    Create a pipe to which Python writes the number of each signal; for the main thread only.

    :returns: the descriptor to read from, and the other one, to which a write never blocks
    """
    reader, writer = os.pipe()
    # Python writes from within the signal handler, which must not wait.
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    return reader, writer


class SignalHandler(Protocol):
    """An interface for an object that reacts when a signal or an error ends the program."""

    def on_signal(self, signum: int) -> None:
        """React to a signal that ends the program; in its own thread, so it may take long."""

    def wake(self) -> None:
        """Make the main thread return to Python if it waits in C code."""

    def uncaught(self, error: BaseException) -> None:
        """React to an exception that was not caught and ends the main thread."""


class _Deferral:
    """The ``with`` block of ``SignalDispatcher.deferred``; quicker than a generator."""

    def __init__(self, dispatcher: SignalDispatcher) -> None:
        self._dispatcher = dispatcher

    def __enter__(self) -> None:
        self._dispatcher.begin_deferral()

    def __exit__(self, *_: object) -> None:
        self._dispatcher.end_deferral()


class SignalDispatcher:
    """
    Calls all registered handlers when a signal ends the program; each process has one.

    A signal has two effects.  A separate thread calls the handlers at once, even while the main
    thread waits in C code.  And an exception is raised in the main thread, so that ``finally`` and
    ``with`` blocks run: KeyboardInterrupt for SIGINT, SystemExit(128 + N) for any other; a handler
    that the program had set before is called instead.  During SIGNAL_DEBOUNCE after the first
    signal, further ones have only the first effect.
    """

    def __init__(self) -> None:
        self._handlers: list[SignalHandler] = []
        self._previous: dict[int, Any] = {}
        self._first: float | None = None
        #: whether the main thread is in a block that no signal interrupts
        self._is_deferring = False
        self._deferral = _Deferral(self)
        #: the signal that came during such a block, and its stack frame
        self._deferred: tuple[int, FrameType | None] | None = None
        self._excepthook = sys.excepthook
        #: the first signal that came; None before the first
        self.signum: int | None = None

    def register(self, handler: SignalHandler) -> bool:
        """
        Register a handler, which is called for each signal that ends the program.

        :returns: False if the first call is not in the main thread, where alone Python sets
            handlers
        """
        if not self._previous and not self._install():
            return False
        self._handlers.append(handler)
        return True

    def unregister(self, handler: SignalHandler) -> None:
        """Remove a handler; it may have been removed before."""
        with contextlib.suppress(ValueError):
            self._handlers.remove(handler)

    def deferred(self) -> contextlib.AbstractContextManager[None]:
        """
        Delay the exceptions of signals until the end of a ``with`` block in the main thread.

        The registered handlers are still called at once.
        """
        return self._deferral

    def begin_deferral(self) -> None:
        """Delay the exceptions of signals from now on, if this is the main thread."""
        if threading.get_ident() == threading.main_thread().ident:
            self._is_deferring = True

    def end_deferral(self) -> None:
        """Stop the delay, and raise the exception of a signal that came meanwhile."""
        if threading.get_ident() != threading.main_thread().ident:
            return
        self._is_deferring = False
        if (deferred := self._deferred) is not None:
            self._deferred = None
            self._handle(*deferred)

    def handle_uncaught(self) -> None:
        """
        Make an uncaught error of this package print one line, and end with its exit code.

        The line has the message, and file and line of the user's program; the traceback with
        ``KACHAKA_SIMPLE_CONTROL_TRACEBACK``.  In another thread it ends only that thread.
        """
        if threading.excepthook is threading.__excepthook__:
            threading.excepthook = _except_in_thread
        if sys.excepthook != self._except:
            self._excepthook, sys.excepthook = sys.excepthook, self._except

    def reinstall(self) -> None:
        """
        Set the signal handlers again if C code has replaced them; keep those of Python code.

        Outside the main thread this does nothing.
        """
        if self._previous and threading.current_thread() is threading.main_thread():
            for signum in self._previous:
                if signal.getsignal(signum) == self._handle:
                    signal.signal(signum, self._handle)

    def _install(self) -> bool:
        if threading.current_thread() is not threading.main_thread():
            return False
        reader, _ = wakeup_pipe()
        for signum in ENDING_SIGNALS:
            # A signal that was ignored at start (nohup) stays ignored.
            if signal.getsignal(signum) != signal.SIG_IGN:
                self._previous[signum] = signal.signal(signum, self._handle)
        self.handle_uncaught()
        threading.Thread(target=self._read, args=(reader,), name='signals', daemon=True).start()
        return True

    def _read(self, reader: int) -> None:
        while signums := os.read(reader, 64):
            for signum in signums:
                if signum in self._previous:
                    self._dispatch(signum)

    def _dispatch(self, signum: int) -> None:
        self.signum = self.signum or signum
        handlers = [*self._handlers]
        run_in_threads([partial(handler.on_signal, signum) for handler in handlers])
        for handler in handlers:
            handler.wake()

    def _handle(self, signum: int, frame: FrameType | None) -> None:
        self.signum = self.signum or signum
        if self._is_deferring:
            self._deferred = signum, frame
            return
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
            raise SystemExit(SIGNALLED + signum)

    def _except(
            self,
            kind: type[BaseException],
            error: BaseException,
            traceback: TracebackType | None) -> None:
        # An interactive prompt continues after an error, so its robots also continue.
        if not hasattr(sys, 'ps1'):
            for thread in run_in_threads(
                    [partial(handler.uncaught, error) for handler in self._handlers]):
                thread.join()
        # After Ctrl+C Python already ends with the correct status; a traceback would not help.
        if kind is KeyboardInterrupt and self.signum == signal.SIGINT:
            return
        if (self.signum is not None and not hasattr(sys, 'ps1')
                and _is_interrupted_call(error, traceback)):
            raise SystemExit(SIGNALLED + self.signum)
        # If a hook that was set later calls this one again, use Python's own hook next.
        hook, self._excepthook = self._excepthook, sys.__excepthook__
        try:
            if (not isinstance(error, ControlError) or hook is not sys.__excepthook__
                    or hasattr(sys, 'ps1')):
                hook(kind, error, traceback)
                return
            if self.signum is not None:  # the error only reports that the signal ended the motion
                raise SystemExit(SIGNALLED + self.signum)
            if os.environ.get(TRACEBACK_VARIABLE):
                hook(kind, error, traceback)
            else:
                _print(error, traceback)
            raise SystemExit(code_of(error))
        finally:
            self._excepthook = hook


def run_in_threads(functions: Sequence[Callable[[], object]]) -> list[threading.Thread]:
    """
    Run each function in its own thread, so that none waits for another; return the threads.

    If no thread can start, because Python shuts down, they are called in this one.
    """
    threads, left = [], []
    for function in functions:
        thread = threading.Thread(target=function, daemon=True)
        try:
            thread.start()
            threads.append(thread)
        except RuntimeError:  # from Python 3.12 on, no thread can start when the program ends
            left.append(function)
    for function in left:
        function()
    return threads


def _is_interrupted_call(error: BaseException, traceback: TracebackType | None) -> bool:
    """
    Return whether a signal may have caused an error inside rclpy.

    rclpy hides an exception that is raised while it converts a message behind its own.  Measured:
    one of 20 SIGTERM in ``rclpy.spin`` caused ``RuntimeError: Unable to convert call argument``.
    """
    frames = [*walk_tb(traceback)]
    module = str(frames[-1][0].f_globals.get('__name__', '')) if frames else ''
    return isinstance(error, (RuntimeError, TypeError)) and module.partition('.')[0] == 'rclpy'


def _print(error: BaseException, traceback: TracebackType | None) -> None:
    print(f'{_place(traceback)}{escaped_lines(error)}', file=sys.stderr)


def _except_in_thread(arguments: threading.ExceptHookArgs) -> None:
    error = arguments.exc_value
    if isinstance(error, ControlError) and not os.environ.get(TRACEBACK_VARIABLE):
        _print(error, arguments.exc_traceback)
    else:
        threading.__excepthook__(arguments)


def _place(traceback: TracebackType | None) -> str:
    """
    Return file and line of the user's program in which an error occurred, as in ``drive.py:12: ``.

    It is the innermost call that is neither in this package nor in Python's library; else empty.
    """
    # Compare module names: code that dataclasses generate for a class of this package has no file.
    frames = [summary for summary, (frame, _) in zip(
                  extract_tb(traceback), walk_tb(traceback), strict=True)
              if frame.f_globals.get('__name__', '').partition('.')[0] not in OWN]
    if not frames:
        return ''
    return f'{escaped(frames[-1].filename, MAX_LINE_LENGTH)}:{frames[-1].lineno}: '


#: Python has one set of signal handlers and one wake-up descriptor, so there is one dispatcher.
signal_dispatcher = SignalDispatcher()


class ShutdownEvent:
    """
    Waits until the process has to end: a signal, a call of ``end``, or the end of standard input.

    A context manager for the main thread, early in the process.  A signal makes ``wait`` return,
    and interrupts no other code.  One that was ignored at the start, as by ``nohup``, stays
    ignored.
    """

    def __enter__(self) -> ShutdownEvent:
        """Make a signal end ``wait`` from now on; it no longer interrupts other code."""
        self._reader, self._writer = wakeup_pipe()
        for signum in ENDING_SIGNALS:
            if signal.getsignal(signum) != signal.SIG_IGN:
                signal.signal(signum, lambda *_: None)
        return self

    def __exit__(
            self,
            kind: type[BaseException] | None,
            error: BaseException | None,
            traceback: TracebackType | None) -> None:
        """
        Ignore further signals, so that none interrupts the shutdown.

        A handler would not be enough, because Python removes its handlers when it exits.
        """
        for signum in ENDING_SIGNALS:
            signal.signal(signum, signal.SIG_IGN)

    def end(self) -> None:
        """Make ``wait`` return; any thread may call this."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._writer, b'\0')

    @property
    def is_set(self) -> bool:
        """Whether the process has to end, so that ``wait`` would return at once."""
        return bool(select.select([self._reader], [], [], 0.0)[0])

    def wait(self, with_parent: bool) -> None:
        """
        Wait for a signal that ends the process, or for a call of ``end``.

        :param with_parent: whether the end of standard input, a pipe from a parent that may be
            killed, also ends the wait
        """
        sources = [self._reader] + with_parent * [sys.stdin.fileno()]
        while True:
            readable = select.select(sources, [], [])[0]
            if self._reader in readable or not os.read(readable[0], 4096):
                return
