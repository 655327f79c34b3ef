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
"""The start: a robot that is late, incomplete, there twice or missing; invalid parameters."""

import sys
import time

from optional_libraries import MISSING, optional_imports
from program import COMMAND, JsonProcess, program, QUICK_COMMAND
import pytest

Duration = DurabilityPolicy = LivelinessPolicy = Twist = TwistStamped = MISSING
with optional_imports():
    from geometry_msgs.msg import Twist, TwistStamped
    from listener import Listener
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

VELOCITY = '/kachaka/manual_control/cmd_vel'
ODOMETRY = '/kachaka/odometry/odometry'
ENABLED = '/kachaka/manual_control/set_enabled'


def with_parameters(*parameters):
    """Return the command with some parameters set."""
    return [*QUICK_COMMAND,
            *(part for parameter in parameters for part in ('-p', parameter))]


def test_without_a_robot_it_says_so_and_ends_with_3(tmp_path):
    with program(with_parameters('robot_timeout:=0.5'), tmp_path) as started:
        assert started.end() == 3
        last = started.text.splitlines()[-1]
    assert 'no robot listens on /kachaka/manual_control/cmd_vel (ROS domain ' in last
    assert 'after 0.5 s: nobody subscribes to it' in last
    assert '--sim' in last
    assert 'Traceback' not in started.text


def test_a_robot_that_comes_late_gets_the_first_movement_whole(tmp_path):
    with program(QUICK_COMMAND, tmp_path) as started:
        started.wait_for_text('Robot control node has started')
        time.sleep(1.0)
        with Listener() as listener:
            listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
            first = listener.moves()[0]
    assert (first.linear_x, first.count) == (0.1, 10)
    assert first.duration == pytest.approx(1.0, rel=0.03)


def test_a_subscriber_is_not_a_robot(tmp_path):
    """``ros2 topic echo`` subscribes too; nothing may be sent before there is a robot."""
    with Listener(serves=False) as listener:
        with program(with_parameters('robot_timeout:=3'), tmp_path) as started:
            assert started.end() == 3
        assert 'not the service /kachaka/manual_control/set_enabled' in started.text
        assert listener.received == []


#: A robot of which only cmd_vel is there.
PLAIN = {'namespace': '', 'serves': False}
DRIVE = 'name: ahead\nsteps: [move: {linear_x: 0.1, angular_z: 0, duration: 0.5 s}]\n'


def drive(folder, robot, *parameters):
    """Return a command that drives a robot for half a second."""
    (folder / 'ahead.yaml').write_text(DRIVE)
    return [*COMMAND, str(folder / 'ahead.yaml'), '--robot', str(robot), '--ros-args',
            *(word for one in ('prime_time:=0.2', *parameters) for word in ('-p', one))]


@pytest.mark.parametrize('taken', ['Twist', 'TwistStamped'])
def test_a_robot_of_which_only_cmd_vel_is_there_is_driven(tmp_path, taken):
    types = {'Twist': Twist, 'TwistStamped': TwistStamped}
    with Listener(**PLAIN, topic=('cmd_vel', types[taken])) as listener:
        with program(drive(tmp_path, 'generic'), tmp_path) as started:
            assert started.end() == 0
        assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 5)]
        assert not listener.received[-1].moves
    assert f'Sending {taken} on /cmd_vel, as its subscriber takes' in started.text
    assert started.text.count('no stop can be confirmed') == 1


def test_the_turtle_of_turtlesim_is_driven_and_stopped(tmp_path):
    """A node with its topic, type and queue; it keeps a velocity for 1 s, and has no odometry."""
    quality = QoSProfile(depth=7)
    with Listener('turtle1', serves=False, topic=('cmd_vel', Twist), quality=quality) as listener:
        with program(drive(tmp_path, 'turtlesim'), tmp_path) as started:
            assert started.end() == 0
        zeros = [one.time for one in listener.received[-20:] if not one.moves]
        assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 5)]
    assert zeros[-1] - zeros[0] >= 0.5  # until the turtle would have stopped by itself


def test_a_robot_whose_profile_names_odometry_is_not_driven_without(tmp_path):
    profile = tmp_path / 'own.yaml'
    profile.write_text('extends: generic\nmessage_type: Twist\nodometry_required: true\n')
    with Listener(**PLAIN, topic=('cmd_vel', Twist)) as listener:
        with program(drive(tmp_path, profile, 'robot_timeout:=3'), tmp_path) as started:
            assert started.end() == 3
        assert listener.received == []
    assert 'nobody publishes /odom; for a robot without odometry write ' in started.text


