// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The motions of the package and the files of the folder: choose, save, download. */

import {byId, create, offerDownload, setStatus, setText} from './dom.js';

const FILE_NAME = /^[A-Za-z0-9_.-]+\.yaml$/;
/** The key of what a tab keeps over a reload. */
const KEPT = 'texts and values';

/** The list of motions and the file buttons. */
export class Library {
  /**
   * @param {import('./connection.js').Connection} connection
   * @param {import('./editor.js').Editor} editor
   * @param {function(string): void} showFault
   */
  constructor(connection, editor, showFault) {
    this.connection = connection;
    this.editor = editor;
    this.showFault = showFault;
    this.choice = byId('choice');
    this.file = byId('file');
    this.result = byId('save-result');
    this.folder = null;
    /** What to know about saving, before anything is saved. */
    this.note = '';
    this.chosen = '';
    this.shown = '';
    this.drafts = new Map();
    this.isEdited = false;
    this.choice.addEventListener('change', () => this.open(this.choice.value));
    byId('save').addEventListener('click', () => this.save(false));
    byId('download').addEventListener('click', () => this.download());
    editor.addEventListener('edit', () => this.noteEdit());
    connection.addEventListener('motions', event => this.show(event.detail.motions));
    addEventListener('pagehide', () => this.keep());
  }

  /** Show what the server told at the beginning. */
  welcome({folder, motions, may_drive: mayDrive}) {
    this.folder = folder;
    byId('save').disabled = folder === null || !mayDrive;
    this.note = folder === null ? 'To save files, start the console with --folder.' : '';
    setStatus(this.result, this.note, 'idle');
    this.show(motions);
    if (this.chosen !== '' || this.editor.text !== '' || this.restore()) return;
    if (motions.length > 0) {
      const first = motions.find(motion => motion.name === 'square') ?? motions[0];
      this.open(first.name);
    }
  }

  /** Put aside the text, if it was edited, and the values that were typed. */
  putAside() {
    const {text, values} = this.editor.asked;
    if (this.isEdited || Object.keys(values).length > 0) {
      this.drafts.set(this.chosen, {text: this.isEdited ? text : null, values});
    } else {
      this.drafts.delete(this.chosen);
    }
  }

  /** Keep what was edited for this tab, so that a reload loses nothing. */
  keep() {
    this.putAside();
    const {chosen, file, drafts} = this;
    try {
      sessionStorage.setItem(
        KEPT, JSON.stringify({chosen, file: file.value, drafts: [...drafts]}));
    } catch {
      // The browser keeps nothing, or the texts are too long for it: a reload loses them.
    }
  }

  /** Show what this tab has kept; return whether there was something. */
  restore() {
    const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? 'null');
    if (kept === null) return false;
    this.drafts = new Map(kept.drafts);
    this.load(kept.chosen);
    this.file.value = kept.file;
    return true;
  }

  /** Fill the list, only when it has changed: an open list would close. */
  show(motions) {
    const told = JSON.stringify([motions, this.folder]);
    if (told === this.shown) return;
    this.shown = told;
    const group = (label, isFile) => {
      const element = create('optgroup', {label});
      for (const {name, is_file: isOfFolder} of motions) {
        if (isOfFolder === isFile) element.append(create('option', {value: name}, name));
      }
      return element;
    };
    const groups = [group('Motions of the package', false)];
    if (this.folder !== null) groups.push(group(`Files of the folder ${this.folder}`, true));
    this.choice.replaceChildren(
      create('option', {value: ''}, motions.length > 0 ? 'A text of your own' : 'No motions'),
      ...groups.filter(element => element.childElementCount > 0));
    this.choice.value = this.chosen;
  }

  /** Open a motion; the text that was edited before is kept until the page is left. */
  open(name) {
    this.putAside();
    this.load(name);
  }

  /** Put a motion into the editor, with what was edited before. */
  async load(name) {
    this.select(name);
    const {text, values} = this.drafts.get(name) ?? {text: null, values: {}};
    if (text !== null || name === '') {
      this.setText(text ?? '', text !== null, values);
      return;
    }
    const answer = await this.connection.request('open', {name});
    if (this.chosen !== name) return;
    if (answer.type === 'file') this.setText(answer.text, false, values);
    else this.showFault(answer.text);
  }

  /** Put a text into the editor that is no motion of the list, for example a recording. */
  put(text, file) {
    this.putAside();
    this.select('');
    this.file.value = file;
    this.setText(text, true, {});
  }

  /** Show which motion is chosen. */
  select(name) {
    this.chosen = name;
    this.choice.value = name;
    this.file.value = name === '' || name.endsWith('.yaml') ? name : `${name}.yaml`;
    setStatus(this.result, this.note, 'idle');
  }

  /** Replace the text of the editor and the values of its parameters. */
  setText(text, isEdited, values) {
    this.isEdited = isEdited;
    this.showSource();
    this.editor.setText(text, values);
  }

  /** The text is the user's own from now on. */
  noteEdit() {
    this.isEdited = true;
    this.showSource();
  }

  /** Say whether the text is edited. */
  showSource() {
    setText(byId('motion-source'), this.isEdited ? 'edited, not saved' : '');
  }

  /** Save the text. An existing file is replaced only after a second press. */
  async save(mayOverwrite) {
    const file = this.file.value.trim();
    if (!FILE_NAME.test(file)) {
      setStatus(this.result, 'A file name has letters, digits, _ . - and ends with .yaml.', 'bad');
      this.file.focus();
      return;
    }
    const text = this.editor.text;
    const answer = await this.connection.request(
      'save', {file, text, may_overwrite: mayOverwrite});
    setStatus(this.result, answer.text || `Saved as ${file}.`, answer.is_done ? 'good' : 'bad');
    if (answer.is_done) {
      this.drafts.delete(this.chosen);
      this.drafts.delete(file);
      this.chosen = file;
      this.choice.value = file;
      this.isEdited = this.editor.text !== text;
      this.showSource();
    } else if (answer.may_overwrite) {
      const button = create('button', {type: 'button', class: 'small'}, `Replace ${file}`);
      button.addEventListener('click', () => this.save(true));
      this.result.append(' ', button);
      button.focus();
    }
  }

  /** Offer the text as a file. */
  download() {
    const file = this.file.value.trim();
    offerDownload(FILE_NAME.test(file) ? file : 'motion.yaml', this.editor.text);
  }
}
