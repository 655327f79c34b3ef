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
"""The options of a program that are figures of a simulated robot."""

from __future__ import annotations

import argparse

from kachaka_simple_control.robot.fidelity import Fidelity

#: Of each option that is a figure of ``Fidelity``: name, unit, help.
FIGURES = (
    ('lag', 'S', 'time constant of the drive'),
    ('linear_acceleration', 'M/S2', 'largest change of the forward velocity'),
    ('angular_acceleration', 'RAD/S2', 'largest change of the turning velocity'),
    ('linear_gain', 'F', 'true over demanded forward velocity'),
    ('angular_gain', 'F', 'true over demanded turning velocity'),
    ('velocity_noise', 'F', 'standard deviation of the velocity, as a part of it'),
    ('odometry_noise', 'M', 'standard deviation of the position in odometry'),
    ('heading_noise', 'RAD', 'standard deviation of the heading in odometry'),
    ('undock_distance', 'M', 'how far the robot drives off its dock'),
    ('undock_velocity', 'M/S', 'how fast it does that'),
)


def add_figures(parser: argparse.ArgumentParser) -> None:
    """
    Let a program take the figures.

    :param parser: the parser of its command line
    """
    for name, unit, text in FIGURES:
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=float, default=getattr(Fidelity, name),
            metavar=unit, help=f'{text} (default: %(default)s)')


def fidelity(options: argparse.Namespace) -> Fidelity:
    """
    Return the figures that were given.

    :param options: what the parser made of the command line
    :returns: the figures
    :raises ValueError: if no robot has one of them
    """
    return Fidelity(**{name: getattr(options, name) for name, _, _ in FIGURES})
