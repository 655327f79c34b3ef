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
The function that starts the command ``kachaka_simple_control``.

With argcomplete installed, a shell can complete the arguments of this command.
"""

# PYTHON_ARGCOMPLETE_OK: with this mark, the global completion of argcomplete finds this file.

import sys

from kachaka_simple_control.entry_points import run


def main() -> int:
    """
    Run the command ``kachaka_simple_control``, and return its exit code.

    The command drives a motion, or shows the motion without driving.
    """
    return run('commands.drive_or_preview')


if __name__ == '__main__':
    sys.exit(main())
