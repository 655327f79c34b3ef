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
Make Ctrl+C end the process at once, without a traceback, while the program starts.

Tested by test/test_entry_points.py.
"""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType


def _exit(signum: int, _frame: FrameType | None) -> None:
    # 128 is SIGNALLED of exit_codes; the import of that module would be slow.
    os._exit(128 + signum)


def exit_on_interrupt() -> None:
    """
    Make Ctrl+C end the process at once, until ``raise_on_interrupt`` is called.

    For the time of imports, in which Ctrl+C would print a traceback.  Nothing is done if SIGINT is
    ignored or has another handler, or outside the main thread.
    """
    if (threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        signal.signal(signal.SIGINT, _exit)


def raise_on_interrupt() -> None:
    """Undo ``exit_on_interrupt``: Ctrl+C raises KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _exit:
        signal.signal(signal.SIGINT, signal.default_int_handler)
