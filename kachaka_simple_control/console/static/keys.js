// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The keyboard: hold W A S D or the arrows to drive; Escape and space stop. */

import {isControl, takesText} from './dom.js';

/** The direction of each key: ahead and left, by the place of the key and not its letter. */
const KEYS = {
  KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1],
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1]};
const NAMES = {
  KeyW: 'forward', ArrowUp: 'forward', KeyS: 'back', ArrowDown: 'back', KeyA: 'left',
  ArrowLeft: 'left', KeyD: 'right', ArrowRight: 'right'};

/**
 * A held key repeats. If its repetition ends for this time without a release, a menu of the
 * browser has taken the release, or it was lost [ms].
 */
const REPEAT_TIMEOUT = 300;

/** Held keys as a source of the hand. */
export class DriveKeys {
  /**
   * @param {import('./hand.js').Hand} hand
   * @param {NodeListOf<HTMLElement>} pictures the keys drawn on the page, with data-key
   */
  constructor(hand, pictures) {
    this.hand = hand;
    this.pictures = [...pictures];
    this.held = new Set();
    /** The key that was pressed last: only this one repeats. */
    this.newest = null;
    /** When it was repeated last, and the longest time between two repetitions [ms]. */
    this.repeatedAt = null;
    this.longestGap = null;
    hand.add(this);
    addEventListener('keydown', event => this.press(event));
    addEventListener('keyup', event => this.release(event));
    // An open list or menu takes the release of a key.
    addEventListener('contextmenu', () => this.lose('a menu was opened'), {capture: true});
    for (const type of ['focusin', 'pointerdown']) {
      addEventListener(type, event => {
        if (takesText(event.target)) this.lose('the keys were given to a text field or a list');
      }, {capture: true});
    }
    document.documentElement.addEventListener('mouseleave', () => {
      // The menus of the browser lie there.
      if (!this.isRepeating) this.lose('the pointer left the page');
    });
  }

  /** A key goes down. A repeated event is not a press: the key may have been held since before. */
  press(event) {
    if (!(event.code in KEYS) || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!this.hand.isEnabled || this.belongsToFocus(event.code)) return;
    event.preventDefault();
    if (event.repeat) {
      this.noteRepeat(event.code);
      return;
    }
    this.held.add(event.code);
    this.watch(event.code);
    this.apply();
  }

  /** A key goes up, wherever the focus is by now. */
  release(event) {
    // While Meta is held, macOS tells no other key's release.
    if (event.key === 'Meta') this.held.clear();
    else if (!this.held.delete(event.code)) return;
    if (event.code === this.newest) this.watch(null);
    this.apply();
  }

  /** Watch the repetition of a key; of none if it is null. */
  watch(code) {
    this.newest = code;
    this.repeatedAt = null;
    this.longestGap = null;
  }

  /** A key was repeated, because it is still held. */
  noteRepeat(code) {
    if (code !== this.newest) return;
    const now = performance.now();
    if (this.repeatedAt !== null) {
      this.longestGap = Math.max(this.longestGap ?? 0, now - this.repeatedAt);
    }
    this.repeatedAt = now;
  }

  /** Return whether the repetition of the newest key is known. Some systems repeat no key. */
  get isRepeating() {
    return this.longestGap !== null;
  }

  /** End the hold if the newest key is no longer repeated; called before each velocity. */
  check() {
    const limit = Math.max(REPEAT_TIMEOUT, 3 * this.longestGap);
    if (this.isRepeating && performance.now() - this.repeatedAt > limit) {
      this.lose('the key was not repeated');
    }
  }

  /** End the hold of the keys, for another reason than their release. */
  lose(reason) {
    if (this.hand.holder === 'keys') this.hand.end(reason);
  }

  /** Return whether the focused element uses this key itself. */
  belongsToFocus(code) {
    const focused = document.activeElement;
    if (takesText(focused) || document.querySelector('dialog[open]') !== null) return true;
    return code.startsWith('Arrow') && focused !== null &&
      focused.matches('input[type="range"], [role="log"]');
  }

  /** Pass the sum of the held keys on. */
  apply() {
    let [ahead, left] = [0, 0];
    for (const code of this.held) {
      ahead += KEYS[code][0];
      left += KEYS[code][1];
    }
    this.hand.hold('keys', Math.sign(ahead), Math.sign(left));
    this.show();
  }

  /** Show which keys are held. */
  show() {
    const names = [...this.held].map(code => NAMES[code]);
    for (const picture of this.pictures) {
      picture.classList.toggle('held', names.includes(picture.dataset.key));
    }
  }

  /** Forget the held keys: each has to be pressed anew. */
  reset() {
    this.held.clear();
    this.watch(null);
    this.show();
  }
}

/**
 * Call a function for Escape anywhere, and for space unless a text field or a control has it.
 * @param {function(): void} stop
 * @param {HTMLElement} button the STOP button: space on it stops when the key goes down
 */
export function watchStopKeys(stop, button) {
  let isEscapeDown = false;
  addEventListener('keydown', event => {
    if (event.key === 'Escape') isEscapeDown = true;
    const isSpace = event.code === 'Space' &&
      (document.activeElement === button || !isControl(document.activeElement));
    if (event.key !== 'Escape' && !isSpace) return;
    if (isSpace) event.preventDefault();
    if (!event.repeat) stop();
  }, {capture: true});
  // The release may go to another window.
  addEventListener('blur', () => {
    isEscapeDown = false;
  });
  addEventListener('keyup', event => {
    if (event.key !== 'Escape') return;
    // An open list takes the press for itself; the page sees only the release.
    if (!isEscapeDown) stop();
    isEscapeDown = false;
  }, {capture: true});
}
