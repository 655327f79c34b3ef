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
"""A thread that spins an executor, and ends before the executor does."""

from __future__ import annotations

import contextlib
import threading

from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation


class SpinThread:
    """
    Spins an executor until it is closed.

    ``Executor.shutdown()`` beside ``spin()`` may destroy what the thread is about to wait for.
    """

    def __init__(self, executor: Executor) -> None:
        """Take an executor; it is shut down at the end."""
        self._executor = executor
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End the thread, then the executor."""
        self._is_over.set()
        self._executor.wake()
        self._thread.join(5.0)
        self._executor.shutdown()

    def _spin(self) -> None:
        while not self._is_over.is_set():
            # Another thread may destroy what this one waits for.
            with contextlib.suppress(rclpy_implementation.InvalidHandle):
                self._executor.spin_once(timeout_sec=0.5)
