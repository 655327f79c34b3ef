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
"""The power button of a simulated robot: a signal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import os
import signal
import threading

#: What presses it: ``kill -USR1`` and the number of the process.
SIGNAL = signal.SIGUSR1


def hold_back() -> None:
    """
    Keep the signal for whoever waits for it; call it before there are any other threads.

    It is not handled but waited for, since ``Ending`` takes any handled signal for the end.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {SIGNAL})


@contextlib.contextmanager
def power_button(press: Callable[[], None]) -> Iterator[None]:
    """
    Let the signal press a button for the length of a ``with`` block.

    :param press: what to do each time
    :returns: a context manager
    """
    is_over = threading.Event()

    def wait() -> None:
        while signal.sigwait({SIGNAL}) and not is_over.is_set():
            press()

    thread = threading.Thread(target=wait, name='power-button')
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        # To the process, like any other: whichever thread waits for it takes it.
        os.kill(os.getpid(), SIGNAL)
        thread.join()
