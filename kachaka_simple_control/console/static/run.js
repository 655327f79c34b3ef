// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Running a motion: the question about the floor, pause and resume, and the speed. */

import {setText} from './dom.js';
import {sizeText} from './geometry.js';
import {FREE} from './lease.js';

/** The shortest time between two speed factors that are sent [ms]. */
const SPEED_PERIOD = 100;
/** So long after a change here, the speed of others is not shown [ms]. */
const SPEED_HOLD = 1_000;

/** The buttons of a motion. */
export class RunControls {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {import('./ask.js').FloorQuestion} question
   * @param {import('./editor.js').Editor} editor
   * @param {Object<string, HTMLElement>} parts run, pause, note, speed, speedText
   * @param {function(string): void} showFault
   */
  constructor(connection, question, editor, parts, showFault) {
    Object.assign(this, {connection, question, editor, parts, showFault});
    this.state = {};
    /** Is called with the plan before a motion is run. */
    this.onRun = () => {};
    this.speedTimer = null;
    this.speedSentAt = -Infinity;
    parts.run.addEventListener('click', () => this.run());
    parts.pause.addEventListener('click', event => {
      // After a click, space stops; it would resume if the button kept the focus.
      if (event.detail > 0) parts.pause.blur();
      this.pauseOrResume();
    });
    parts.speed.addEventListener('input', () => this.changeSpeed());
  }

  /**
   * Enable what is possible now, and say why the rest is not.
   * @param {{isOpen: boolean, mayDrive: boolean, isDrivenHere: boolean, state: Object}} page
   */
  update({isOpen, mayDrive, isDrivenHere, state}) {
    this.state = state;
    const isMine = state.driver === 'you';
    const isDriving = state.state === 'driving' || state.state === 'paused';
    const isPaused = waitsForResume(state);
    const reason = this.reasonAgainst(isOpen, mayDrive, isMine, isDriving);
    this.parts.run.disabled = reason !== '';
    setText(this.parts.pause, isPaused ? 'Resume' : 'Pause');
    // A drive that began in a terminal has no lease.
    const mayChange = isDrivenHere ? isMine : mayDrive;
    this.parts.pause.disabled = !isOpen || !isDriving || (isPaused && !mayChange);
    const needsLease = isOpen && isPaused && mayDrive && !mayChange;
    setText(this.parts.note, needsLease ? 'Take the robot to resume.' : isDriving ? '' : reason);
    this.parts.speed.disabled = !isOpen || !mayChange;
    this.followSpeed(state.factors?.override ?? 1);
  }

  /** Return why no motion may begin; an empty text if one may. */
  reasonAgainst(isOpen, mayDrive, isMine, isDriving) {
    if (!isOpen) return 'There is no connection.';
    if (!mayDrive) return 'This link can stop and pause, but not drive.';
    if (isDriving) return 'A motion is under way.';
    if (!isMine || FREE.includes(this.state.state)) return 'Take the robot to run a motion.';
    if (this.state.state !== 'ready') return `The robot is ${this.state.state}.`;
    if (this.editor.text.trim() === '') return 'Choose a motion first.';
    if (!this.editor.isChecked) return 'The text is being checked.';
    return this.editor.plan === null ? 'The motion has errors.' : '';
  }

  /** Ask about the floor, then run the motion as it was checked. */
  async run() {
    const {motion, plan} = this.editor;
    const name = this.motionName();
    const isFree = await this.question.ask({
      subject: name, needs: 'needs an area of', area: sizeText(plan.box),
      more: `It takes ${plan.duration.toFixed(1)} s at full speed, from where the robot stands.`,
      confirm: 'The floor is free: run'});
    if (!isFree) return;
    this.onRun(plan);
    const answer = await this.connection.request('run', this.editor.named(motion));
    if (!answer.is_done) this.showFault(answer.text);
  }

  /** Return the name that the text gives its motion. */
  motionName() {
    const found = /^name:\s*(.+?)\s*$/m.exec(this.editor.text);
    return found === null ? 'The motion' : found[1].replace(/^(['"])(.*)\1$/, '$2');
  }

  /** Pause the motion, or go on with it. */
  async pauseOrResume() {
    const type = waitsForResume(this.state) ? 'resume' : 'pause';
    const answer = await this.connection.request(type);
    if (!answer.is_done) this.showFault(answer.text);
  }

  /** Show the speed of the slider, and send it not too often; the last one always. */
  changeSpeed() {
    this.showSpeed();
    if (this.speedTimer !== null) return;
    const wait = Math.max(0, this.speedSentAt + SPEED_PERIOD - performance.now());
    this.speedTimer = setTimeout(() => this.sendSpeed(), wait);
  }

  /** Show the speed that is set, also by others, unless the slider has just been moved here. */
  followSpeed(factor) {
    if (performance.now() - this.speedSentAt < SPEED_HOLD || this.speedTimer !== null) return;
    this.parts.speed.value = Math.round(factor * 100);
    this.showSpeed();
  }

  /** Show the speed of the slider. */
  showSpeed() {
    setText(this.parts.speedText, `${this.parts.speed.value} %`);
  }

  /** Send the speed of the slider as it is now. */
  async sendSpeed() {
    this.speedTimer = null;
    this.speedSentAt = performance.now();
    const answer = await this.connection.request(
      'speed', {factor: Number(this.parts.speed.value) / 100});
    if (!answer.is_done) this.showFault(answer.text);
  }
}

/**
 * Return whether a drive is paused until somebody resumes, or could go on so.
 * @param {Object} state that of a robot or of a fleet
 */
export function waitsForResume({state, watch, held_by: heldBy}) {
  return state === 'paused' && (!heldBy || watch?.state === 'no scan');
}
