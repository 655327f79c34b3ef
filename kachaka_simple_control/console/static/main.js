// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Puts the page together: one connection, one state, and the parts that show it. */

import {FloorQuestion} from './ask.js';
import {Chart} from './chart.js';
import {Connection} from './connection.js';
import {byId, setStatus, setText} from './dom.js';
import {Editor} from './editor.js';
import {Gamepads} from './gamepad.js';
import {sizeText} from './geometry.js';
import {Hand} from './hand.js';
import {DriveKeys, watchStopKeys} from './keys.js';
import {LeaseButton} from './lease.js';
import {Library} from './library.js';
import {Fault, Log} from './messages.js';
import {ParameterFields} from './parameters.js';
import {PlanView} from './plan_view.js';
import {Recorder} from './record.js';
import {RunControls} from './run.js';
import {StateView} from './state_view.js';
import {Stick} from './stick.js';
import {Stop} from './stop.js';

/** How often ages and charts are drawn [ms]. */
const DRAW_PERIOD = 100;
/** The states in which the hand may drive. */
const HAND_STATES = ['ready', 'driving by hand'];
/** The states in which a motion is under way. */
const MOVING_STATES = ['driving', 'paused'];

const page = {
  isOpen: false, wasOpen: false, mayDrive: false, isDrivenHere: true, robot: null,
  drivenPlan: null, endReason: '', state: {}};
const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
const connection = new Connection(`${scheme}://${location.host}/ws`);
const log = new Log(byId('log-lines'), byId('clear-log'));
const fault = new Fault(byId('fault'), byId('fault-text'), byId('fault-close'), log);
const showFault = text => fault.show(text);
const planView = new PlanView(byId('plan-svg'));
const charts = [
  new Chart(byId('linear-svg'), 'linear'), new Chart(byId('angular-svg'), 'angular')];
const stateView = new StateView();
const question = new FloorQuestion();
const hand = new Hand(connection);
const stop = new Stop(
  connection, hand, byId('stop-result'), [byId('stop'), byId('ask-stop')], fault, question);
const stick = new Stick(hand, byId('stick'), byId('knob'));
const editor = new Editor(
  connection, byId('text'), byId('lines'), byId('problems'),
  new ParameterFields(byId('parameters')));
const library = new Library(connection, editor, showFault);
const lease = new LeaseButton(connection, question, byId('lease'), byId('lease-note'), showFault);
const recorder = new Recorder(connection, library, showFault);
const run = new RunControls(connection, question, editor, {
  run: byId('run'), pause: byId('pause'), note: byId('run-note'), speed: byId('speed'),
  speedText: byId('speed-text')}, showFault);
run.onRun = plan => {
  page.drivenPlan = plan;
};
new DriveKeys(hand, document.querySelectorAll('.keys kbd'));
new Gamepads(hand, () => stop.press(), byId('hand-source'));
watchStopKeys(() => stop.press(), byId('stop'));

/** Enable and disable what depends on connection, lease and state. */
function refresh() {
  const {state} = page;
  lease.update(page);
  run.update(page);
  recorder.update(page);
  const isMine = page.isOpen && state.driver === 'you';
  const mayHold = isMine && state.process !== 'ended' && HAND_STATES.includes(state.state);
  hand.enable(mayHold, page.isOpen ? `the robot is ${state.state}` : 'the connection was lost');
  stick.base.setAttribute('aria-disabled', String(!mayHold));
  setText(byId('hand-state'), handText(mayHold, isMine));
}

/** Return what the driver needs to know about driving by hand. */
function handText(mayHold, isMine) {
  if (!page.isOpen) return 'Off: there is no connection.';
  if (page.state.process === 'ended') return 'Off: the process that drives has ended.';
  if (!isMine) return 'Off: take the robot first.';
  if (!mayHold) return `Off: the robot is ${page.state.state}.`;
  if (hand.holder !== null) return `Driving by ${hand.holder}. Let go to stop.`;
  return hand.note === '' ? 'Ready: hold stick, W A S D or arrows. Let go to stop.' :
    `Ended: ${hand.note}. Press again.`;
}

/** Use a robot's limits and outline. */
function useRobot(robot) {
  if (robot === null) return;
  page.robot = robot;
  page.isDrivenHere = robot.is_driven_here;
  document.body.classList.toggle('beside', !page.isDrivenHere);
  hand.limits = robot;
  setText(byId('robot-name'), robot.robot);
  setText(byId('robot-topic'), robot.topic);
  document.title = `${robot.robot}: console`;
  planView.setFootprint(robot.footprint);
  planView.setFloor(robot.floor ?? null);
  charts[0].setLimits(-robot.max_backward_velocity, robot.max_linear_velocity);
  const turn = robot.max_angular_velocity * 180 / Math.PI;
  charts[1].setLimits(-turn, turn);
}

/** Return whether a motion is under way. */
function isMoving() {
  return MOVING_STATES.includes(page.state.state);
}


/** Show the drive of a motion, from the pose where it began. */
function beginMotion() {
  planView.restart(page.state.start ?? page.state.driven ?? null);
  showPlan();
}

