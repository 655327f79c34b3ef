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
"""Show motions without driving, for --list, --plan and --plot; this module needs no ROS."""

from __future__ import annotations

from dataclasses import replace
import sys
import textwrap

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.commands.cli import Options
from kachaka_simple_control.commands.settings import (
    choose_settings,
    describe_overrides,
    order_of,
)
from kachaka_simple_control.files.floor_file import find_floor
from kachaka_simple_control.files.library import find, library
from kachaka_simple_control.files.robot_profile import find_robot, robots
from kachaka_simple_control.process.output import print_result
from kachaka_simple_control.report.output_file import check_plot_file
from kachaka_simple_control.report.plan_plot import save_plot
from kachaka_simple_control.report.text_tables import plan_table, terminal_columns, WIDEST
from kachaka_simple_control.ros.node_parameters import require_parameters_only


def preview(options: Options) -> None:
    """
    List the motions of the package, or print or plot the plans of motions.

    :raises InvalidMotionError: if a motion is invalid or not found
    :raises UsageError: if an option or the floor is invalid, or the plot cannot be written
    :raises RunFaultError: if the text cannot be printed
    """
    option = '--plan' if options.plan else '--plot' if options.plot else '--list'
    require_parameters_only(option, options.ros_arguments)
    if options.plot is not None:
        check_plot_file(options.plot)
    if options.list:
        print_result(_listing(options), 'the list')
    if options.plan or options.plot is not None:
        previews = [plan_view(name, options) for name in options.motions or ['lesson']]
        if options.plan:
            print_result(plan_table(previews, terminal_columns()), 'the plan')
        if options.plot is not None:
            floor = None if options.floor_file is None else find_floor(options.floor_file).floor
            save_plot(options.plot, [replace(view, obstacles=floor) for view in previews])


def _listing(options: Options) -> str:
    """Return a text with each motion of the package and its parameters, and with each robot."""
    # Values are for the motions that are named, not for these.
    options = replace(options, values=())
    names = library()
    width = max(map(len, names))
    lines = []
    for name in names:
        preview, motion_file = plan_view(name, options), find(name)
        head = f'{name:{width}}  {preview.plan.duration:>6.1f} s  '
        indent = ' ' * len(head)
        lines += textwrap.wrap(
            motion_file.motion.description, WIDEST, initial_indent=head,
            subsequent_indent=indent) or [head.rstrip()]
        for parameter in motion_file.parameters.values():
            text = ': '.join(filter(None, [str(parameter), parameter.description]))
            lines += textwrap.wrap(
                text, WIDEST, initial_indent=f'{indent}  ', subsequent_indent=f'{indent}    ')
    lines += ['', 'Robots, for --robot:']
    for name in robots():
        robot = find_robot(name)
        laser = '' if robot.laser is None else ', a laser'
        lines.append(f'{name:{width}}  {robot.limits.max_linear_velocity:g} m/s, '
                     f'{robot.limits.max_angular_velocity:g} rad/s{laser}')
    return '\n'.join(lines)


def plan_view(name: str, options: Options) -> PlanView:
    """
    Plan a motion, and return the plan with what is needed to print or plot it.

    What overrides the motion's file is printed to standard error, unless motions are listed.

    :raises InvalidMotionError: if the motion is invalid or not found, or a value is wrong
    :raises UsageError: if an option is invalid
    """
    motion_file = find(name, **dict(options.values))
    settings = choose_settings(options, motion_file)
    if not options.list:
        for line in describe_overrides(options, motion_file, settings):
            print(line, file=sys.stderr)
    profile = settings.profile
    order = order_of(options, motion_file, settings, profile)
    return PlanView(
        motion_file.title, profile.name, order.plan, order.limits, profile.footprint,
        profile.laser if settings.watch else None)
