// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Puts the page of a fleet together: one connection, one state, and the parts that show it. */

import {FloorQuestion} from './ask.js';
import {Connection} from './connection.js';
import {byId, setStatus, setText} from './dom.js';
import {FleetFloor} from './fleet_floor.js';
import {FleetRows, toneOf} from './fleet_rows.js';
import {sizeText} from './geometry.js';
import {watchStopKeys} from './keys.js';
import {Fault, Log} from './messages.js';
import {waitsForResume} from './run.js';
import {showLinkAge} from './state_view.js';
import {Stop} from './stop.js';

/** How often the age of the connection is drawn [ms]. */
const DRAW_PERIOD = 200;
/** How each state of the whole is named and shown. */
const STATES = {
  'standing by': ['standing by', 'idle'], taking: ['getting ready', 'busy'],
  driving: ['driving', 'busy'], paused: ['paused', 'warn'], stopping: ['stopping', 'busy'],
  stopped: ['stopped', 'good'], ended: ['ended', 'bad']};
/** The states in which the robots are driven, or will be. */
const UNDER_WAY = ['taking', 'driving', 'paused'];
/** The states in which the robots have moved since t = 0, or may have. */
const DRIVING = ['driving', 'paused', 'stopping'];
const NONE = '–';

const page = {
  isOpen: false, wasOpen: false, mayDrive: false, fleet: null, endReason: '', selected: null,
  state: {states: [], poses: [], troubles: {}}};
const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
const connection = new Connection(`${scheme}://${location.host}/ws`, 'ping');
const log = new Log(byId('log-lines'), byId('clear-log'));
const fault = new Fault(byId('fault'), byId('fault-text'), byId('fault-close'), log);
const showFault = text => fault.show(text);
const question = new FloorQuestion();
const stop = new Stop(
  connection, null, byId('stop-result'), [byId('stop'), byId('ask-stop')], fault, question,
  'each robot');
const floor = new FleetFloor(byId('floor-svg'));
const rows = new FleetRows(byId('rows'), byId('summary'));
watchStopKeys(() => stop.press(), byId('stop'));

/** Return why the fleet may not be run now; an empty text if it may. */
function reasonAgainstRun() {
  const {process, state} = page.state;
  if (!page.isOpen) return 'There is no connection.';
  if (!page.mayDrive) return 'This link can stop and pause, but not drive.';
  if (process === 'ended') return 'The process that drives has ended.';
  if (process !== 'running' || page.fleet === null) return 'Waiting for the robots.';
  return state === 'stopping' ? 'The robots are being stopped.' : '';
}

/** Enable what is possible now, and say why the rest is not. */
function refresh() {
  const {process, state} = page.state;
  const reason = reasonAgainstRun();
  const end = state === 'stopped' && page.state.reason ? `Ended early: ${page.state.reason}.` : '';
  const isUnderWay = UNDER_WAY.includes(state);
  const isPaused = waitsForResume(page.state);
  byId('run').disabled = reason !== '' || isUnderWay;
  setText(byId('run-note'), reason || end);
  setText(byId('pause'), isPaused ? 'Resume' : 'Pause');
  byId('pause').disabled = !page.isOpen || !isUnderWay || (isPaused && !page.mayDrive);
  const hasEnded = process === 'ended';
  setText(byId('release'), hasEnded ? 'Start again' : 'Release the robots');
  setText(byId('release-note'), !page.mayDrive ? 'This link can watch and stop, but not drive.' :
    hasEnded ? 'The process that drives has ended.' : 'Then other programs may drive them.');
  byId('release').classList.toggle('primary', hasEnded);
  byId('release').disabled = !page.isOpen || !page.mayDrive || process === 'starting' ||
    isUnderWay || state === 'stopping';
}

/** Ask about the floor, then run the fleet. */
async function run() {
  const {name, robots, rounds, duration} = page.fleet;
  const times = rounds === 1 ? '' : `, ${rounds} times`;
  const isFree = await question.ask({
    subject: name, needs: `needs, for its ${count(robots.length, 'robot')}, a floor of`,
    area: sizeText(floor.area),
    more: `It takes ${duration.toFixed(1)} s${times}. Each robot must stand at its start.`,
    confirm: 'The floor is free: run'});
  if (isFree) await ask('run');
}

/** Send a request, and show why it was refused. */
async function ask(type) {
  const answer = await connection.request(type);
  if (!answer.is_done) showFault(answer.text);
}

/** Show what does not change. */
function useFleet(fleet) {
  if (fleet === null || JSON.stringify(fleet) === JSON.stringify(page.fleet)) return;
  page.fleet = fleet;
  setText(byId('fleet-name'), fleet.name);
  setText(byId('fleet-source'), fleet.source);
  document.title = `${fleet.name}: fleet`;
  floor.setFleet(fleet);
  setText(byId('area'), sizeText(floor.area));
  rows.setFleet(fleet);
  select(null);
  showState();
}

/** Mark a robot in the rows and on the floor; a second time takes that back. */
function select(name) {
  page.selected = page.selected === name ? null : name;
  floor.select(page.selected);
  rows.select(page.selected);
}

