// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The text of a motion, its line numbers, and its errors at their lines while one types. */

import {create, setText} from './dom.js';

/** How long after the last key the text is checked [ms]. */
const CHECK_AFTER = 250;

/** The editor. Dispatches `plan` with the plan, or null while there is none. */
export class Editor extends EventTarget {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {HTMLTextAreaElement} area
   * @param {HTMLElement} numbers the line numbers
   * @param {HTMLElement} problems the list of errors
   */
  constructor(connection, area, numbers, problems) {
    super();
    this.connection = connection;
    this.area = area;
    this.numbers = numbers;
    this.problems = problems;
    this.count = 0;
    this.timer = null;
    this.plan = null;
    this.checkedText = null;
    area.addEventListener('input', () => {
      this.dispatchEvent(new Event('edit'));
      this.schedule();
    });
    area.addEventListener('scroll', () => this.follow());
    this.showNumbers([]);
  }

  /** Return the text. */
  get text() {
    return this.area.value;
  }

  /** Return whether the plan belongs to the text as it is now. */
  get isPlanned() {
    return this.plan !== null && this.checkedText === this.text;
  }

  /** Replace the text and check it. */
  setText(text) {
    this.area.value = text;
    this.area.scrollTop = 0;
    this.check();
  }

  /** Check the text soon. */
  schedule() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), CHECK_AFTER);
    this.showNumbers([]);
    this.dispatchEvent(new Event('change'));
  }

  /** Ask the server for the plan or the errors. An answer to an older text is dropped. */
  async check() {
    clearTimeout(this.timer);
    const count = ++this.count;
    const text = this.text;
    const answer = await this.connection.request('preview', {text});
    if (count !== this.count) return;
    if (answer.type === 'preview') {
      this.show(answer.errors, answer.plan, text);
    } else if (answer.isLost !== true) {
      this.show([{line: null, text: answer.text}], null, text);
    }
  }

  /** Show the errors and pass the plan on. */
  show(errors, plan, text) {
    this.plan = errors.length === 0 ? plan : null;
    this.checkedText = text;
    this.showNumbers(errors.map(error => error.line));
    this.problems.replaceChildren(...errors.map(error => this.problem(error)));
    if (errors.length > 0) this.area.setAttribute('aria-invalid', 'true');
    else this.area.removeAttribute('aria-invalid');
    this.dispatchEvent(new CustomEvent('plan', {detail: this.plan}));
    this.dispatchEvent(new Event('change'));
  }

  /** Return an entry of the list of errors; its line is a button that goes there. */
  problem({line, text}) {
    const entry = create('li');
    if (line !== null) {
      const button = create('button', {type: 'button'}, `Line ${line}`);
      button.addEventListener('click', () => this.goTo(line));
      entry.append(button);
    }
    entry.append(text);
    return entry;
  }

  /** Select a line. */
  goTo(line) {
    const lines = this.text.split('\n');
    const start = lines.slice(0, line - 1).join('\n').length + (line > 1 ? 1 : 0);
    this.area.focus();
    this.area.setSelectionRange(start, start + (lines[line - 1] ?? '').length);
    // Some lines above it, to be read with it.
    this.area.scrollTop = this.area.scrollHeight * Math.max(0, line - 4) / lines.length;
  }

  /** Number the lines, and mark those with errors. */
  showNumbers(wrong) {
    const count = this.text.split('\n').length;
    while (this.numbers.childElementCount > count) this.numbers.lastElementChild.remove();
    while (this.numbers.childElementCount < count) this.numbers.append(create('li'));
    [...this.numbers.children].forEach((number, place) => {
      setText(number, String(place + 1));
      number.classList.toggle('wrong', wrong.includes(place + 1));
    });
    this.follow();
  }

  /** Keep the line numbers beside their lines. */
  follow() {
    this.numbers.scrollTop = this.area.scrollTop;
  }
}
