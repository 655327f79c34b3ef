// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** What the page tells in words: the log, and the fault that a screen reader reads at once. */

import {create, setText} from './dom.js';

/** The largest number of lines that are kept. */
const MOST_LINES = 400;

/** What ROS and Python write before a message: level, time [s since 1970] and name. */
const PREFIX = /^\[(?:DEBUG|INFO|WARN|ERROR|FATAL)\] (?:\[([\d.]+)\] )?\[[^\]]*\]: /;

/** The log, newest line last; it follows the end unless one has scrolled up. */
export class Log {
  /**
   * @param {HTMLElement} list
   * @param {HTMLElement} clear the button that empties it
   */
  constructor(list, clear) {
    this.list = list;
    clear.addEventListener('click', () => this.list.replaceChildren());
  }

  /**
   * Add a line.
   * @param {string} level debug, info, warning or error
   * @param {string} text
   */
  add(level, text) {
    const {list} = this;
    const isAtEnd = list.scrollHeight - list.scrollTop - list.clientHeight < 30;
    const entry = create('li', {title: text});
    const message = text.replace(PREFIX, '');
    // An old line, as after a reload, has its own time.
    const seconds = PREFIX.exec(text)?.[1];
    const time = seconds === undefined ? new Date() : new Date(1_000 * Number(seconds));
    const start = level === 'info' ? '' : `${level}: `;
    const body = create('span', {class: level}, start + message);
    entry.append(create('time', {}, time.toTimeString().slice(0, 8)), body);
    list.append(entry);
    while (list.childElementCount > MOST_LINES) list.firstElementChild.remove();
    if (isAtEnd) list.scrollTop = list.scrollHeight;
  }
}

/** The last fault, shown until it is closed. */
export class Fault {
  /**
   * @param {HTMLElement} box
   * @param {HTMLElement} text
   * @param {HTMLElement} close the button that hides it
   * @param {Log} log
   */
  constructor(box, text, close, log) {
    this.box = box;
    this.text = text;
    this.log = log;
    close.addEventListener('click', () => this.show(''));
  }

  /**
   * Show a fault, and note it in the log.
   * @param {string} fault an empty text hides the last one
   */
  show(fault) {
    setText(this.text, fault);
    this.box.hidden = fault === '';
    if (fault !== '') this.log.add('error', fault);
  }

  /** Hide a fault that is over, unless another one is shown by now. */
  hide(fault) {
    if (this.text.textContent === fault) this.show('');
  }
}
