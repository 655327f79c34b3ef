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
Every period and timeout that safety rests on, with its reason and its source.

One page for a safety review.  All values are in seconds unless the name or the comment says
otherwise.  "Measured" refers to the benchmarks, ``docs/safety.md`` and ``docs/benchmarks.md``;
"maker" to the public repository pf-robotics/kachaka-api; "chosen" is a decision of ours.

How long the robot keeps a velocity (its command timeout, 0.3 s for a Kachaka) and how long manual
control lasts (60 s) are properties of the robot: ``files/robot_profile.py``.
"""

# --- Sending velocities -----------------------------------------------------------------------

#: Longest time without a heartbeat and a look for faults in the thread that drives; a stop wakes
#: it at once.  Chosen: a quarter of HEARTBEAT_TIMEOUT.
CHECK_PERIOD = 0.025
#: How often a wait that nothing wakes looks whether it is over.  Chosen.
POLL_PERIOD = 0.02
#: How late a velocity may be, beyond one period, before the run is given up.  Chosen: as long as
#: the guardian waits for a heartbeat, so that node and guardian agree on who is too late.
MAX_LATENESS = 0.1
#: Highest rate of velocities [Hz].  Chosen: no use is known for more.
MAX_RATE = 1000.0
#: How long DDS may take to accept one message, or to answer about the graph.  Measured: 0.33 s
#: while other nodes join.  The gap between two velocities is bounded by the robot's command
#: timeout all the same.
PUBLISH_TIMEOUT = 0.5

# --- Stop ---------------------------------------------------------------------------------------

#: Zeros sent back to back at the start of a stop [messages].  The deepest queue on the way, a
#: publisher of depth 10: the zeros push out every velocity that waits in it.
STOP_BURST_COUNT = 10
#: Period of the zeros after those.  Chosen: 25 Hz, so that one lost zero of a lossy link is
#: followed by another well within the command timeout.
STOP_REPEAT_PERIOD = 0.04
#: How much longer than the robot's command timeout zeros are sent.  Chosen.
STOP_MARGIN = 0.1
#: How much longer zeros are sent while odometry shows motion.  Chosen: from a signal to the
#: exit of the program at most 3 s may pass (``ros2 launch`` escalates after 5 s).
STOP_CONFIRM_TIMEOUT = 1.0
#: Slower than this is standstill [m/s], [rad/s].  Chosen: above the noise of wheel encoders.
STANDSTILL_LINEAR = 0.01
STANDSTILL_ANGULAR = 0.02
#: Odometry older than this says nothing about now.  Chosen: more than ten samples of a Kachaka.
ODOMETRY_MAX_AGE = 0.3
#: After a first signal, further ones are not passed on for this long: a second Ctrl+C must not cut
#: the stop short.  Chosen: longer than a stop.
SIGNAL_DEBOUNCE = 3.0

# --- Guardian -----------------------------------------------------------------------------------

#: Heartbeats are at least this far apart.  Chosen: below CHECK_PERIOD, so each check sends one.
HEARTBEAT_PERIOD = 0.015
#: Without a heartbeat for this long in a run, the guardian stops the robot.  Chosen: four times
#: CHECK_PERIOD; SIGSTOP to the first zero stays below 0.15 s (measured: 0.102 s).
HEARTBEAT_TIMEOUT = 0.1
#: The same from the zero at the end of a run to the last zero of its stop.  The node waits up to
#: 0.2 s for a next movement, and DDS may hold it up for PUBLISH_TIMEOUT; the robot has had a zero.
STOPPING_TIMEOUT = 1.0
#: How often the guardian compares the time since the last heartbeat.  Longer pauses are its own,
#: as of a machine that stood still, and do not count.  Chosen.
WATCHDOG_PERIOD = 0.02
#: A guardian that served no heartbeat for this long, while the node was awake, is frozen: the run
#: ends.  As PUBLISH_TIMEOUT: it may be in DDS as long as the node.
GUARDIAN_TIMEOUT = 0.5
#: How long the guardian may take to publish a zero on request, before a run.  Chosen.
GUARDIAN_PRIME_TIMEOUT = 1.0
#: How long the guardian may take to end by itself before it is killed.  Chosen.
GUARDIAN_EXIT_TIMEOUT = 1.0
#: How long the guardian's participant waits for a subscriber before it joins once more, each time.
#: Measured: every second to fourth participant of Fast DDS is found up to 3 s late, and the others
#: within 0.1 s.
DISCOVERY_RETRY_TIMEOUTS = (0.15, 0.2, 0.4, 0.8, 0.8)

# --- Pause ---------------------------------------------------------------------------------------

#: How long the robot must stand before its pose counts as the one of the pause.  Chosen: longer
#: than dead time and lag of a slow robot.
REST_SETTLE_TIME = 0.5
#: A robot that was moved by more than this while paused [m], [rad] is not where its plan goes on.
#: Chosen: above the noise of odometry.
MAX_MOVED_DISTANCE = 0.02
MAX_MOVED_ANGLE = 0.035
#: After a refused resume, a second one within this time goes on all the same.  Chosen.
RESUME_CONFIRM_TIMEOUT = 10.0
#: Only if there was no request for this long before it.  Chosen: longer than the pauses of a key
#: that repeats, and of clients that try again.
RESUME_QUIET_TIME = 1.0

# --- Services ------------------------------------------------------------------------------------

#: A request to drive this soon after one to stop may have been sent before it.  Measured: requests
#: of one client up to 3 ms apart are served in either order.
STOP_REQUEST_WINDOW = 0.05

# --- Faults during a run ------------------------------------------------------------------------

#: How often to check that the robot still subscribes; it takes as long as half a message.
SUBSCRIBER_CHECK_PERIOD = 0.05
#: How often to compare the numbers of publishers and subscribers on the topic.
GRAPH_COUNT_PERIOD = 0.2
#: How often to check who they are when the numbers stay; it takes as long as five messages.
GRAPH_CHECK_PERIOD = 1.0

# --- Closed loop ---------------------------------------------------------------------------------

#: Without odometry for this long, nothing is corrected.  Chosen: ten samples of a Kachaka.  The
#: run itself ends after the parameter ``odometry_timeout``.
FEEDBACK_MAX_AGE = 0.2
#: How long to wait for the first odometry before a run that needs it is refused.  Chosen.
FEEDBACK_START_TIMEOUT = 3.0
#: Without odometry that goes on for this long a closed loop ends, where ``odometry_timeout`` is 0.
#: Chosen: the default of that parameter.
FEEDBACK_TIMEOUT = 1.0
#: A robot further from where it should be [m], [rad] ends the run: wheels slip, or something holds
#: it.  Chosen: far beyond what a robot whose velocities are wrong by 7 % comes to.
MAX_POSITION_ERROR = 0.2
MAX_HEADING_ERROR = 0.785

# --- Claim: one program drives -------------------------------------------------------------------

#: How long other publishers are observed before the robot is taken, or released.  Longer than a
#: Kachaka keeps a velocity: a program that drives it sends within that time.
FOREIGN_CHECK_TIME = 0.4
#: The sender of a message older than this no longer drives.  Chosen.
FOREIGN_MESSAGE_MAX_AGE = 1.0
#: A robot that moves for this long before it is taken is driven by somebody else.  Longer than a
#: robot rolls on after its last velocity: its command timeout, and a brake from 0.3 m/s.
REST_TIMEOUT = 1.0
#: How long a robot whose odometry is not listed is waited for it.  Discovery delivers all topics
#: of a participant within some milliseconds; what was lost, Fast DDS sends again after 0.35 s.
ODOMETRY_WAIT_TIME = 0.5
#: A message sent longer ago cannot still arrive when the subscription begins.  Chosen; through
#: shared memory, which the commands avoid, 0.33 s were measured.
MAX_TRANSIT_TIME = 0.2
#: A zero that the guardian was asked for arrives within this time, or was lost.  Chosen.
MAX_GUARDIAN_DELAY = 1.0
#: How long the holder of a claim on this machine may take to say who it is.  One that is frozen
#: never does.
CLAIM_ANSWER_TIMEOUT = 0.3
#: How long to wait for the claim of a program that has ended: its guardian stops the robot first.
GUARDIAN_LEAVE_TIMEOUT = 3.0
#: How often the claim is tried meanwhile.
CLAIM_RETRY_PERIOD = 0.05
#: How often a claim is published to other machines.  Chosen.
CLAIM_PERIOD = 0.5
#: A claim that was not received for this long is over.
CLAIM_TIMEOUT = 3 * CLAIM_PERIOD
#: How long a newcomer waits for the claims of others, from when it joined the graph.  Discovery
#: between machines mostly takes less.
CLAIM_DISCOVERY_TIME = CLAIM_TIMEOUT
#: How long two newcomers that were discovered before have to receive each other's claim.  Chosen.
CLAIM_SETTLE_TIME = 0.25
#: How much longer a claim is published after two were found to be held, so that the other program
#: receives it as well.
CLAIM_CONFLICT_TIME = 3.0

# --- Manual control of a Kachaka -----------------------------------------------------------------

#: Age of the lease from which a rest of the plan is used to renew it.
LEASE_RENEW_AT_REST = 20.0
#: Age at which it is renewed even in motion.  A Kachaka drops it after 60 s (maker).
LEASE_RENEW_LATEST = 40.0
#: A request without an answer is repeated after this time, then after twice that, and so on: the
#: first answer may be lost on a new connection, and a slow robot must not be asked too often.
REQUEST_RETRY_PERIOD = 0.1
#: How long the robot may take to confirm that manual control was released.  Chosen.
RELEASE_TIMEOUT = 1.0

# --- A real Kachaka over gRPC --------------------------------------------------------------------

#: A stream of velocities that ends without a zero is ended by a stop after this time.  Below the
#: robot's 0.3 s, above the period of the slowest publisher that keeps it moving (5 Hz).
STREAM_TIMEOUT = 0.25
#: A publisher slower than this is left to the robot's own command timeout, so that a late message
#: is not taken for the end.  With MAX_LATENESS it adds up to STREAM_TIMEOUT.
MAX_STREAM_PERIOD = 0.15
#: A publisher that was silent for this long has come to rest, as after a zero.  Chosen.
REARM_IDLE_TIME = 1.0
#: How long the robot may take to confirm a stop, or that manual control is on.  Chosen.
STOP_RPC_TIMEOUT = 1.0
#: After this many velocities in a row that were not answered within the command timeout, no more
#: are sent [calls].  Chosen.
MAX_CONSECUTIVE_TIMEOUTS = 3
#: How long each of the last calls may take when the bridge ends; three at most.  Chosen.
SHUTDOWN_RPC_TIMEOUT = 0.3
#: A robot that answered nothing for this long, though it was asked, is out of reach.  Chosen.
CONNECTION_TIMEOUT = 1.0


def max_gap(period: float | None, command_timeout: float) -> float:
    """
    Return the longest time between two messages that is no fault [s].

    :param period: time between two messages in good conditions [s]; None if it is not known
    :param command_timeout: how long the robot keeps a velocity [s]; the gap is never longer
    """
    if period is None:
        return command_timeout
    return min(period + MAX_LATENESS, command_timeout)


def min_rate(command_timeout: float) -> float:
    """
    Return the lowest rate at which a late message still finds the robot moving [Hz].

    :param command_timeout: how long the robot keeps a velocity [s]
    """
    return 1.0 / (command_timeout - MAX_LATENESS)
