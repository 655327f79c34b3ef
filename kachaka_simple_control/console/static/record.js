// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Recording the velocities of the hand; the record becomes a motion like any other. */

import {byId, setText} from './dom.js';

/** The buttons of a recording. */
export class Recorder {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {import('./library.js').Library} library
   * @param {function(string): void} showFault
   */
  constructor(connection, library, showFault) {
    this.connection = connection;
    this.library = library;
    this.showFault = showFault;
    this.button = byId('record');
    this.replay = byId('replay');
    this.note = byId('record-state');
    this.isRecording = false;
    this.startedAt = 0;
    this.text = '';
    this.button.addEventListener('click', () => this.toggle());
    this.replay.addEventListener('click', () => this.useRecord());
    connection.addEventListener('recorded', event => this.keep(event.detail.text));
  }

  /**
   * Show whether the console records.
   * @param {{isOpen: boolean, state: Object}} page
   */
  update({isOpen, state}) {
    const isRecording = state.is_recording === true;
    if (isRecording && !this.isRecording) {
      this.startedAt = performance.now();
      setText(this.note, 'Recording what is sent while you drive.');
    }
    this.isRecording = isRecording;
    this.button.disabled = !isOpen || state.driver !== 'you';
    this.button.setAttribute('aria-pressed', String(isRecording));
    setText(this.button, isRecording ? 'End recording' : 'Record');
  }

  /** Begin or end a recording. */
  async toggle() {
    const answer = await this.connection.request('record', {on: !this.isRecording});
    if (!answer.is_done) this.showFault(answer.text);
  }

  /** Keep a recording until the next one. */
  keep(text) {
    this.text = text;
    this.replay.disabled = text === '';
    const count = (text.match(/^\s*- move/gm) ?? []).length;
    setText(this.note, text === '' ? 'Nothing was driven, so nothing was recorded.' :
      `Recorded ${count === 1 ? '1 movement' : `${count} movements`}. ` +
      'In the editor you can look at it, run, save or download it.');
  }

  /** Put the recording into the editor, under a name with its date. */
  useRecord() {
    const now = new Date();
    const two = value => String(value).padStart(2, '0');
    const date = `${now.getFullYear()}-${two(now.getMonth() + 1)}-${two(now.getDate())}`;
    const time = `${two(now.getHours())}${two(now.getMinutes())}${two(now.getSeconds())}`;
    this.library.put(this.text, `recorded_${date}_${time}.yaml`);
    byId('motion').scrollIntoView();
    byId('text').focus({preventScroll: true});
  }
}
