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
Define robot profiles, which describe a robot's ROS names, limits and outline.

The profile of Kachaka, the default robot, is part of this module.  The profiles of other robots
are read from YAML files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
import json
import math
import os
from pathlib import PurePath
import re
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.document import (
    Document,
    FileError,
    is_path,
    Problem,
    read_schema,
    UnreadableFileError,
)
from kachaka_simple_control.files.schema_messages import missing
from kachaka_simple_control.files.wording import did_you_mean
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.motion.geometry import Box, Disc, Footprint, Pose, Velocity
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES, Limits
from kachaka_simple_control.motion.units import (
    ANGLE,
    COMMAND_TIMEOUT,
    LENGTH,
    Quantity,
    SIZE,
    TIME,
    TOLERANCE,
    VEER,
)
from kachaka_simple_control.text import quoted

#: The message type of a robot that takes Twist or TwistStamped; the ROS graph tells which.
ANY_TYPE = 'any'


@dataclass(frozen=True)
class Laser:
    """
    The laser of a robot, and how near the robot may come to what it sees.

    :param topic: of its scans (sensor_msgs/LaserScan), relative to the robot's namespace
    :param ahead: where it is, from the wheel axle [m], as ``left``
    :param yaw: the direction of its angle 0, counter-clockwise from ahead [rad]
    :param margin: what stays free around the outline of the robot [m]
    :param view: how much it sees around the robot, half of it on each side of ahead [rad]
    """

    topic: str
    ahead: float = 0.0
    left: float = 0.0
    yaw: float = 0.0
    margin: float = 0.05
    view: float = math.tau

    @property
    def pose(self) -> Pose:
        """Return the pose of the laser in the frame of the robot."""
        return Pose(self.ahead, self.left, self.yaw)

    @property
    def sees_behind(self) -> bool:
        """Return whether it sees all around the robot, so that a drive backwards is watched."""
        return self.view >= math.tau * (1.0 - 1e-9)


@dataclass(frozen=True)
class RobotProfile:
    """
    The ROS interface and the limits of a robot.

    The names of topics and services are relative to the ROS namespace of the robot.

    :param namespace: the default ROS namespace of the robot, absolute
    :param odometry_topic: the topic of the robot's odometry; None if it has no odometry
    :param manual_control_service: the service that enables velocity commands (std_srvs/SetBool);
        None if velocity commands are always enabled
    :param manual_control_timeout: how long one call of the service enables velocity commands [s];
        infinite if there is no service or no such timeout
    :param footprint: the outline of the robot; None if unknown
    :param calibration: the difference between the velocities that are sent and the velocities that
        odometry reports; None for no difference
    :param odometry_calibration: the difference between reported odometry and the true motion on
        the floor; None for no difference
    :param odometry_required: whether a robot without a publisher of odometry is not driven
    :param laser: None without one, or if nothing is known of it
    """

    name: str
    namespace: str
    velocity_topic: str
    odometry_topic: str | None
    manual_control_service: str | None
    manual_control_timeout: float
    command_timeout: float
    limits: Limits
    message_type: str = 'Twist'
    frame: str = 'base_link'
    footprint: Footprint | None = None
    calibration: Calibration | None = None
    odometry_calibration: OdometryCalibration | None = None
    odometry_required: bool = True
    laser: Laser | None = None

    @property
    def is_kachaka(self) -> bool:
        """Return whether the robot is a Kachaka, recognized by the name of its velocity topic."""
        return self.velocity_topic == KACHAKA.velocity_topic

    @property
    def is_calibrated(self) -> bool:
        """Return whether the profile has a calibration, which corrects velocity commands."""
        return self.calibration is not None or self.odometry_calibration is not None

    @property
    def planning_limits(self) -> Limits:
        """
        Return the limits for planning a motion.

        A calibration changes the planned velocities before they are sent.  The returned limits are
        so low that the changed velocities are still within the robot's limits.  Without a
        calibration, the robot's limits are returned.
        """
        limits = self.limits
        for calibration in (self.calibration, self.odometry_calibration):
            if calibration is not None:
                limits = calibration.reduce(limits)
        return limits

    @property
    def delay(self) -> float:
        """Return how long the robot takes to follow a velocity [s]; 0 if not measured."""
        return self.known_delay or 0.0

    @property
    def known_delay(self) -> float | None:
        """Return how long the robot takes to follow a velocity [s]; None if not measured."""
        return None if self.calibration is None else self.calibration.delay

    def feedback_delay(self) -> float:
        """
        Return the delay with which the robot follows a velocity command [s].

        The closed loop, which uses odometry to correct the velocities, needs this delay.

        :raises UsageError: if the delay was not measured, or the robot has no odometry
        """
        if self.odometry_topic is None:
            raise UsageError(f'a closed loop needs odometry, and {self.name} has none')
        if self.calibration is None or self.calibration.delay is None:
            raise UsageError(
                f'a closed loop needs to know the delay of the robot, and that of {self.name} was '
                'not measured: `kachaka_calibrate` does it')
        return self.calibration.delay

    def watching_laser(self) -> Laser:
        """
        Return the laser with which the obstacle watch sees what is on the path.

        :raises UsageError: if the robot has none, or its outline is not known
        """
        for what, is_known, example in (
                ('a laser', self.laser, 'laser: {topic: scan}'),
                ('the outline of the robot', self.footprint, 'footprint: {radius: 0.2 m}')):
            if is_known is None:
                raise UsageError(
                    f'watch needs {what}, and profile {self.name} names none: add {example}')
        assert self.laser is not None
        return self.laser

    def command(self, velocity: Velocity) -> Velocity:
        """
        Return the velocity to send so that the robot truly moves at a wanted velocity.

        The calibrations in this profile define the difference between the two velocities.
        """
        if self.odometry_calibration is not None:
            velocity = self.odometry_calibration.to_odometry(velocity)
        return velocity if self.calibration is None else self.calibration.command(velocity)

    def expected(self, command: Velocity) -> Velocity:
        """
        Return the velocity at which the robot truly moves when a given velocity is sent.

        The calibrations in this profile define the difference between the two velocities.
        """
        velocity = command if self.calibration is None else self.calibration.response(command)
        return velocity if self.odometry_calibration is None else (
            self.odometry_calibration.to_floor(velocity))