/** Show the plan that is driven, or that of the editor. */
function showPlan() {
  const isShown = isMoving() || !page.isDrivenHere;
  const plan = isShown ? page.drivenPlan : editor.plan;
  planView.setPlan(plan);
  setText(byId('plan-area'), plan === null ? '–' : sizeText(planView.area));
  setText(byId('plan-duration'), plan === null ? '–' : `${plan.duration.toFixed(1)} s`);
  setText(byId('plan-steps'), plan === null ? '–' : String(plan.steps));
  showPoses();
}

/** Show where the robot is, and where it should be while it drives a motion. */
function showPoses() {
  planView.setPoses(isMoving() ? page.state.planned ?? null : null, page.state.driven ?? null);
}

/** Show the laser while there is an obstacle watch. */
function showWatch() {
  const watch = page.state.watch ?? null;
  planView.setWatch(watch);
  byId('key-scan').hidden = watch === null;
}

/** Mark where an obstacle holds the robot. */
function showHold() {
  const {held_by: heldBy, watch, driven} = page.state;
  planView.setHeld(heldBy && watch?.state === 'obstacle' ? driven ?? null : null);
  byId('key-held').hidden = planView.heldPoses.length === 0;
}

/** Take the differences of the state over. */
function changeState(changes) {
  const before = page.state.state;
  Object.assign(page.state, changes);
  const {state, reason, velocity} = page.state;
  const isNew = state !== before;
  if (isNew && state === 'taking') planView.restart(null);
  if (isNew && isMoving() && !MOVING_STATES.includes(before)) beginMotion();
  if (isNew && ['taking', 'driving', 'driving by hand'].includes(state)) stop.forget();
  if (isNew && state === 'ready' && before === 'driving by hand') hand.noteRest();
  if (isNew || 'planned' in changes || 'driven' in changes) showPoses();
  if ('watch' in changes) showWatch();
  showHold();
  if ('velocity' in changes) {
    const now = performance.now() / 1_000;
    charts[0].add(velocity[0], now);
    charts[1].add(velocity[1] * 180 / Math.PI, now);
  }
  if ('reason' in changes && reason) log.add('info', reason);
  const isEnd = page.state.process === 'ended' && page.isDrivenHere;
  if (('process' in changes || 'reason' in changes) && isEnd && reason) {
    page.endReason = reason;
    showFault(reason);
  }
  if (changes.process === 'running') fault.hide(page.endReason);
  stateView.update(page.state);
  refresh();
}

/** Return whether a drive from a terminal has ended, and its page with it. */
function isDriveOver() {
  return !page.isDrivenHere && page.state.process === 'ended';
}

/** Say in large letters that there is no connection. */
function showLost() {
  const isLost = !page.isOpen && page.wasOpen;
  if (byId('lost').hidden !== isLost) return;
  byId('lost').hidden = !isLost;
  const isOver = isDriveOver();
  setText(byId('lost-title'), !isLost ? '' : isOver ? 'The drive has ended' : 'Connection lost');
  setText(byId('lost-text'), isOver ? 'This page was there for it alone.' : isLost ?
    'This page cannot stop the robot now. Driving by hand has ended; a motion begun here pauses ' +
    'when the server is silent. The page connects again by itself.' : '');
}

connection.addEventListener('open', () => {
  page.isOpen = true;
  page.wasOpen = true;
  showLost();
});
connection.addEventListener('lost', () => {
  page.isOpen = false;
  question.cancel();
  setText(byId('held'), '');
  if (!isDriveOver()) setStatus(byId('state'), page.wasOpen ? 'unknown' : 'connecting', 'bad');
  showLost();
  refresh();
});
connection.addEventListener('welcome', event => {
  page.mayDrive = event.detail.may_drive;
  useRobot(event.detail.robot);
  library.welcome(event.detail);
  if (editor.text !== '') editor.check();
  refresh();
});
connection.addEventListener('robot', event => {
  useRobot(event.detail);
  if (editor.text !== '') editor.check();
});
connection.addEventListener('driven', event => {
  page.drivenPlan = event.detail.plan;
  if (isMoving() || !page.isDrivenHere) showPlan();
});
connection.addEventListener('scan', event => planView.setScan(event.detail));
connection.addEventListener('state', event => changeState(event.detail.changes));
connection.addEventListener('log', event => {
  if (event.detail.level !== 'debug') log.add(event.detail.level, event.detail.text);
});
editor.addEventListener('plan', event => {
  // A motion starts where the robot stands.
  if (!isMoving()) planView.restart(null);
  showPlan();
});
editor.addEventListener('change', () => run.update(page));
hand.addEventListener('change', refresh);
byId('lease').addEventListener('settled', refresh);
byId('hand-speed').addEventListener('input', event => {
  hand.scale = Number(event.target.value) / 100;
  setText(byId('hand-speed-text'), `${event.target.value} %`);
});

setInterval(() => {
  if (document.hidden) return;
  const now = performance.now() / 1_000;
  // While the robot is taken, the drive process sends stamps.
  const isSilent = hand.isEnabled && hand.isLate;
  stateView.showAges(connection.age, page.robot?.has_odometry ?? true, isSilent);
  for (const chart of charts) chart.draw(now);
}, DRAW_PERIOD);
new ResizeObserver(() => document.documentElement.style.setProperty(
  '--bar-height', `${document.querySelector('.bar').offsetHeight}px`,
)).observe(document.querySelector('.bar'));
refresh();
connection.start();
