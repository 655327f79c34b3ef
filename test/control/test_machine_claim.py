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
"""One program on a machine holds a claim: by real processes and the kernel."""

import contextlib
from functools import partial
import os
import signal
import subprocess
import sys
import time
import uuid

from kachaka_simple_control.control.claims import ClaimedError, MachineClaim
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.process.processes import is_stopped
from program import environment
import pytest
from waiting import wait_until

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith('linux'), reason='abstract sockets are those of Linux')

#: Prints whether it got the claim, and keeps it until its standard input ends.
HOLDER = """
import sys
from kachaka_simple_control.control.claims import ClaimedError, MachineClaim
from kachaka_simple_control.control.preparation import complete
claim = MachineClaim()
sys.stdin.readline()
try:
    complete([lambda moment: claim.take(moment, sys.argv[1], f'holder {sys.argv[2]}')])
except ClaimedError as error:
    print(f'refused: {error}', flush=True)
else:
    print('taken', flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def name():
    """Return a name that no other program claims."""
    return f'driver 7 /{uuid.uuid4().hex}/cmd_vel'


@contextlib.contextmanager
def holders(name, count):
    """Start programs that wait for a line, and end them."""
    processes = [
        subprocess.Popen(
            [sys.executable, '-c', HOLDER, name, str(number)], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, text=True, env=environment()) for number in range(count)]
    try:
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.wait()
            process.stdin.close()
            process.stdout.close()


def go(process):
    """Let a program take the claim."""
    process.stdin.write('\n')
    process.stdin.flush()


def take(claim, name, who):
    """Take a claim."""
    complete([partial(claim.take, name=name, who=who)])


def refused(name):
    """Return the message of a claim that is refused."""
    claim = MachineClaim()
    try:
        with pytest.raises(ClaimedError) as caught:
            take(claim, name, 'newcomer')
        return str(caught.value)
    finally:
        claim.release()


def take_and_release(name):
    """Take the claim, which must be free, and release it."""
    claim = MachineClaim()
    take(claim, name, 'newcomer')
    claim.release()


@pytest.mark.parametrize('trial', range(5))
def test_of_three_at_the_same_moment_one_wins(name, trial):
    with holders(name, 3) as processes:
        for process in processes:
            go(process)
        answers = [process.stdout.readline().strip() for process in processes]
    assert answers.count('taken') == 1
    winner = answers.index('taken')
    assert [line for line in answers if line != 'taken'] == [f'refused: holder {winner}'] * 2


def test_a_program_that_is_frozen_keeps_it(name):
    with holders(name, 1) as (holder,):
        go(holder)
        assert holder.stdout.readline() == 'taken\n'
        holder.send_signal(signal.SIGSTOP)
        assert wait_until(lambda: is_stopped(holder.pid))
        assert refused(name) == f'process {holder.pid}, which does not answer'
        holder.send_signal(signal.SIGCONT)


def test_a_process_that_inherited_it_keeps_it_after_its_parent_released_it(name):
    """As a guardian does, until it has stopped the robot; a newcomer waits for that."""
    first = MachineClaim()
    take(first, name, 'first')
    with subprocess.Popen(
            [sys.executable, '-c', 'import sys; sys.stdin.read()'], stdin=subprocess.PIPE,
            pass_fds=[first.fileno()]) as guardian:
        first.release()
        begun = time.monotonic()
        pid = os.fork()
        if pid == 0:
            time.sleep(0.5)
            guardian.stdin.close()
            os._exit(0)
        guardian.stdin.close()
        take_and_release(name)
        os.waitpid(pid, 0)
    assert 0.3 < time.monotonic() - begun < 2.5


def test_a_child_that_was_forked_does_not_keep_it(name):
    claim = MachineClaim()
    take(claim, name, 'parent')
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(writer)
        os.read(reader, 1)
        os._exit(0)
    claim.release()
    assert wait_until(lambda: _is_free(name), 2.0)
    os.close(writer)
    os.close(reader)
    os.waitpid(pid, 0)


def _is_free(name):
    try:
        take_and_release(name)
    except ClaimedError:
        return False
    return True


def test_taking_it_twice_is_harmless_and_another_object_is_refused(name):
    claim = MachineClaim()
    take(claim, name, 'one')
    take(claim, name, 'one')
    assert refused(name) == 'one'
    claim.release()
