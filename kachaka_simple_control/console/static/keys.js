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
    hand.add(this);
    addEventListener('keydown', event => this.press(event));
    addEventListener('keyup', event => this.release(event));
  }

  /** A key goes down. A repeated event is not a press: the key may have been held since before. */
  press(event) {
    if (!(event.code in KEYS) || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!this.hand.isEnabled || this.belongsToFocus(event.code)) return;
    event.preventDefault();
    if (event.repeat) return;
    this.held.add(event.code);
    this.apply();
  }

  /** A key goes up, wherever the focus is by now. */
  release(event) {
    // While Meta is held, macOS tells no other key's release.
    if (event.key === 'Meta') this.held.clear();
    else if (!this.held.delete(event.code)) return;
    this.apply();
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
    this.show();
  }
}

/**
 * Call a function for Escape anywhere, and for space unless a text field or a control has it.
 * @param {function(): void} stop
 * @param {HTMLElement} button the STOP button: space on it stops when the key goes down
 */
export function watchStopKeys(stop, button) {
  addEventListener('keydown', event => {
    const isSpace = event.code === 'Space' &&
      (document.activeElement === button || !isControl(document.activeElement));
    if (event.key !== 'Escape' && !isSpace) return;
    if (isSpace) event.preventDefault();
    if (!event.repeat) stop();
  }, {capture: true});
}