/** Show the state as it is known. */
function showState() {
  const {state, states, poses, troubles, round, speed, apart, report} = page.state;
  const {rounds = 1, robots = []} = page.fleet ?? {};
  if (page.isOpen) showWhole();
  setText(byId('held'), page.isOpen && state === 'paused' ? page.state.held_by ?? '' : '');
  rows.update(states, troubles);
  const areTroubled = robots.map(({name}) => name in troubles);
  floor.update(
    poses, areTroubled.map((isTroubled, place) => toneOf(states[place], isTroubled)), areTroubled,
    DRIVING.includes(state));
  const bad = Object.keys(troubles).length;
  setText(byId('trouble'), bad === 0 ? 'none' : count(bad, 'robot'));
  byId('trouble-chip').dataset.tone = bad === 0 ? 'good' : 'bad';
  setText(byId('robot-count'), robots.length === 0 ? NONE : String(robots.length));
  setText(byId('round'), round ? `${round} of ${rounds}` : `${NONE} of ${rounds}`);
  setText(byId('speed'), state === undefined ? NONE : `${Math.round(speed * 100)} %`);
  setText(byId('apart'), apart === null || apart === undefined ? NONE :
    `${(apart * 1_000).toFixed(0)} ms`);
  showProgress();
  byId('report').hidden = !report;
  if (report) byId('report').href = `/report/${report}`;
}

/** Show the state of the whole. */
function showWhole() {
  const {process, state, is_still: isStill, troubles, held_by: heldBy} = page.state;
  if (process === 'starting') {
    setStatus(byId('state'), 'starting', 'idle');
  } else if (state === 'stopped' && isStill !== true) {
    const isMoving = isStill === false;
    setStatus(byId('state'), isMoving ? 'still moving' : 'stop sent', isMoving ? 'bad' : 'warn');
  } else {
    const [text, tone] = state === 'paused' && heldBy ? ['HELD', 'warn'] :
      STATES[state] ?? ['unknown', 'idle'];
    const isTrouble = state === 'stopped' && Object.keys(troubles).length > 0;
    setStatus(byId('state'), text, isTrouble ? 'bad' : tone);
  }
}

/** Show how much of the round is over. */
function showProgress() {
  const {plan_time: time = null} = page.state;
  const duration = page.fleet?.duration ?? null;
  const known = time !== null && duration > 0;
  byId('progress').value = known ? Math.min(1, time / duration) : 0;
  setText(byId('time'), duration === null ? NONE :
    `${known ? time.toFixed(1) : NONE} of ${duration.toFixed(1)} s`);
}

/** Take the differences of the state over. */
function changeState(changes) {
  const before = page.state.state;
  Object.assign(page.state, changes);
  const {state, reason} = page.state;
  const isNew = state !== before;
  // Between two rounds the robots get ready as well.
  if (isNew && ['taking', 'driving'].includes(state) && !UNDER_WAY.includes(before)) {
    floor.restart();
    stop.forget();
  }
  if ('reason' in changes && reason) log.add('info', reason);
  if (('process' in changes || 'reason' in changes) && page.state.process === 'ended' && reason) {
    page.endReason = reason;
    showFault(reason);
  }
  if (changes.process === 'running') fault.hide(page.endReason);
  showState();
  refresh();
}

/** Say in large letters that there is no connection. */
function showLost() {
  const isLost = !page.isOpen && page.wasOpen;
  byId('lost').hidden = !isLost;
  setText(byId('lost-title'), isLost ? 'Connection lost' : '');
  setText(byId('lost-text'), isLost ?
    'This page cannot stop the robots now. They pause by themselves unless another page is open. ' +
    'The page connects again by itself.' : '');
}

/** Return a count with a noun. */
function count(number, noun) {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}

floor.onSelect = select;
rows.onSelect = select;
byId('run').addEventListener('click', run);
byId('pause').addEventListener('click', event => {
  // After a click, space stops; it would resume if the button kept the focus.
  if (event.detail > 0) byId('pause').blur();
  ask(waitsForResume(page.state) ? 'resume' : 'pause');
});
byId('release').addEventListener(
  'click', () => ask(page.state.process === 'ended' ? 'start' : 'release'));
connection.addEventListener('open', () => {
  page.isOpen = true;
  page.wasOpen = true;
  showLost();
});
connection.addEventListener('lost', () => {
  page.isOpen = false;
  question.cancel();
  setStatus(byId('state'), page.wasOpen ? 'unknown' : 'connecting', 'bad');
  showLost();
  refresh();
});
connection.addEventListener('welcome', event => {
  page.mayDrive = event.detail.may_drive;
  useFleet(event.detail.fleet);
  refresh();
});
connection.addEventListener('fleet', event => useFleet(event.detail));
connection.addEventListener('state', event => changeState(event.detail.changes));
connection.addEventListener('log', event => {
  if (event.detail.level !== 'debug') log.add(event.detail.level, event.detail.text);
});

setInterval(() => {
  if (!document.hidden) showLinkAge(connection.age);
}, DRAW_PERIOD);
new ResizeObserver(() => document.documentElement.style.setProperty(
  '--bar-height', `${document.querySelector('.bar').offsetHeight}px`,
)).observe(document.querySelector('.bar'));
refresh();
connection.start();
