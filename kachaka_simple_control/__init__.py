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
Drive a robot with exactly timed velocities, and stop it at the end or after any error.

Importing this package does not import ROS: each public name is imported at its first use.
"""

from __future__ import annotations

# The import of typing.TYPE_CHECKING is slow.  Type checkers treat any name TYPE_CHECKING as true.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from kachaka_simple_control.errors import (
        ControlError,
        InvalidMotionError,
        MotionRefusedError,
        RobotNotFoundError,
        RunFaultError,
        UsageError,
    )
    from kachaka_simple_control.files.library import find
    from kachaka_simple_control.fleet.fleet import Fleet
    from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
    from kachaka_simple_control.motion.geometry import Pose, Velocity
    from kachaka_simple_control.motion.include import Include
    from kachaka_simple_control.motion.limits import Limits
    from kachaka_simple_control.motion.plan import Plan, plan
    from kachaka_simple_control.motion.steps import (
        Arc,
        Forward,
        Motion,
        Move,
        Repeat,
        Settle,
        Step,
        Turn,
        Wait,
    )
    from kachaka_simple_control.motion.waypoints import Goto, Waypoints

__all__ = [
    'Arc', 'ControlError', 'Fleet', 'Forward', 'Goto', 'Include', 'InvalidMotionError',
    'KachakaSimpleControl', 'Limits', 'Motion', 'MotionRefusedError', 'Move', 'Plan', 'Pose',
    'Repeat', 'RobotNotFoundError', 'RunFaultError', 'Settle', 'Step', 'Turn', 'UsageError',
    'Velocity', 'Wait', 'Waypoints', 'find', 'plan',
]

#: The public names, by the module that defines them.  They are loaded at the first use, so that a
#: command starts quickly: until the first line of its code runs, Ctrl+C prints a traceback.
_NAMES = {
    'errors': ('ControlError', 'InvalidMotionError', 'MotionRefusedError', 'RobotNotFoundError',
               'RunFaultError', 'UsageError'),
    'files.library': ('find',),
    'fleet.fleet': ('Fleet',),
    'kachaka_simple_control': ('KachakaSimpleControl',),
    'motion.geometry': ('Pose', 'Velocity'),
    'motion.include': ('Include',),
    'motion.limits': ('Limits',),
    'motion.plan': ('Plan', 'plan'),
    'motion.steps': (
        'Arc', 'Forward', 'Motion', 'Move', 'Repeat', 'Settle', 'Step', 'Turn', 'Wait'),
    'motion.waypoints': ('Goto', 'Waypoints'),
}


def __getattr__(name: str) -> Any:
    if name == '__version__':
        from kachaka_simple_control.process.version import installed_version
        return installed_version()
    module = next((module for module, names in _NAMES.items() if name in names), None)
    if module is None:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from importlib import import_module
    value = getattr(import_module(f'{__name__}.{module}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, '__version__'])
