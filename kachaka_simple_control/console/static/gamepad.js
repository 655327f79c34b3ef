// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/**
 * A gamepad: the left stick drives while a shoulder button is held; the right face button stops.
 *
 * Browsers give a gamepad to secure pages only (https, or this machine itself). It is asked once
 * per frame, which ends by itself while the page is hidden.
 */

import {withoutDeadBand} from './stick.js';

/** The shoulder buttons: one of them has to be held (standard layout). */
const SHOULDERS = [4, 5];
/** The right face button: B, or a circle. */
const STOP_BUTTON = 1;
const DEAD_BAND = 0.15;

/** A gamepad as a source of the hand. */
export class Gamepads {
  /**
   * @param {import('./hand.js').Hand} hand
   * @param {function(): void} stop
   * @param {HTMLElement} label where the gamepad is named
   */
  constructor(hand, stop, label) {
    this.hand = hand;
    this.stop = stop;
    this.label = label;
    this.index = null;
    this.hasStopped = false;
    this.mustLetGo = false;
    hand.add(this);
    addEventListener('gamepadconnected', event => this.join(event.gamepad));
    addEventListener('gamepaddisconnected', event => this.leave(event.gamepad.index));
  }

  /** Use a gamepad, if there is none yet. */
  join(gamepad) {
    if (this.index !== null) return;
    this.index = gamepad.index;
    // It may have been gone for a moment, with the button held.
    this.mustLetGo = true;
    this.label.textContent = 'Gamepad ready: hold a shoulder button';
    requestAnimationFrame(() => this.read());
  }

  /** A gamepad is gone. */
  leave(index) {
    if (index !== this.index) return;
    this.index = null;
    this.label.textContent = '';
    if (this.hand.holder === 'gamepad') this.hand.end('the gamepad is gone');
  }

  /** Read the gamepad once per frame. */
  read() {
    if (this.index === null) return;
    const gamepad = navigator.getGamepads()[this.index];
    if (!gamepad || !gamepad.connected) {
      this.leave(this.index);
      return;
    }
    const isPressed = place => gamepad.buttons[place]?.pressed === true;
    if (isPressed(STOP_BUTTON) && !this.hasStopped) this.stop();
    this.hasStopped = isPressed(STOP_BUTTON);
    const isHeld = SHOULDERS.some(isPressed);
    if (!isHeld) this.mustLetGo = false;
    if (isHeld && !this.mustLetGo && document.hasFocus()) {
      this.hand.hold(
        'gamepad', -withoutDeadBand(gamepad.axes[1] ?? 0, DEAD_BAND),
        -withoutDeadBand(gamepad.axes[0] ?? 0, DEAD_BAND));
    } else {
      this.hand.letGo('gamepad');
    }
    requestAnimationFrame(() => this.read());
  }

  /** Wait until the shoulder button is let go, after a hold ended otherwise. */
  reset() {
    this.mustLetGo = this.index !== null;
  }
}