#: The laser of Kachaka.  Its place is from kachaka_description, its topic from
#: lidar_component.cpp.  Its rear is hidden; by how much the manufacturer does not say: 90 deg are
#: assumed.  The margin is chosen.
KACHAKA_LASER = Laser(
    'lidar/scan', ahead=0.156, left=0.0, yaw=math.pi / 2.0, margin=0.05,
    view=math.radians(270.0))
#: The profile of Kachaka, a robot of Preferred Robotics; it needs no file.  The names are those of
#: the manufacturer's ROS 2 bridge.  The source of each value is the file named next to it, in the
#: manufacturer's public repository pf-robotics/kachaka-api, unless the value is marked as chosen.
KACHAKA = RobotProfile(
    name='kachaka',
    namespace='/kachaka',  # grpc_ros2_bridge.launch.xml
    velocity_topic='manual_control/cmd_vel',  # manual_control_component.cpp
    odometry_topic='odometry/odometry',  # odometry_component.cpp
    manual_control_service='manual_control/set_enabled',  # manual_control_component.cpp
    manual_control_timeout=60.0,  # docs/kachaka_api_client.ipynb, cell 77
    command_timeout=0.3,  # docs/kachaka_api_client.ipynb, cell 81
    limits=Limits(
        max_linear_velocity=0.3, max_angular_velocity=1.57,  # python/kachaka_api/base.py
        # The manufacturer publishes no accelerations.  Chosen: a gentle start, with full speed
        # after 0.85 s, or 0.88 s in a turn.  Decelerations are not given, so they are the same.
        max_linear_acceleration=0.5, max_angular_acceleration=2.5,
        max_linear_jerk=2.0, max_angular_jerk=10.0),
    # kachaka_description; the axle is at the origin
    footprint=Box(length=0.387, width=0.240, ahead=0.0435),
    laser=KACHAKA_LASER)
#: The frame of the scans of Kachaka, from kachaka_description.
KACHAKA_LASER_FRAME = 'laser_frame'
#: How long the laser of a Kachaka runs after it was asked to [s], as the maker's own client asks
#: (python/kachaka_api/util/vision.py).
KACHAKA_LASER_TIME = 5.0
#: The track of Kachaka, the distance between its wheels [m], from kachaka_description.
KACHAKA_TRACK = 0.2


