// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The parameters of a motion: a field for the value of each, with its bounds and its error. */

import {create, setText} from './dom.js';

/** The fields. Dispatches `edit` when a value is typed. */
export class ParameterFields extends EventTarget {
  /**
   * @param {HTMLElement} list where the fields are
   */
  constructor(list) {
    super();
    this.list = list;
    this.fields = new Map();
    this.typed = new Map();
  }

  /** Return what is typed, by name; what is left empty has its default. */
  get values() {
    return Object.fromEntries(this.typed);
  }

  /** Begin with another motion, and what was typed for it before. */
  reset(values) {
    this.typed = new Map(Object.entries(values));
    this.fields.clear();
    this.list.replaceChildren();
  }

  /**
   * Show the fields, and what is wrong with a value.
   * @param {Array<Object>} parameters
   * @param {Array<{text: string, parameter: string|null}>} errors
   */
  show(parameters, errors) {
    const names = parameters.map(({name}) => name);
    // A field that somebody types in keeps the focus only if it stays where it is.
    if (names.join(' ') !== [...this.fields.keys()].join(' ')) {
      this.fields = new Map(names.map((name, place) => [name, this.field(name, place)]));
      this.list.replaceChildren(...[...this.fields.values()].map(({box}) => box));
    }
    for (const {name, description, default: text, bounds} of parameters) {
      const {input, range, note} = this.fields.get(name);
      const error = errors.find(({parameter}) => parameter === name);
      input.placeholder = text ?? '';
      setText(range, bounds);
      setText(note, error?.text ?? description);
      note.classList.toggle('wrong', error !== undefined);
      if (error === undefined) input.removeAttribute('aria-invalid');
      else input.setAttribute('aria-invalid', 'true');
    }
  }

  /** Return a new field. */
  field(name, place) {
    const [id, noteId] = [`parameter-${place}`, `parameter-note-${place}`];
    const box = create('div', {class: 'field'});
    const label = create('label', {for: id}, name);
    const range = create('span', {class: 'muted'});
    const input = create('input', {
      id, type: 'text', spellcheck: 'false', autocapitalize: 'off', autocomplete: 'off',
      'aria-describedby': noteId});
    const note = create('span', {id: noteId, class: 'note'});
    input.value = this.typed.get(name) ?? '';
    input.addEventListener('input', () => {
      if (input.value.trim() === '') this.typed.delete(name);
      else this.typed.set(name, input.value);
      this.dispatchEvent(new Event('edit'));
    });
    label.append(range);
    box.append(label, input, note);
    return {box, input, range, note};
  }
}
