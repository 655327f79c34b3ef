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
All periods and timeouts that are important for safety [s], each with its reason and source.

"Measured" means: in the benchmarks; see ``docs/safety.md`` and ``docs/benchmarks.md``.  "Maker"
means: from the public repository pf-robotics/kachaka-api.  "Chosen" means: by the authors of this
package.  The command timeout and the duration of manual control depend on the robot, and are in
``files/robot_profile.py``; SIGNAL_DEBOUNCE is in ``process/signals.py``.

Tested by test/control/test_robot_drive.py.
"""

# --- Sending velocities -----------------------------------------------------------------------

#: Longest time between two heartbeats and fault checks in the thread that drives.  A stop wakes
#: this thread at once.  Chosen: a quarter of HEARTBEAT_TIMEOUT.
CHECK_PERIOD = 0.025
#: If a velocity is sent later than one period plus this time after the one before, the drive ends.
#: Chosen: equal to HEARTBEAT_TIMEOUT, so that the node and the guardian have the same limit.
MAX_LATENESS = 0.1
#: Highest rate of velocities [Hz].  Chosen: no use for a higher rate is known.
MAX_RATE = 1000.0
#: How long DDS may take to accept one message, or to answer a graph query.  Measured: 0.33 s while
#: other nodes join.  The robot's command timeout still limits the gap between two velocities.
PUBLISH_TIMEOUT = 0.5

#: How long the first check of each robot for faults may take before t = 0 of a drive of several.
#: Chosen: twice as long as it takes.
FIRST_CHECK_TIME = 0.001

# --- Stop ---------------------------------------------------------------------------------------

#: Number of zero velocities that are sent without a pause at the start of a stop [messages].  It
#: equals the depth of the longest queue to the robot, the queue of the publisher (10).  So the
#: zero velocities push all other velocities out of this queue.
STOP_BURST_COUNT = 10
#: Period of the zero velocities after the first STOP_BURST_COUNT ones.  Chosen: 25 Hz, so that if
#: one message is lost, the next one comes well within the command timeout.
STOP_REPEAT_PERIOD = 0.04
#: A stop sends zero velocities for the robot's command timeout plus this time.  Chosen.
STOP_MARGIN = 0.1
#: How much longer zero velocities are sent while odometry shows motion.  Chosen: a program must
#: end at most 3 s after a signal, because ``ros2 launch`` sends a stronger signal after 5 s.
STOP_CONFIRM_TIMEOUT = 1.0
#: How much longer zero velocities are sent if the link is lost.  The kernel keeps messages for a
#: neighbour that does not answer, and drops them after three solicitations, 1 s apart
#: (``mcast_solicit`` and ``retrans_time_ms`` in ``/proc/sys/net/ipv4/neigh``).  So no velocity is
#: left there when the publisher leaves.
STOP_LOST_LINK_TIME = 3.0
#: How long a stop waits, when it is complete, for the thread that has driven.  Chosen: that takes
#: a POLL_PERIOD.
DRIVE_END_TIMEOUT = 0.5
#: A robot counts as standing still if odometry shows a lower velocity than this [m/s], [rad/s].
#: Chosen: above the noise of wheel encoders.
STANDSTILL_LINEAR = 0.01
STANDSTILL_ANGULAR = 0.02
#: Odometry older than this does not show the current motion.  Chosen: longer than ten samples of a
#: Kachaka take.
ODOMETRY_MAX_AGE = 0.3

# --- Guardian -----------------------------------------------------------------------------------

#: If no heartbeat comes for this time in a drive, the guardian stops the robot.  Chosen: four
#: times CHECK_PERIOD.  The guardian sends the first zero velocity less than 0.15 s after SIGSTOP
#: has frozen the node (measured: 0.102 s).
HEARTBEAT_TIMEOUT = 0.1
#: How long the node may be silent after a drive, from the zero velocity at its end to the last
#: zero velocity of the stop.  Longer than HEARTBEAT_TIMEOUT, because the node waits up to 0.2 s
#: for a next movement, and a DDS call may take PUBLISH_TIMEOUT.  The robot has already received a
#: zero velocity.
STOPPING_TIMEOUT = 1.0
#: How long after a heartbeat the guardian checks for newer ones.  Chosen: two more heartbeats are
#: due by then, so one wake-up of the guardian sees both.  If the check is late, the excess does
#: not count: the guardian or the whole machine was held up.  So after a pause of the machine the
#: node has at least HEARTBEAT_TIMEOUT minus this time for its next heartbeat.
FIRST_CHECK_DELAY = 0.055
#: How often the guardian checks again if there was no newer heartbeat; also here the excess does
#: not count.  Chosen.
WATCHDOG_PERIOD = 0.02
#: If the guardian has processed no heartbeat for this time while the node ran, it is frozen and
#: the drive ends.  Equal to PUBLISH_TIMEOUT: a DDS call of the guardian may also take this time.
GUARDIAN_TIMEOUT = 0.5
#: How long the guardian may take to publish a zero velocity on request before a drive.  Chosen.
GUARDIAN_PRIME_TIMEOUT = 1.0
#: How long the guardian may take to end by itself before it is killed.  Chosen.
GUARDIAN_EXIT_TIMEOUT = 1.0
#: How much longer the guardian may take to leave a robot if it still starts, and other robots need
#: it.  Chosen: on a busy machine it starts late.
GUARDIAN_START_TIMEOUT = 5.0
#: How long the guardian waits for a subscriber before it joins the graph with a new participant,
#: for each attempt.  Measured: every second to fourth participant of Fast DDS is discovered up to
#: 3 s late, and the others within 0.1 s.
DISCOVERY_RETRY_TIMEOUTS = (0.15, 0.2, 0.4, 0.8, 0.8)

# --- End of a command ----------------------------------------------------------------------------

#: How long a command may take to release the robot and to leave the ROS graph, before the process
#: is ended, without the zero velocities of a stop.  Chosen: longer than all timeouts of this phase
#: together.  Seen once: a command that had driven nothing hung after Ctrl+C for more than 30 s;
#: then in none of 400 trials.
SHUTDOWN_TIMEOUT = 15.0

# --- Pause ---------------------------------------------------------------------------------------

#: How long the robot must stand still before its pose is used as the pose of the pause.  Chosen:
#: longer than dead time and lag of a slow robot.
REST_SETTLE_TIME = 0.5
#: If somebody moved the robot more than this during a pause [m], [rad], the rest of the plan would
#: end at another place.  Chosen: above the noise of odometry.
MAX_MOVED_DISTANCE = 0.02
MAX_MOVED_ANGLE = 0.035
#: After a resume was refused, a second request within this time resumes the motion.  Chosen.
RESUME_CONFIRM_TIMEOUT = 10.0
#: This second request counts only if no other request came for this time before it.  Chosen:
#: longer than the time between the requests of a key that is held down, or of clients that try
#: again.
RESUME_QUIET_TIME = 1.0

# --- Driving by hand -----------------------------------------------------------------------------

#: A command by hand is valid for this time after its stamp.  Chosen: longer than a slow Wi-Fi
#: takes, and shorter than the command timeout of a Kachaka.
HAND_LEASE_TIME = 0.25
#: The time between two velocities by hand.  Chosen.
HAND_PERIOD = 0.05
#: How often a remotely controlled program reports its state and issues a stamp, in a drive.
#: Chosen.
REMOTE_REPORT_PERIOD = 0.05
#: How often the state is reported if it does not change, so that its reader sees that it is new.
REMOTE_STATE_PERIOD = 1.0
#: A motion that another program has begun is held if that program is silent for this time,
#: because its stop may not come either.  Chosen: four times the period of its messages.
REMOTE_SILENCE_TIMEOUT = 1.0
#: How long a motion may take to come to rest when its commands end.  Chosen: longer than a pause.
REMOTE_REST_TIMEOUT = 2.0
#: How long a report waits for a reader that does not read, and a stop may wait for the report.
#: Chosen: the pipe holds the reports of some seconds before it is full.
REMOTE_WRITE_TIMEOUT = 0.05

# --- Services ------------------------------------------------------------------------------------

#: A request to drive that comes within this time after a request to stop may have been sent before
#: it.  Measured: two requests of one client up to 3 ms apart are served in either order.
STOP_REQUEST_WINDOW = 0.05

# --- Faults during a drive ----------------------------------------------------------------------

#: How often to compare the numbers of publishers and subscribers on the topics of a robot; if one
#: has changed, the identity is checked.  Measured: it takes less than 10 us.
GRAPH_COUNT_PERIOD = 0.2
#: Of more robots than 40, the numbers of one are compared in this time [s]; both periods grow.
#: Measured: with 200 robots one comparison takes 0.35 ms, and the identity 0.8 ms more.
GRAPH_COUNT_SHARE = 0.005
#: How often to check the identity of the publishers and subscribers when their numbers have not
#: changed.  Measured: it takes 0.1 ms.
GRAPH_CHECK_PERIOD = 1.0

# --- Closed loop ---------------------------------------------------------------------------------

#: If odometry is older than this, velocities are not corrected.  Chosen: ten samples of a Kachaka.
#: The drive itself ends after the parameter ``odometry_timeout``.
FEEDBACK_MAX_AGE = 0.2
#: How long to wait for the first odometry message before a closed-loop drive is refused.  Chosen.
FEEDBACK_START_TIMEOUT = 3.0
#: A closed-loop drive ends after this time without new odometry if ``odometry_timeout`` is 0.
#: Chosen: the default of this parameter.
FEEDBACK_TIMEOUT = 1.0
#: If the robot is further from its planned pose than this [m], [rad], the drive ends: wheels slip,
#: or something holds the robot.  Chosen: far more than a velocity error of 7 % causes.
MAX_POSITION_ERROR = 0.2
MAX_HEADING_ERROR = 0.785

# --- Claim: one program drives -------------------------------------------------------------------

#: How long this program listens for velocities of other programs before it drives or releases the
#: robot.  Longer than the command timeout of a Kachaka: a program that drives the robot sends a
#: message within this time.
FOREIGN_CHECK_TIME = 0.4
#: A program whose newest message is older than this no longer drives the robot.  Chosen.
FOREIGN_MESSAGE_MAX_AGE = 1.0
#: If the robot moves for this time before this program drives it, another program drives it.  The
#: time is longer than a robot moves after its last velocity: its command timeout, and the time to
#: brake from 0.3 m/s.
REST_TIMEOUT = 1.0
#: How long a robot that was found late, at the end of ``robot_timeout``, may take to answer.
#: Chosen.
MIN_ANSWER_TIME = 1.0
#: How long the search for velocity publishers takes after its node has joined the graph.  In this
#: time the node joins three times.  Measured: all of 300 nodes found a publisher within 0.27 s.
PUBLISHER_SEARCH_TIME = 0.55
#: How long the search may take before it is killed, and how long to wait for its end.  Fast DDS
#: announces each participant at least every 3 s.  So without a result of the search, the node that
#: waits has found all publishers itself.
PUBLISHER_SEARCH_TIMEOUT = 3.5
#: How often the node of the search joins the graph, and the time without an announcement after
#: which other participants forget it.  Chosen: they answer a node which they have forgotten.
SEARCH_JOIN_PERIOD = 0.25
SEARCH_LEASE_TIME = 0.15
#: How long to wait until this node has discovered a publisher that the search has found.  Fast DDS
#: announces each participant at least every 3 s.
DISCOVERY_TIMEOUT = 3.5
#: How long to wait if the odometry topic of the robot is not in the graph yet.  Discovery delivers
#: all topics of a participant within some milliseconds.  Fast DDS repeats a lost message after
#: 0.35 s.
ODOMETRY_WAIT_TIME = 0.5
#: A message sent earlier than this before a subscription begins does not reach the subscription.
#: Chosen.  Through shared memory, which the commands do not use, 0.33 s were measured.
MAX_TRANSIT_TIME = 0.2
#: A zero velocity requested from the guardian arrives within this time, or it was lost.  Chosen.
MAX_GUARDIAN_DELAY = 1.0
#: How long the holder of a claim on this machine may take to send its description.  A frozen
#: holder never sends it.
CLAIM_ANSWER_TIMEOUT = 0.3
#: How long to wait for the claim of a program that has ended: its guardian stops the robot first.
GUARDIAN_LEAVE_TIMEOUT = 3.0
#: Time between two attempts to take the claim while waiting for GUARDIAN_LEAVE_TIMEOUT.
CLAIM_RETRY_PERIOD = 0.05
#: How often a claim is published to other machines.  Chosen.
CLAIM_PERIOD = 0.5
#: A claim expires if it was not received for this time.
CLAIM_TIMEOUT = 3 * CLAIM_PERIOD
#: How long a new program waits for claims of other programs after it joined the graph.  Discovery
#: between machines mostly takes less time.
CLAIM_DISCOVERY_TIME = CLAIM_TIMEOUT
#: How long each of two new programs that have discovered each other waits to receive the claim of
#: the other program.  Chosen.
CLAIM_SETTLE_TIME = 0.25
#: How much longer a claim is published after two programs were found to hold a claim, so that the
#: other program receives it as well.
CLAIM_CONFLICT_TIME = 3.0

# --- Manual control of a Kachaka -----------------------------------------------------------------

#: If manual control (the lease) was granted longer ago than this, it is renewed while the plan is
#: at rest.
LEASE_RENEW_AT_REST = 20.0
#: If manual control was granted longer ago than this, it is renewed even in motion.  A Kachaka
#: ends it after 60 s (maker).
LEASE_RENEW_LATEST = 40.0
#: A request without an answer is repeated after this time, then after twice this time, and so on.
#: The reasons: the first answer may be lost on a new connection, and a slow robot must not get too
#: many requests.
REQUEST_RETRY_PERIOD = 0.1
#: How long the robot may take to confirm that manual control was released.  Chosen.
RELEASE_TIMEOUT = 1.0

# --- A real Kachaka over gRPC --------------------------------------------------------------------

#: If a stream of velocities ends without a zero velocity, the bridge stops the robot after this
#: time.  It is shorter than the robot's command timeout (0.3 s), and longer than the period of the
#: slowest publisher that keeps the robot moving (5 Hz).
STREAM_TIMEOUT = 0.25
#: If a publisher has a longer period than this, only the robot's own command timeout stops the
#: robot, so that the bridge does not treat a late message as the end of the stream.  This time
#: plus MAX_LATENESS is STREAM_TIMEOUT.
MAX_STREAM_PERIOD = 0.15
#: If a publisher was silent for this time, the robot is considered at rest, as after a zero
#: velocity.  Chosen.
REARM_IDLE_TIME = 1.0
#: How long the robot may take to confirm a stop, or that manual control is on.  Chosen.
STOP_RPC_TIMEOUT = 1.0
#: If the robot does not answer this many consecutive velocities within the command timeout, no
#: more are sent [calls].  Chosen.
MAX_CONSECUTIVE_TIMEOUTS = 3
#: How long each call to the robot may take when the bridge ends; there are at most three calls.
#: Chosen.
SHUTDOWN_RPC_TIMEOUT = 0.3
#: If the robot has answered no request for this time, the connection is lost.  Chosen.
CONNECTION_TIMEOUT = 1.0

# --- Obstacle watch ------------------------------------------------------------------------------

#: A robot is held if it has no scan that is newer than this.  Chosen: a laser of 10 Hz may miss
#: two scans, and with the next message at 10 Hz the robot is held within 0.5 s.
SCAN_TIMEOUT = 0.35
#: How long the way must be free by all scans before a held robot goes on.  Chosen: a person who
#: crosses it leaves it for a moment, too.
CLEAR_TIME = 1.0
#: How long a drive waits at its start for the first scan.  Chosen: a laser that was off takes some
#: turns to run.
SCAN_START_TIMEOUT = 3.0
#: A robot of unknown delay is at most so far behind its velocities.  Chosen: more than twice that
#: of any robot that was measured.
UNKNOWN_DELAY = 0.5
#: A person who resumes without a scan lets the robot drive at this factor, for this time at most,
#: until a scan comes.  Chosen: slow, and long enough for a laser that starts with the motion.
BLIND_SPEED, BLIND_TIME = 0.3, 5.0
#: How often the laser of a robot at rest is asked to go on.  Source: the maker's own client does
#: so, for 5 s each (``python/kachaka_api/util/vision.py``).
LASER_PERIOD = 1.0
#: A hold of this length is logged.  Chosen.
LONG_HOLD = 60.0


def max_gap(period: float | None, command_timeout: float) -> float:
    """
    Return the longest allowed time from one velocity message to the next one [s].

    :param period: the normal one [s]; None if it is unknown
    """
    if period is None:
        return command_timeout
    return min(period + MAX_LATENESS, command_timeout)


def min_rate(command_timeout: float) -> float:
    """
    Return the lowest rate of velocity messages that leaves room for a late message [Hz].

    One that is late by MAX_LATENESS still arrives within the command timeout after the one before.
    """
    return 1.0 / (command_timeout - MAX_LATENESS)


def rate_problem(rate: float, command_timeout: float, robot: str) -> str:
    """Return why velocities cannot be sent at a rate [Hz], as text; empty if they can."""
    lowest = min_rate(command_timeout)
    if lowest <= rate <= MAX_RATE:
        return ''
    return f'{rate:g} Hz; for {robot} it must be from {lowest:g} to {MAX_RATE:g} Hz'