SCHEMA = 'robots/robot.schema.json'
#: The shortest command timeout of a robot [s]: a velocity may be late by 0.1 s, and the highest
#: rate is 1000 Hz (MAX_LATENESS + 1 / MAX_RATE in control/timing.py).  With less, no rate is
#: possible.
MIN_COMMAND_TIMEOUT = 0.101
#: The keys that a file must have, unless it extends another robot.
REQUIRED = ('velocity_topic', 'command_timeout', 'limits')
#: The keys whose values are stored unchanged in the fields of the same names.
UNCHANGED = (
    'name', 'namespace', 'velocity_topic', 'odometry_topic', 'odometry_required', 'message_type',
    'frame')
#: The default values for a robot file that extends no other robot.
PLAIN = RobotProfile(
    name='', namespace='/', velocity_topic='', odometry_topic=None, manual_control_service=None,
    manual_control_timeout=math.inf, command_timeout=math.inf, limits=Limits(math.inf, math.inf))


class RobotFileError(FileError, UsageError):
    """A robot profile cannot be read from a file."""


def robots() -> list[str]:
    """Return the names of the robots whose profiles come with the package, sorted by name."""
    from kachaka_simple_control.files.yaml_document import names_in
    return sorted([KACHAKA.name, *names_in('robots')])


def find_robot(name_or_path: str | os.PathLike[str]) -> RobotProfile:
    """
    Read a robot profile by the name of the robot or by the path of the profile file.

    Only the robots whose profiles come with the package can be given by name.

    :param name_or_path: a text without dots and slashes is a name; any other value is a path
    :raises RobotFileError: if there is no such robot, or the file cannot be read
    """
    if name_or_path == KACHAKA.name:
        return KACHAKA
    # Import here: these modules load slowly, and the lesson does not need them.
    from kachaka_simple_control.files.yaml_document import look_up
    with RobotFileError.naming(os.fspath(name_or_path)):
        source, text = look_up(name_or_path, 'robots', robots())
    with RobotFileError.naming(source):
        return _read(text, source)


def calibrated_text(robot: str, calibration: Calibration | OdometryCalibration) -> str:
    """
    Add a calibration to a robot profile, and return the new text of the profile file.

    The file is not written.  The other keys in the text do not change.  If the robot is given by
    name, the text is a new profile that extends the robot's profile.

    :param calibration: the calibration to add; an earlier calibration of the same type is replaced
    :raises RobotFileError: if the profile cannot be read, or the calibration cannot be added
    """
    from kachaka_simple_control.files.yaml_document import read_text
    key = 'calibration' if isinstance(calibration, Calibration) else 'odometry_calibration'
    if is_path(robot):
        with RobotFileError.naming(robot):
            lines = _without(key, read_text(robot).splitlines())
    else:
        lines = [f'extends: {robot}']
    lines.append(f'{key}:')
    for name, value in asdict(calibration).items():
        unit = {'veer': ' rad/m', 'delay': ' s', 'track': ' m'}.get(name, '')
        if value not in (None, ''):
            # A quoted JSON text is also a valid YAML text.
            text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else value
            lines.append(f'  {name}: {text}{unit}')
    text = '\n'.join(lines) + '\n'
    try:
        _read(text, robot)
    except UnreadableFileError:
        raise RobotFileError(robot, [Problem(
            f'{key} cannot be added below it: write each of its keys on a line of its own')],
        ) from None
    return text


def _without(key: str, lines: list[str]) -> list[str]:
    """Remove a key and the lines nested below it from a YAML text; return the other lines."""
    start = next((number for number, line in enumerate(lines)
                  if re.match(f'["\']?{key}["\']?\\s*:', line)), None)
    if start is None:
        return lines
    # The next key starts at the line start; a comment or a closing brace may be there too.
    end = next((number for number in range(start + 1, len(lines))
                if re.match('[^\\s#}]', lines[number])), len(lines))
    # Comments directly before the next key belong to the next key.
    while re.match('#|$', lines[end - 1]) and end > start + 1:
        end -= 1
    return lines[:start] + lines[end:]


