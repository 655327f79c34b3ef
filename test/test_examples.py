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
"""The examples do what they say."""

from __future__ import annotations

import re
import signal

from program import COMMAND, QUICK_COMMAND, ROOT
from program import script as user_script
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

needs_source = pytest.mark.skipif(
    not (ROOT / '.ci').is_dir(), reason='the whole source is not here')


@pytest.fixture
def example(tmp_path):
    """Return what starts an example."""
    def start(name: str, *parameters: str):
        quick = QUICK_COMMAND[len(COMMAND):]
        text = ROOT.joinpath('examples', name).read_text()
        return user_script(text, tmp_path, *quick, *parameters)
    return start


@needs_source
def test_forward_drives_forward(example, listener):
    with example('forward.py') as started:
        assert started.end() == 0, started.text
    held = listener.moves()
    assert [(held[0].linear_x, held[0].angular_z)] == [(h.linear_x, h.angular_z) for h in held]
    # On a loaded machine a velocity may be sent 10 ms late.
    assert held[0].linear_x * held[0].duration == pytest.approx(0.1, rel=0.05)
    assert len(listener.released) == 1


@needs_source
def test_square_is_a_square(example, listener):
    with example('square.py') as started:
        assert started.end() == 0, started.text
    held = listener.moves()
    assert [h.linear_x * h.duration for h in held] == pytest.approx(
        [0.2, 0.0] * 4, rel=0.02, abs=1e-9)
    assert sum(h.angular_z * h.duration for h in held) == pytest.approx(6.283, rel=0.02)


@needs_source
def test_square_says_when_there_is_no_robot(example):
    with example('square.py', '-p', 'robot_timeout:=1.0') as started:
        assert started.end() == 3
    assert re.search(r'\.py:\d+: no robot listens on ', started.text)
    assert 'Traceback' not in started.text


@needs_source
def test_nod_on_request_nods_and_stops_on_ctrl_c(example, listener):
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from std_srvs.srv import Trigger
    context = Context()
    context.init(args=[])
    node = Node('somebody', context=context)
    client = node.create_client(Trigger, '/kachaka_simple_control/nod')
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def nod():
        assert client.wait_for_service(20.0)
        future = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(future, 20.0)
        return future.result()

    try:
        with example('nod_on_request.py') as started:
            assert nod().success
            assert nod().message == 'nodding already'
            listener.wait_for(lambda velocity: velocity.angular_z < 0.0)
            before = started.send(signal.SIGINT)
            assert started.end() == 130, started.text
            assert 'Traceback' not in started.text
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    assert [h.angular_z for h in listener.moves()] == [0.5, -0.5]
    assert not any(velocity.moves for velocity in listener.received
                   if velocity.time > before + 0.1)
