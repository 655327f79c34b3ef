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
"""Which transports and addresses ROS 2 traffic uses."""

import contextlib
import json
import socket
import subprocess
import sys
from xml.etree import ElementTree as ET

from benchmarks.stop_matrix import network
from kachaka_simple_control.ros import dds_transport
from program import COMMAND
import pytest
from ros_domain import claim_domain
from ros_support import free_environment

pytestmark = [pytest.mark.ros, pytest.mark.distro]

#: Creates a node, and prints its threads and the addresses that it receives at.
INSPECT = """
import json, pathlib, sys, time
from kachaka_simple_control.ros.dds_transport import use_udp_transport, use_localhost_only
{call}()
import rclpy
rclpy.init()
node = rclpy.create_node('inspected')
time.sleep(0.5)
threads = [task.read_text().strip() for task in pathlib.Path('/proc/self/task').glob('*/comm')]
mine = set()
for link in pathlib.Path('/proc/self/fd').iterdir():
    try:
        mine.add(str(link.readlink()))
    except OSError:
        pass
sockets = [line.split() for line in open('/proc/net/udp').readlines()[1:]]
print(json.dumps([threads, [s[1] for s in sockets if 'socket:[%s]' % s[9] in mine]]))
"""
#: Other programs: a robot, which only subscribes, and many nodes, each with its own participant.
ROBOT = """
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node('robot')
node.create_subscription(Twist, '/robot', lambda message: None, 10)
print(flush=True)
rclpy.spin(node)
"""
CROWD = """
import os
os.nice(19)  # other tests keep time meanwhile
import rclpy, sys
nodes = []
for number in range(40):
    context = rclpy.Context()
    context.init(args=[])
    nodes.append(rclpy.create_node(f'node_{number}', context=context))
print(flush=True)
sys.stdin.read()
"""
#: Who matches so soon did not wait for the next announcement [s].
QUICK = 1.5
#: Publishers of ours, one after the other until one but the first is quick, and how long [s] each
#: took to match the robot.
PUBLISHERS = """
import json, sys, time
from kachaka_simple_control.ros.dds_transport import use_localhost_only
use_localhost_only()
import rclpy
from geometry_msgs.msg import Twist
took = []
for _ in range(int(sys.argv[1])):
    began = time.monotonic()
    context = rclpy.Context()
    context.init(args=[])
    node = rclpy.create_node('publisher', context=context)
    publisher = node.create_publisher(Twist, '/robot', 10)
    while not publisher.get_subscription_count() and time.monotonic() < began + 15:
        time.sleep(0.01)
    took.append(time.monotonic() - began)
    if len(took) > 1 and took[-1] < float(sys.argv[2]):
        break
    node.destroy_node()
    context.shutdown()
print(json.dumps(took))
"""
#: 127.0.0.1, and 239.255.0.1 where all announcements are received; as the kernel writes them.
LOOPBACK, ANNOUNCEMENTS = '0100007F', '0100FFEF'


def needs_fast_dds():
    """Skip where another middleware is used, or Humble's, which knows nothing of this."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    if (dds_transport._fast_dds() or dds_transport.HUMBLE) == dds_transport.HUMBLE:
        pytest.skip('needs Fast DDS 2.14 or later')


def inspect(call, **chosen):
    """Return the threads of DDS and the addresses of a program that calls a function."""
    needs_fast_dds()
    result = subprocess.run(
        [sys.executable, '-c', INSPECT.format(call=call)],
        env=free_environment(**chosen), timeout=60, capture_output=True, check=True, text=True)
    threads, addresses = json.loads(result.stdout)
    assert 'deprecated' not in result.stderr
    # Fast DDS takes the whole profile.
    assert 'XMLPARSER' not in result.stderr
    return ({name.split('.')[1] for name in threads if name.startswith('dds.')},
            {address.split(':')[0] for address in addresses})


@pytest.mark.parametrize('chosen', [{}, {dds_transport.RANGE: 'LOCALHOST'}])
@pytest.mark.parametrize('call', ['use_udp_transport', 'use_localhost_only'])
def test_no_shared_memory_is_used(call, chosen):
    """A program that was killed leaves its part of it locked, and others wait."""
    threads, _ = inspect(call, **chosen)
    assert 'udp' in threads
    assert 'shm' not in threads


@pytest.mark.parametrize('init, threads', [('rclpy.init()', 1), ('', 0)])
def test_shared_memory_that_can_no_longer_be_left_out_is_said(init, threads):
    """As where a script calls ``rclpy.init`` itself, which reads the range."""
    needs_fast_dds()
    script = f"""