def _read(text: str, source: str) -> RobotProfile:
    from kachaka_simple_control.files.yaml_document import read_document
    document = read_document(text, read_schema(SCHEMA))
    data = document.root.data if isinstance(document.root.data, dict) else {}
    base = _base(document, data)
    numbers = document.read_quantities([], {'command_timeout': COMMAND_TIMEOUT})
    if (hold := numbers.get('command_timeout', math.inf)) < MIN_COMMAND_TIMEOUT:
        document.add_problem(['command_timeout'], (
            f'{hold:g} s is too short: a velocity may be late by 0.1 s before the run ends; '
            f'it must be at least {MIN_COMMAND_TIMEOUT:g} s'))
    timeout = document.read_quantities(['manual_control'], {'timeout': COMMAND_TIMEOUT})
    values: dict[str, Any] = {
        key: _part(document, key, quantities, make) for key, quantities, make in PARTS
        if key in data}
    if document.problems or base is None:
        raise UnreadableFileError(*document.problems)
    values.update({name: data[name] for name in UNCHANGED if name in data}, **numbers)
    if 'manual_control' in data:
        values['manual_control_service'] = (data['manual_control'] or {}).get('service')
        values['manual_control_timeout'] = timeout.get('timeout', math.inf)
    profile = replace(base, **{'name': PurePath(source).stem, **values})
    for key in ('calibration', 'odometry_calibration'):
        # Check one after the other, to find which calibration leaves no limits for plans.
        least = replace(profile, odometry_calibration=None) if key == 'calibration' else profile
        try:
            least.planning_limits  # noqa: B018
        except InvalidMotionError as error:
            document.add_error([key], error)
            raise UnreadableFileError(*document.problems) from None
    return profile


def _base(document: Document, data: dict[str, Any]) -> RobotProfile | None:
    """
    Return the profile that provides the default values for a profile file.

    The key ``extends`` in the file names another robot.  The profile of that robot is returned.
    If the name is invalid, a problem is recorded and None is returned.

    If the file has no key ``extends``, the profile ``PLAIN`` is returned.  This profile has no
    values, so the file must have all required keys.  For each missing key, a problem is recorded.
    """
    name = data.get('extends')
    if name is None:
        # The schema cannot express that these keys may be missing if ``extends`` is given.
        for key in REQUIRED:
            if key not in data:
                document.add_problem([], missing(key, read_schema(SCHEMA)))
        return PLAIN
    if document.root.at(['extends']).has_problem:
        return None
    if name not in robots():
        document.add_problem(
            ['extends'], f'there is no robot {quoted(name)}; {did_you_mean(name, robots())}')
        return None
    return find_robot(name)


def _part(
        document: Document, key: str, quantities: Mapping[str, Quantity],
        make: Callable[..., object]) -> object | None:
    """
    Make an object, for example a ``Limits``, from a mapping in the file; return the object.

    If the mapping is null or invalid, return None.  If it is invalid, also record a problem.
    """
    node = document.root.at([key])
    numbers = document.read_quantities([key], quantities)
    if node.has_problem or node.data is None:
        return None
    try:
        return make(**{**node.data, **numbers})
    except InvalidMotionError as error:
        document.add_error([key], error)
        return None


def _footprint(**sizes: float) -> Footprint:
    if set(sizes) == {'radius'}:
        return Disc(**sizes)
    if set(sizes) - {'ahead'} == {'length', 'width'}:
        return Box(**sizes)
    raise InvalidMotionError('it must be length and width, or radius alone')


def _laser(**values: Any) -> Laser:
    laser = Laser(**values)
    if not 0.0 < laser.view <= math.tau:
        raise InvalidMotionError(
            f'{math.degrees(laser.view):.6g} deg; it must be above 0 deg, and at most 360 deg',
            name='view')
    return laser


#: The mappings in a file that become objects: the key, the quantities of its values, and the
#: function that makes the object.
PARTS: tuple[tuple[str, Mapping[str, Quantity], Callable[..., object]], ...] = (
    ('limits', LIMIT_QUANTITIES, Limits),
    ('calibration', {'veer': VEER, 'delay': TIME}, Calibration),
    ('odometry_calibration', {'track': SIZE}, OdometryCalibration),
    ('footprint', {'length': SIZE, 'width': SIZE, 'ahead': LENGTH, 'radius': SIZE}, _footprint),
    ('laser', {'ahead': LENGTH, 'left': LENGTH, 'yaw': ANGLE, 'margin': TOLERANCE, 'view': ANGLE},
     _laser))
