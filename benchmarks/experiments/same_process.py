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
How often a node is not discovered by another node of its process; ``python -m`` runs this.

Each trial creates a robot, an observer and the node that drives, each with a ROS context of its
own, as the tests do.  The profile of Fast DDS is ours, or ours with the default way to discover
nodes of the same process.  Run several at once: the machine should be busy.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import sys
import tempfile
import time

from kachaka_simple_control.ros.dds_transport import PROFILES
from ros_domain import isolate_ros
from waiting import poll

#: A node that is discovered at all is discovered within about 0.2 s; the limit is generous [s].
LOST_AFTER = 15.0


def use_default_discovery(folder: Path) -> None:
    """Use our profile, written to a folder, without its setting for nodes of one process."""
    for name in PROFILES.values():
        if name in os.environ:
            profile = folder / 'default.xml'
            profile.write_text(
                Path(os.environ[name]).read_text().replace('USER_DATA_ONLY', 'FULL'))
            os.environ[name] = str(profile)


def is_discovered() -> bool:
    """Create the three nodes; return whether the observer discovers the node that drives."""
    from kachaka_simple_control import KachakaSimpleControl
    from listener import Listener
    import rclpy
    from rclpy.parameter import Parameter
    from topic_observer import NODE, TopicObserver
    with Listener(), TopicObserver() as observer:
        rclpy.init(args=[])
        node = KachakaSimpleControl(parameter_overrides=[Parameter('guardian', value=False)])
        found = poll(lambda: observer.node.count_publishers(f'{NODE}/planned_path'), LOST_AFTER)
        node.destroy_node()
        rclpy.shutdown()
    return found > 0


def main(arguments: list[str] | None = None) -> int:
    """Measure and print the result; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=300)
    parser.add_argument(
        '--default', action='store_true', help='discover as Fast DDS does by default')
    options = parser.parse_args(arguments)
    isolate_ros()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        if options.default:
            use_default_discovery(Path(folder))
        lost = sum(not is_discovered() for _ in range(options.trials))
    print(f'{lost} of {options.trials} nodes were lost '
          f'({(time.monotonic() - began) / options.trials:.2f} s a trial)')
    return int(lost > 0)


if __name__ == '__main__':
    sys.exit(main())