import rclpy, pathlib
{init}
from kachaka_simple_control import KachakaSimpleControl
node = KachakaSimpleControl({{'guardian': False}})
names = [file.read_text().strip() for file in pathlib.Path('/proc/self/task').glob('*/comm')]
print(sum(name.startswith('dds.shm') for name in names))
node.destroy_node()
"""
    result = subprocess.run(
        [sys.executable, '-c', script], env=free_environment(**{dds_transport.RANGE: 'LOCALHOST'}),
        timeout=60, capture_output=True, check=True, text=True)
    assert bool(int(result.stdout.split()[-1])) == bool(threads)
    assert result.stderr.count('DDS uses shared memory') == threads


@pytest.mark.parametrize('profile', [dds_transport.UDP, dds_transport.LOOPBACK])
def test_participants_of_one_process_discover_each_other_by_udp(profile):
    """Without the network, Fast DDS loses one in 300 for good: too few to try it here."""
    assert ET.parse(profile).findtext('.//{*}intraprocess_delivery') == 'USER_DATA_ONLY'


@pytest.mark.parametrize(('call', 'chosen'), [
    ('use_localhost_only', {}),
    ('use_localhost_only', {dds_transport.RANGE: 'LOCALHOST'}),
    ('use_udp_transport', {dds_transport.RANGE: 'LOCALHOST'})])
def test_localhost_only_sends_from_the_loopback_interface(call, chosen):
    """So it cannot answer other machines, whatever other programs of this one forward."""
    _, addresses = inspect(call, **chosen)
    assert addresses == {LOOPBACK, ANNOUNCEMENTS}


@pytest.mark.parametrize(('call', 'offset'), [
    ('use_udp_transport', 0), ('use_localhost_only', 0),
    # Where the 32nd participant of this machine listens, of those that ROS's range greets.
    ('use_localhost_only', 10 + 2 * 31)])
def test_a_participant_is_announced_for_seconds(call, offset):
    """By itself Fast DDS does so five times, and then every three seconds."""
    needs_fast_dds()
    domain, duration = claim_domain(), 4.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        receiver.bind(('', 7400 + 250 * domain + offset))  # by the DDS specification
        receiver.setsockopt(
            socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
            socket.inet_aton('239.255.0.1') + socket.inet_aton('127.0.0.1'))
        receiver.settimeout(0.2)
        with subprocess.Popen(
                [sys.executable, '-c', INSPECT.format(call=call).replace('0.5', str(duration))],
                stdout=subprocess.PIPE,
                env=free_environment(ROS_DOMAIN_ID=str(domain))) as program:
            announced = 0
            while program.poll() is None:
                with contextlib.suppress(TimeoutError):
                    announced += receiver.recv(65536).startswith(b'RTPS')
    assert announced > 20


@contextlib.contextmanager
def running(code):
    """Run another program with ROS's own range LOCALHOST, until the end of the block."""
    with subprocess.Popen(
            [sys.executable, '-c', code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env=free_environment(**{dds_transport.RANGE: 'LOCALHOST'})) as program:
        try:
            assert program.stdout.readline()
            yield
        finally:
            program.kill()


def matching_times(count):
    """Return how long [s] each of some publishers took to match the robot, in order."""
    result = subprocess.run(
        [sys.executable, '-c', PUBLISHERS, str(count), str(QUICK)],
        timeout=120, capture_output=True,
        env=free_environment(**{dds_transport.RANGE: 'LOCALHOST'}), check=True, text=True)
    return json.loads(result.stdout)


@pytest.mark.slow
def test_a_robot_with_the_range_localhost_is_matched_among_many_nodes():
    """It announces itself to the first 32 participants alone, and the newcomer is none of them."""
    needs_fast_dds()
    with running(ROBOT), running(CROWD):
        assert max(matching_times(1)) < 10.0  # as long as the command waits for a robot


@pytest.fixture
def cable():
    """Yield a cable to another machine, which listens where all announcements are made."""
    needs_fast_dds()
    if (reason := network.unavailable_reason()) is not None:
        pytest.skip(reason)
    listen = (
        'import socket, sys; group, own = map(socket.inet_aton, sys.argv[1:]); '
        'receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); '
        'receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + own); '
        'print(flush=True); sys.stdin.read()')
    with network.Network() as made:
        command = [sys.executable, '-c', listen, '239.255.0.1', network.ADDRESSES[network.ROBOT]]
        with subprocess.Popen(
                made.command(network.ROBOT, command), stdin=subprocess.PIPE,
                stdout=subprocess.PIPE) as other:
            other.stdout.readline()
            yield made
            other.stdin.close()


#: Scripts that start a simulated robot, before and after ROS is initialised.
SCRIPTS = {
    'script': """
from kachaka_simple_control import KachakaSimpleControl
KachakaSimpleControl(sim=True).move_robot(0.1, 0.0, 0.5)
""",
    'script after rclpy.init': """
import rclpy
rclpy.init()
from kachaka_simple_control import KachakaSimpleControl
KachakaSimpleControl(sim=True).move_robot(0.1, 0.0, 0.5)
"""}


@pytest.mark.parametrize('kind', ['command', *SCRIPTS])
def test_a_simulated_drive_sends_no_packet_off_this_machine(cable, tmp_path, kind):
    """Counted at the other end of a cable; without the isolation some arrive there."""
    motion = tmp_path / 'short.yaml'
    motion.write_text('name: short\nsteps:\n  - forward: 5 cm\n')
    script = tmp_path / 'script.py'
    script.write_text(SCRIPTS.get(kind, ''))
    command = ([*COMMAND, str(motion), '--sim'] if kind == 'command' else
               [sys.executable, str(script)])

    def arrived(**chosen):
        cable.set_loss(0)
        subprocess.run(
            cable.command(network.NODE, command),
            env=free_environment(**chosen), timeout=60, check=True, capture_output=True)
        return cable.arrived()

    assert arrived() == 0
    assert arrived(**{dds_transport.RANGE: 'SUBNET'}) > 0


def test_settings_of_the_user_are_kept():
    threads, _ = inspect('use_udp_transport', **{dds_transport.TRANSPORTS: 'DEFAULT'})
    assert 'shm' in threads
    for chosen in ({dds_transport.RANGE: 'SUBNET'}, {dds_transport.LOCALHOST_ONLY: '0'}):
        code = ('import os; from kachaka_simple_control.ros.dds_transport import *; '
                'use_localhost_only(); '
                f'print({{name: os.environ.get(name) for name in {dds_transport.CHOICES}}})')
        result = subprocess.run(
            [sys.executable, '-c', code], env=free_environment(**chosen), timeout=60,
            capture_output=True, check=True, text=True)
        assert result.stdout.count('None') == len(dds_transport.CHOICES) - 1


def test_tools_with_other_settings_receive_from_a_localhost_only_program():
    """As in another terminal: with ROS's own settings, or with its range LOCALHOST."""
    needs_fast_dds()
    publish = (
        'from kachaka_simple_control.ros.dds_transport import *; use_localhost_only(); '
        'import rclpy, time; from geometry_msgs.msg import Twist; rclpy.init(); '
        'publisher = rclpy.create_node("publisher").create_publisher(Twist, "/test", 10)\n'
        'while True: publisher.publish(Twist()); time.sleep(0.05)')
    subscribe = (
        'import rclpy; from geometry_msgs.msg import Twist; rclpy.init(); '
        'node = rclpy.create_node("subscriber"); received = []; '
        'node.create_subscription(Twist, "/test", received.append, 10)\n'
        'for _ in range(200):\n'
        '    if received: break\n'
        '    rclpy.spin_once(node, timeout_sec=0.1)\n'
        'print(len(received))')
    with subprocess.Popen([sys.executable, '-c', publish], env=free_environment()) as publisher:
        try:
            for chosen in ({}, {dds_transport.RANGE: 'LOCALHOST'}):
                result = subprocess.run(
                    [sys.executable, '-c', subscribe], env=free_environment(**chosen), timeout=60,
                    capture_output=True, check=True, text=True)
                assert int(result.stdout) >= 1
        finally:
            publisher.kill()


def test_on_humble_the_range_of_later_distros_is_no_choice(monkeypatch):
    for name in dds_transport.CHOICES:
        monkeypatch.setenv(name, '')  # so that it is restored
        monkeypatch.delenv(name)
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    monkeypatch.setenv(dds_transport.RANGE, 'LOCALHOST')
    assert not dds_transport.is_range_chosen()
    assert not dds_transport.is_localhost_only()
    dds_transport.use_localhost_only()
    assert dds_transport.is_range_chosen()
    assert dds_transport.is_localhost_only()
