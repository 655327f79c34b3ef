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
"""A hook that rclpy lacks: do something while a context can still publish."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.context import Context


def before_shutdown(context: Context, callback: Callable[[], None]) -> None:
    """
    Call a function before a context is shut down, in the thread that shuts it down.

    rclpy's own ``Context.on_shutdown`` comes after the fact, when nothing can be published any
    more (ros2/rclpy issue 1077), so the context's two ways to shut down are wrapped.

    :param context: the context, as ``rclpy.shutdown`` will find it
    :param callback: what to call; it may be called more than once
    """
    for name in ('shutdown', 'try_shutdown'):
        setattr(context, name, _preceded(getattr(context, name), callback))


def _preceded(function: Callable[..., Any], callback: Callable[[], None]) -> Callable[..., Any]:
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        callback()
        return function(*args, **kwargs)
    return wrapped
