// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/**
 * STOP: from anybody who sees the page, without a lease. It is shown as done only when odometry
 * has confirmed that the robot stands still.
 */

import {setStatus} from './dom.js';

/** Sends stops and shows what became of the last one. */
export class Stop {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {import('./hand.js').Hand|null} hand null where nobody drives by hand
   * @param {HTMLElement} result where the outcome is shown
   * @param {HTMLElement[]} buttons the STOP buttons
   * @param {import('./messages.js').Fault} fault
   * @param {import('./ask.js').FloorQuestion} question
   * @param {string} robot what is stopped
   */
  constructor(connection, hand, result, buttons, fault, question, robot = 'the robot') {
    Object.assign(this, {connection, hand, result, fault, question, robot});
    this.shownFault = '';
    this.count = 0;
    for (const button of buttons) {
      // When the button goes down, not when it comes up. A click without a pointer is a screen
      // reader's or a key's.
      button.addEventListener('pointerdown', event => {
        if (event.button === 0) this.press();
      });
      button.addEventListener('click', event => {
        if (event.detail === 0) this.press();
      });
    }
  }

  /** Stop the robot: the stop is sent before anything else happens. */
  async press() {
    const answered = this.connection.request('stop');
    const count = ++this.count;
    setStatus(this.result, 'stopping', 'busy');
    this.hand?.end('STOP was pressed');
    this.question.cancel();
    const answer = await answered;
    // The outcome of an older stop says nothing about a newer one.
    if (count === this.count) this.showOutcome(answer);
  }

  /** Show the outcome of a stop. */
  showOutcome(answer) {
    if (answer.isLost) {
      const [result, what] = answer.isUnsent ?
        ['STOP not sent', 'STOP was not sent.'] :
        ['STOP: no answer', `STOP may not have reached ${this.robot}.`];
      setStatus(this.result, result, 'bad');
      this.showFault(
        `${what} ${answer.text} Use the button on ${this.robot}, or press Ctrl+C at the terminal.`);
    } else if (!answer.is_done) {
      const result = answer.is_confirmed === false ? 'STOP not confirmed' : 'STOP failed';
      setStatus(this.result, result, 'bad');
      this.showFault(`STOP: ${answer.text}`);
    } else if (answer.is_confirmed === true) {
      setStatus(this.result, 'stopped (odometry confirms)', 'good');
    } else if (answer.is_confirmed === false) {
      setStatus(this.result, 'sent, odometry does not confirm', 'bad');
      this.showFault(
        `STOP was sent, but odometry does not show that ${this.robot} stands still.`);
    } else {
      setStatus(this.result, 'sent, unconfirmed', 'warn');
    }
  }

  /** Show why a stop failed, until something new begins. */
  showFault(text) {
    this.shownFault = text;
    this.fault.show(text);
  }

  /** The robot does something new: the outcome of the last stop is no longer news. */
  forget() {
    this.count += 1;
    this.fault.hide(this.shownFault);
    setStatus(this.result, '', 'idle');
  }
}
