// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The text of a motion and the values of its parameters, checked while one types. */

import {byId, create, setText} from './dom.js';

/** How long after the last key the text is checked [ms]. */
const CHECK_AFTER = 250;

/** The editor. Dispatches `plan` with the plan, or null while there is none. */
export class Editor extends EventTarget {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {HTMLTextAreaElement} area
   * @param {HTMLElement} numbers the line numbers
   * @param {HTMLElement} problems the list of errors
   * @param {import('./parameters.js').ParameterFields} parameters
   */
  constructor(connection, area, numbers, problems, parameters) {
    super();
    this.connection = connection;
    this.area = area;
    this.numbers = numbers;
    this.problems = problems;
    this.parameters = parameters;
    this.count = 0;
    this.timer = null;
    this.plan = null;
    /** What was checked: text and values. */
    this.checked = '';
    /** What is run: the text, its values, and the texts that it includes, as they were planned. */
    this.motion = null;
    parameters.addEventListener('edit', () => this.schedule());
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

  /** Return what is to be checked. */
  get asked() {
    return {text: this.text, values: this.parameters.values};
  }

  /** Return what is asked of the server, with the name of the file. */
  named(asked) {
    const name = byId('file').value.trim();
    return name === '' ? asked : {...asked, name};
  }

  /** Return whether text and values were checked as they are now. */
  get isChecked() {
    return this.checked === JSON.stringify(this.asked);
  }

  /** Replace the text and the values of its parameters, and check them. */
  setText(text, values) {
    this.parameters.reset(values);
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
    const {asked} = this;
    const answer = await this.connection.request('preview', this.named(asked));
    if (count !== this.count) return;
    if (answer.type === 'preview') {
      this.show(answer, asked);
    } else if (answer.isLost !== true) {
      const errors = [{line: null, text: answer.text, parameter: null}];
      this.show({errors, plan: null, parameters: [], included: {}}, asked);
    }
  }

  /** Show the errors and the parameters, and pass the plan on. */
  show({errors, plan, parameters, included}, asked) {
    const {text, values} = asked;
    const names = parameters.map(({name}) => name);
    this.plan = plan;
    this.checked = JSON.stringify(asked);
    this.motion = {text, included, values: Object.fromEntries(
      Object.entries(values).filter(([name]) => names.includes(name)))};
    // A text that cannot be read for a moment does not take away the field that is typed in.
    if (names.length > 0 || errors.length === 0) this.parameters.show(parameters, errors);
    const others = errors.filter(({parameter}) => parameter === null);
    this.showNumbers(others.map(error => error.line));
    this.problems.replaceChildren(...others.map(error => this.problem(error)));
    if (others.length > 0) this.area.setAttribute('aria-invalid', 'true');
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
