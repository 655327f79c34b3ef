// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The touch stick: press, hold and move to drive. The pointer is captured while it is held. */

/** Below this part of the way the stick counts as in the middle. */
const DEAD_BAND = 0.1;

/**
 * Return a deflection with the dead band taken out, from -1 to 1.
 * @param {number} value
 * @param {number} band
 */
export function withoutDeadBand(value, band = DEAD_BAND) {
  const size = Math.min(1, Math.abs(value));
  return size <= band ? 0 : Math.sign(value) * (size - band) / (1 - band);
}

/** The stick as a source of the hand. */
export class Stick {
  /**
   * @param {import('./hand.js').Hand} hand
   * @param {HTMLElement} base the round field
   * @param {HTMLElement} knob what moves in it
   */
  constructor(hand, base, knob) {
    this.hand = hand;
    this.base = base;
    this.knob = knob;
    this.pointer = null;
    hand.add(this);
    base.addEventListener('pointerdown', event => this.press(event));
    base.addEventListener('pointermove', event => this.move(event));
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      base.addEventListener(type, event => this.release(event));
    }
    base.addEventListener('contextmenu', event => event.preventDefault());
    base.addEventListener('dragstart', event => event.preventDefault());
  }

  /** A finger, pen or mouse button goes down on the stick; a second one is ignored. */
  press(event) {
    if (this.pointer !== null || event.button !== 0 || !this.hand.isEnabled) return;
    event.preventDefault();
    this.pointer = event.pointerId;
    this.base.setPointerCapture(event.pointerId);
    this.move(event);
  }

  /** The pointer moves, on the stick or, as it is captured, outside. */
  move(event) {
    if (event.pointerId !== this.pointer) return;
    const box = this.base.getBoundingClientRect();
    const reach = box.width / 2 * 0.72;
    let right = (event.clientX - box.left - box.width / 2) / reach;
    let down = (event.clientY - box.top - box.height / 2) / reach;
    const length = Math.hypot(right, down);
    if (length > 1) [right, down] = [right / length, down / length];
    this.place(right * reach, down * reach);
    this.hand.hold('stick', -withoutDeadBand(down), -withoutDeadBand(right));
  }

  /** The pointer is released, or taken away by the system. */
  release(event) {
    if (event.pointerId !== this.pointer) return;
    this.pointer = null;
    this.place(0, 0);
    this.hand.letGo('stick');
  }

  /** Move the knob [px from the middle]. */
  place(right, down) {
    this.knob.style.transform = `translate(${right.toFixed(1)}px, ${down.toFixed(1)}px)`;
  }

  /** Let the pointer go: the stick has to be pressed anew. */
  reset() {
    const pointer = this.pointer;
    this.pointer = null;
    this.place(0, 0);
    if (pointer !== null && this.base.hasPointerCapture(pointer)) {
      this.base.releasePointerCapture(pointer);
    }
  }
}
