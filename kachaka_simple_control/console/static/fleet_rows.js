// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** A row for each robot of a fleet, those in trouble first. */

import {create, setStatus, setText} from './dom.js';

/** How each state of a robot is named and shown. */
const STATES = {
  'standing by': ['standing by', 'idle'], taking: ['getting ready', 'busy'],
  driving: ['driving', 'busy'], paused: ['paused', 'warn'], stopping: ['stopping', 'busy'],
  done: ['done', 'good'], stopped: ['stopped', 'idle']};
const UNKNOWN = ['unknown', 'idle'];

/**
 * Return the tone of a robot.
 * @param {string|undefined} state
 * @param {boolean} isTroubled
 */
export function toneOf(state, isTroubled) {
  return isTroubled ? 'bad' : (STATES[state] ?? UNKNOWN)[1];
}

/** The rows of a table. */
export class FleetRows {
  /**
   * @param {HTMLElement} body the part of a table that has the rows
   * @param {HTMLElement} summary
   */
  constructor(body, summary) {
    this.body = body;
    this.summary = summary;
    this.rows = [];
    this.order = '';
    /** Is called with the name of a robot that was pressed. */
    this.onSelect = () => {};
  }

  /** Show a fleet. */
  setFleet(fleet) {
    this.rows = fleet.robots.map(robot => this.makeRow(robot));
    this.order = '';
    this.sort();
  }

  /** Return the elements of a row. */
  makeRow({name, motion}) {
    const row = create('tr');
    const button = create('button', {type: 'button', class: 'row-name', 'aria-pressed': 'false'},
      name);
    button.addEventListener('click', event => {
      // After a click, space stops; it would press the button again if that kept the focus.
      if (event.detail > 0) button.blur();
      this.onSelect(name);
    });
    const head = create('th', {scope: 'row'});
    head.append(button);
    const what = create('td');
    const trouble = create('span', {class: 'row-trouble'});
    what.append(create('span', {class: 'row-motion'}, motion), trouble);
    const cell = create('td');
    const state = create('span', {class: 'row-state'});
    cell.append(state);
    row.append(head, what, cell);
    return {name, row, button, trouble, state, isTroubled: false};
  }

  /**
   * Show how the robots are.
   * @param {string[]} states in the order of the fleet
   * @param {Object<string, string>} troubles by name
   */
  update(states, troubles) {
    const counts = new Map();
    for (const [place, entry] of this.rows.entries()) {
      const trouble = troubles[entry.name] ?? '';
      const [text] = STATES[states[place]] ?? UNKNOWN;
      entry.isTroubled = trouble !== '';
      setText(entry.trouble, trouble);
      setStatus(entry.state, text, toneOf(states[place], entry.isTroubled));
      counts.set(text, (counts.get(text) ?? 0) + 1);
    }
    setText(this.summary, [...counts].map(([text, count]) => `${count} ${text}`).join(', '));
    this.sort();
  }

  /** Put those in trouble first, the others in the order of the fleet; only if that is new. */
  sort() {
    const sorted = [
      ...this.rows.filter(entry => entry.isTroubled),
      ...this.rows.filter(entry => !entry.isTroubled)];
    const order = sorted.map(entry => entry.name).join('/');
    if (order === this.order) return;
    this.order = order;
    this.body.replaceChildren(...sorted.map(entry => entry.row));
  }

  /** Mark the row of a robot, and bring it into view; none if the name is null. */
  select(name) {
    for (const {name: own, row, button} of this.rows) {
      const isSelected = own === name;
      button.setAttribute('aria-pressed', String(isSelected));
      row.classList.toggle('selected', isSelected);
      if (isSelected) row.scrollIntoView({block: 'nearest'});
    }
  }
}
