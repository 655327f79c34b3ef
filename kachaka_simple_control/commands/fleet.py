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
The command ``kachaka_fleet``, which drives robots in step, or shows what they will do.

Tested by test/commands/test_kachaka_fleet.py.
"""

from __future__ import annotations

from collections.abc import Sequence
import dataclasses
import sys

from kachaka_simple_control.commands.drive_or_preview import with_ros
from kachaka_simple_control.commands.fleet_options import FleetOptions, NAME, parse
from kachaka_simple_control.files.fleet_file import find_fleet, fleets
from kachaka_simple_control.fleet.fleet_plan import FleetPlan, plan_fleet, require_clear
from kachaka_simple_control.fleet.fleet_table import fleet_table
from kachaka_simple_control.process.output import print_result
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.report.text_tables import terminal_columns


def main(args: Sequence[str] | None = None) -> int:
    """Run the command ``kachaka_fleet``."""
    options = parse(args)
    return run_command(lambda: _run(options), NAME, moves_robot=not options.is_preview)


def _run(options: FleetOptions) -> None:
    if options.list:
        print_result(_listing(), 'the list')
        return
    plan = _plan(options)
    if options.plan:
        print_result(fleet_table(plan, terminal_columns()), 'the plan')
    if options.plot is not None:
        _save_plot(options.plot, plan, options.floor_file)
    if options.is_preview:
        return
    if not options.allow_near:
        require_clear(plan)
    _drive(options, plan)


def _plan(options: FleetOptions) -> FleetPlan:
    file = find_fleet(options.file)
    if options.repeat is not None:
        file = dataclasses.replace(file, repeat=options.repeat)
    if options.on_fault is not None:
        file = dataclasses.replace(file, goes_on=options.on_fault == 'go_on')
    return plan_fleet(file, options.speed or 1.0, options.watch)


def _listing() -> str:
    files = [find_fleet(name) for name in fleets()]
    width = max(len(file.name) for file in files)
    return '\n'.join(
        f'{file.name:{width}}  {len(file.robots):3} robots  {file.description}' for file in files)


def _save_plot(path: str, plan: FleetPlan, floor_file: str | None) -> None:
    from kachaka_simple_control.files.floor_file import find_floor
    from kachaka_simple_control.report.fleet_plot import save_plot
    from kachaka_simple_control.report.output_file import check_plot_file
    check_plot_file(path)
    floor = None if floor_file is None else find_floor(floor_file).floor
    save_plot(path, dataclasses.replace(plan.view, obstacles=floor))


def _drive(options: FleetOptions, plan: FleetPlan) -> None:
    with with_ros():
        from kachaka_simple_control.commands.fleet_drive import drive
    drive(options, plan)


if __name__ == '__main__':
    sys.exit(main())