def test_a_profile_with_the_wrong_type_of_message_is_told_which_key(tmp_path):
    profile = tmp_path / 'own.yaml'
    profile.write_text('extends: generic\nmessage_type: Twist\n')
    command = drive(tmp_path, profile, 'robot_timeout:=3')
    with Listener(**PLAIN, topic=('cmd_vel', TwistStamped)), program(command, tmp_path) as started:
        assert started.end() == 3
    assert 'not Twist: write `message_type: TwistStamped` in the profile' in started.text


def test_two_robots_under_one_name_are_refused(tmp_path):
    """Both would move: the wrong one, perhaps a real one beside a simulated one, as well."""
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    from nav_msgs.msg import Odometry
    with Listener() as one, Listener() as two:
        for listener in (one, two):
            listener._node.create_publisher(Odometry, 'odometry/odometry', 10)
        with program(with_parameters('robot_timeout:=6'), tmp_path) as started:
            # 1 where discovery finds the second one when the first has been met already.
            assert started.end() in (3, 1)
        assert '2 robots publish /kachaka/odometry/odometry' in started.text
        assert not [velocity for velocity in one.received + two.received if velocity.moves]


def test_a_robot_under_the_same_name_is_left_alone_by_a_simulated_drive(tmp_path):
    """It may be a real one: then it would leave its dock, and drive beside the simulated one."""
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    from ros_support import bridge
    from waiting import wait_until
    # The robot of the drive is refused as it starts, which may take seconds on a slow machine.
    command = [*COMMAND, '--sim', *QUICK_COMMAND[len(COMMAND):], '-p', 'robot_timeout:=20']
    with bridge() as other:
        assert wait_until(lambda: 'ready: ' in other.text)
        with program(command, tmp_path) as started:
            assert started.end() == 3
        assert 'shows a robot on /kachaka/manual_control/cmd_vel' in started.text
        assert 'leave out --sim' in started.text
        assert '--namespace' not in started.text, 'an option of another command'
        assert 'manual control enabled' not in started.text
        assert 'manual control enabled' not in other.text


def test_nothing_is_sent_before_manual_control_was_granted(tmp_path):
    with Listener(delay=0.7) as listener, program(QUICK_COMMAND, tmp_path) as started:
        listener.wait_for(bool)
        assert listener.enabled[0] < listener.received[0].time
        assert started.process.poll() is None


def test_a_robot_that_refuses_manual_control_is_not_driven(tmp_path):
    with Listener(grants=False) as listener:
        with program(QUICK_COMMAND, tmp_path) as started:
            assert started.end() == 3
        assert 'the robot refused manual control: not today' in started.text
        assert listener.received == []


#: Imports once, and runs the command with each list of arguments in a child of its own.
SERVER = """
import json, os, sys
from kachaka_simple_control.commands.drive_or_preview import main
import kachaka_simple_control.kachaka_simple_control
for line in sys.stdin:
    reader, writer = os.pipe()
    if os.fork() == 0:
        os.dup2(writer, 1)
        os.dup2(writer, 2)
        try:
            code = main(json.loads(line))
        except SystemExit as ended:
            code = ended.code
        sys.stdout.flush()
        os._exit(code)
    os.close(writer)
    with os.fdopen(reader) as printed:
        text = printed.read()
    print(json.dumps([os.waitstatus_to_exitcode(os.wait()[1]), text]), flush=True)
"""


@pytest.fixture(scope='module')
def run():
    """Return what runs the command with ROS arguments: its exit code, and what it printed."""
    with JsonProcess([sys.executable, '-c', SERVER]) as server:
        def run(*arguments):
            server.write(['--ros-args', *arguments])
            return server.read()
        yield run


@pytest.mark.parametrize('parameter, text', [
    ('rate:=4', 'rate is 4 Hz; for kachaka it must be from 5 to 1000 Hz'),
    ('rate:=fast', "parameter rate is 'fast'; it must be a number"),
    ('robot_timeout:=-1', 'parameter robot_timeout is -1 s; it must be from 0.1 to 3600 s'),
    ('robot_timeout:=.nan', 'parameter robot_timeout is nan s; it must be from 0.1 to 3600 s'),
    ('odometry_timeout:=-1.0', 'parameter odometry_timeout is -1 s; it must be from 0 to 60 s'),
    ('pause_timeout:=0.5', 'parameter pause_timeout is 0.5 s; it must be from 1 to 86400 s'),
    ('speed_factor:=-1.0', 'parameter speed_factor is -1; it must be from 0.01 to 1'),
    ('speed_factor:=.nan', 'parameter speed_factor is nan; it must be from 0.01 to 1'),
    ('robot_timeout:=1,5', "robot_timeout is '1,5'; write '1.5', with a point"),
    ('robot_timeout:=2s', "robot_timeout is '2s'; write '2', without its unit"),
    ("rate:='20'", "rate is '20'; it is a text in quotes: leave the quotes out"),
    ('manual_control:=7', 'manual_control'),
    ('rte:=20', 'there is no parameter rte; did you mean rate?'),
    ('colour:=red', 'there is no parameter colour: robot, robot_namespace, rate, '),
])
def test_a_parameter_that_cannot_work_is_refused_in_one_line(run, parameter, text):
    code, printed = run('-p', parameter)
    assert (code, len(printed.splitlines())) == (2, 1)
    assert text in printed


