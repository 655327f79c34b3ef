// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The live state: what the robot does, step, progress, time left, factors, and ages. */

import {byId, setStatus, setText} from './dom.js';

/** How each state is shown. */
const TONES = {
  'standing by': 'idle', taking: 'busy', ready: 'good', 'driving by hand': 'busy', driving: 'busy',
  paused: 'warn', HELD: 'warn', stopping: 'busy', stopped: 'good', ended: 'bad'};
/** From these ages on, a figure is shown as late, and as lost [s]. */
const LATE = {link: [1.5, 2.5], odometry: [0.5, 1.5]};
const NONE = '–';
/** Below this charge, the battery is shown as low. */
const LOW_BATTERY = 0.2;

/** Writes the state into the page. */
export class StateView {
  constructor() {
    this.odometryAge = null;
  }

  /**
   * Show the state.
   * @param {Object} state the whole state, as of the last difference
   */
  update(state) {
    const name = state.process === 'starting' ? 'starting' :
      state.held_by ? 'HELD' : state.state ?? 'unknown';
    if (name === 'stopped' && state.is_still !== true) {
      showUnconfirmed(state.is_still === false);
    } else {
      setStatus(byId('state'), name, TONES[name] ?? 'idle');
    }
    setText(byId('held'), state.held_by ?? '');
    setText(byId('driving'), state.motion ?? '');
    const hasStep = state.step !== null && state.step !== undefined;
    setText(byId('step'), hasStep ? `${state.step} of ${state.steps ?? '?'}` : NONE);
    this.showProgress(state.progress ?? null);
    setText(byId('remaining'), seconds(state.remaining));
    setText(byId('deviation'), deviation(state.planned, state.driven));
    setText(byId('factors'), state.held_by ? `Held: ${state.held_by}.` :
      factorsText(state.factors ?? {}));
    const [linear, angular] = state.velocity ?? [0, 0];
    setText(byId('linear'), `${signed(linear.toFixed(2))} m/s`);
    setText(byId('angular'), `${signed((angular * 180 / Math.PI).toFixed(0))} °/s`);
    const report = state.report ?? null;
    byId('report').hidden = report === null;
    if (report !== null) byId('report').href = `/report/${report}`;
    showRobot(state.battery ?? null, state.robot_errors ?? null);
    // It is told with each change of the state, and at rest once a second.
    this.odometryAge = state.odometry_age ?? null;
  }

  /** Show how much of the motion is over. */
  showProgress(progress) {
    byId('progress').value = progress ?? 0;
    setText(byId('progress-text'), progress === null ? NONE : `${Math.floor(progress * 100)} %`);
  }

  /**
   * Show how old the connection and odometry are; called several times a second.
   * @param {number|null} linkAge [ms]
   * @param {boolean} hasOdometry
   * @param {boolean} isSilent whether the drive process has not been heard when it should
   */
  showAges(linkAge, hasOdometry, isSilent) {
    showLinkAge(linkAge);
    if (linkAge === null || isSilent) {
      setText(byId('odometry-age'), 'unknown');
      byId('odometry-chip').dataset.tone = 'bad';
    } else if (!hasOdometry || this.odometryAge === null) {
      setText(byId('odometry-age'), 'none');
      byId('odometry-chip').dataset.tone = hasOdometry ? 'idle' : 'warn';
    } else {
      showAge('odometry', this.odometryAge);
    }
  }
}

/**
 * Show how old the connection is.
 * @param {number|null} age [ms]; null without one
 */
export function showLinkAge(age) {
  if (age === null) {
    setStatus(byId('link-age'), 'lost', 'idle');
    byId('link-chip').dataset.tone = 'bad';
  } else {
    showAge('link', age / 1_000);
  }
}

/** Show that the robot was stopped, and that odometry does not show it at rest. */
function showUnconfirmed(isMoving) {
  setStatus(byId('state'), isMoving ? 'still moving' : 'stop sent', isMoving ? 'bad' : 'warn');
}

/** Show an age in its box. */
function showAge(name, age) {
  const [late, lost] = LATE[name];
  setText(byId(`${name}-age`), age < 10 ? `${age.toFixed(1)} s ago` : `${Math.round(age)} s ago`);
  byId(`${name}-chip`).dataset.tone = age < late ? 'good' : age < lost ? 'warn' : 'bad';
}

/** Show what the robot tells about itself: charge of its battery, errors. */
function showRobot(battery, errors) {
  byId('battery-chip').hidden = battery === null;
  if (battery !== null) {
    setText(byId('battery'), `${Math.round(battery * 100)} %`);
    byId('battery-chip').dataset.tone = battery < LOW_BATTERY ? 'warn' : 'good';
  }
  byId('robot-errors').hidden = errors === null;
  setText(byId('robot-errors'), errors === null ? '' : `The robot reports: ${errors}`);
}

/** Return a duration as text. */
function seconds(value) {
  return value === null || value === undefined ? NONE : `${value.toFixed(1)} s`;
}

/** Return a number with a true minus sign, and no sign at zero. */
function signed(text) {
  return /^-0(\.0+)?$/.test(text) ? text.slice(1) : text.replace('-', '−');
}

/** Return how far the robot is from where it should be. */
function deviation(planned, driven) {
  if (!planned || !driven) return NONE;
  return `${Math.round(Math.hypot(driven[0] - planned[0], driven[1] - planned[1]) * 1_000)} mm`;
}

/** Return who holds the speed factor, slowest first. */
function factorsText(factors) {
  const slower = Object.entries(factors).filter(([, factor]) => factor < 1)
    .sort((one, other) => one[1] - other[1]);
  if (slower.length === 0) return 'Full speed: nobody holds the robot back.';
  const product = slower.reduce((value, [, factor]) => value * factor, 1);
  const names = slower.map(([name, factor]) => `${name} ${Math.round(factor * 100)} %`).join(', ');
  return `Speed factor ${Math.round(product * 100)} %, held by: ${names}.`;
}
