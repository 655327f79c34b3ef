// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Taking and releasing the robot: the lease of the console, then the robot itself. */

import {setText} from './dom.js';

/** The states in which the robot is not held. */
export const FREE = ['standing by', 'stopping', 'stopped', 'ended'];

/** What the button does now, and why. */
const ACTIONS = {
  wait: ['Take the robot', 'Waiting for the server.', false],
  watch: ['Watching only', 'This link can watch and stop, but not drive.', false],
  start: ['Start again', 'The drive process has ended.', true],
  taken: ['Take the robot', 'Another page has the robot.', false],
  take: ['Take the robot', 'Needed to drive, not to stop.', true],
  taking: ['Taking the robot', 'Please wait.', false],
  release: ['Release the robot', 'You have the robot.', true],
};

/** The button 'Take the robot'. */
export class LeaseButton {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {import('./ask.js').FloorQuestion} question
   * @param {HTMLButtonElement} button
   * @param {HTMLElement} note
   * @param {function(string): void} showFault
   */
  constructor(connection, question, button, note, showFault) {
    this.connection = connection;
    this.question = question;
    this.button = button;
    this.note = note;
    this.showFault = showFault;
    this.action = 'wait';
    this.isBusy = false;
    button.addEventListener('click', () => this.press());
  }

  /**
   * Choose what the button does.
   * @param {{isOpen: boolean, mayDrive: boolean, state: Object}} page
   */
  update({isOpen, mayDrive, state}) {
    this.action = LeaseButton.actionFor(isOpen, mayDrive, state);
    const [label, note, isEnabled] = ACTIONS[this.action];
    setText(this.button, label);
    setText(this.note, note);
    this.button.disabled = !isEnabled || this.isBusy;
    this.button.classList.toggle('primary', this.action !== 'release');
  }

  /** Return the name of the action that fits. */
  static actionFor(isOpen, mayDrive, state) {
    if (!isOpen) return 'wait';
    if (!mayDrive) return 'watch';
    if (state.process === 'ended') return 'start';
    if (state.process !== 'running') return 'wait';
    if (state.driver === 'another') return 'taken';
    if (state.state === 'taking') return 'taking';
    return state.driver !== 'you' || FREE.includes(state.state) ? 'take' : 'release';
  }

  /** Do what the button says. */
  async press() {
    if (this.isBusy) return;
    const action = this.action;
    if (action === 'take' && !await this.askForFloor()) return;
    this.isBusy = true;
    this.button.disabled = true;
    const answer = await this.perform(action);
    this.isBusy = false;
    if (!answer.is_done) this.showFault(`${ACTIONS[action][0]}: ${answer.text}`);
    this.dispatchChange();
  }

  /** Ask whether the floor is free: a robot may leave its dock as soon as it is taken. */
  askForFloor() {
    return this.question.ask({
      subject: 'Taking the robot', needs: 'may move it: a robot on a dock drives off it.',
      area: '',
      more: 'After that it moves only while you hold a direction, or run a motion.',
      confirm: 'The floor is free: take'});
  }

  /** Send the requests of an action, and return the last answer. */
  async perform(action) {
    if (action === 'start') return this.connection.request('start');
    if (action === 'release') {
      const answer = await this.connection.request('release');
      await this.connection.request('lease', {want: false});
      return answer;
    }
    const leased = await this.connection.request('lease', {want: true});
    return leased.is_done ? this.connection.request('take') : leased;
  }

  /** Let the page show the new state of the button. */
  dispatchChange() {
    this.button.dispatchEvent(new Event('settled', {bubbles: true}));
  }
}