def test_arguments_that_ros_does_not_understand_are_bad_usage(run):
    assert run('-p', 'nonsense') == [2, (
        "kachaka_simple_control: ROS cannot read the parameter override rule '-p nonsense': "
        'write -p NAME:=VALUE, with a value as in YAML\n')]


LONG = 'a' * 230


@pytest.mark.parametrize('arguments, text', [
    (('-p', 'robot_namespace:=a b'), "robot_namespace is '/a b'; a namespace begins with"),
    (('-p', f'robot_namespace:=/{LONG}'), 'which has 231 characters; it may have 220'),
    (('-r', '__ns:=/a b'), "the namespace in -r __ns:= is '/a b'"),
    (('-r', f'__ns:=/{LONG}'), 'characters; ROS takes 247 at most'),
    (('-r', f'{VELOCITY}:=/{"a" * 3000}'), 'has 3001 characters; ROS takes 247 at most'),
    (('-r', f'/rosout:={VELOCITY}'), f'/rosout is remapped to {VELOCITY}, which moves the robot'),
    (('-r', f'/diagnostics:={ODOMETRY}'), f"remapped to {ODOMETRY}, the robot's odometry"),
    (('-r', f'~/stop:={ENABLED}'), f"remapped to {ENABLED}, the robot's manual control"),
    (('-r', f'{VELOCITY}:={ODOMETRY}'), f'{VELOCITY} is remapped to {ODOMETRY}'),
    (('-r', 'nonsense'), "'nonsense' is no remap rule: write -r FROM:=TO"),
    (('--nonsense',), "ROS does not know '--nonsense' among its arguments"),
    (('--log-level', 'loud'), 'levels are debug, info, warn, error and fatal'),
    (('-p', f'qos_overrides.{ODOMETRY}.subscription.depth:=-1'),
     'depth is -1; it must be from 1 to 100000'),
    (('-p', f'qos_overrides.{ODOMETRY}.subscription.depth:=0'), 'must be from 1 to 100000'),
    (('-p', 'use_sim_time:=7'), "'use_sim_time' to '7'"),
])
def test_names_and_qualities_that_cannot_work_are_refused_in_one_line(run, arguments, text):
    """Before there is a node: nothing that ROS itself prints comes out, and nothing is sent."""
    code, printed = run(*arguments)
    assert code == 2
    (line,) = printed.splitlines()
    assert line.startswith('kachaka_simple_control: ')
    assert text in line
    assert len(line) < 400


@pytest.mark.parametrize('name, value, text', [
    ('ROS_DOMAIN_ID', 'abc', 'it must be a whole number from 0 to 232'),
    ('ROS_DOMAIN_ID', '-1', 'it must be a whole number from 0 to 232'),
    ('ROS_DOMAIN_ID', '300', 'it must be a whole number from 0 to 232'),
    ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'near', 'one of SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT'),
    ('RCUTILS_COLORIZED_OUTPUT', '7', 'it must be one of 0, 1'),
])
def test_an_environment_that_ros_cannot_use_is_refused_in_one_line(
        tmp_path, monkeypatch, name, value, text):
    monkeypatch.setenv(name, value)
    with program(QUICK_COMMAND, tmp_path) as started:
        assert started.end() == 2
        (line,) = started.text.splitlines()
    assert line.startswith(f'kachaka_simple_control: {name} is {value!r}; ')
    assert text in line


@pytest.mark.parametrize('policies, text', [
    ({'durability': DurabilityPolicy.TRANSIENT_LOCAL},
     'durability (it asks for transient_local, and volatile is offered); change'),
    ({'deadline': Duration(nanoseconds=100_000_000)},
     'deadline (it asks for 0.1 s, and none is offered); change'),
    ({'liveliness': LivelinessPolicy.MANUAL_BY_TOPIC},
     'liveliness (it asks for manual_by_topic, and automatic is offered); change'),
])
def test_a_quality_of_service_that_does_not_fit_is_named(tmp_path, policies, text):
    command = with_parameters('robot_timeout:=3')
    with Listener(quality=QoSProfile(depth=10, **policies)), program(command, tmp_path) as started:
        assert started.end() == 3
    assert (f'a subscriber is there (node listener), but its quality of service does not fit: '
            f'{text}') in started.text
