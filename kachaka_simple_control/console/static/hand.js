// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/**
 * Driving by hand: one velocity, sent 20 times a second while a direction is held.
 *
 * Each message carries a sequence number and the newest stamp of the drive process. The drive
 * process obeys a message only while its stamp is younger than 0.25 s, so what is late is never
 * obeyed. When the hold ends, one zero is sent at once and nothing after it. The timer lives in
 * the page and never in a worker: in a hidden page it slows down, and the hold lapses.
 */

/** How often a velocity is sent [ms]. */
export const SEND_PERIOD = 50;
/** A hold lapses when stamps or the own timer are later than this [ms]. */
export const LAPSE_AFTER = 250;
/** With more than this waiting in the socket, velocities are not added [bytes]. */
const MOST_WAITING = 4_096;

/** Collects stick, keys and gamepad into one hold, and sends it. Dispatches `change`. */
export class Hand extends EventTarget {
  /** @param {import('./connection.js').Connection} connection */
  constructor(connection) {
    super();
    this.connection = connection;
    this.limits = null;
    this.scale = 0.4;
    this.isEnabled = false;
    this.holder = null;
    this.direction = [0, 0];
    this.sequence = 0;
    this.stamp = null;
    this.stampAt = 0;
    this.tickAt = 0;
    this.beganAt = 0;
    this.timer = null;
    this.note = '';
    this.sources = [];
    addEventListener('blur', () => this.end('the window lost the focus'));
    addEventListener('pagehide', () => this.end('the page was left'));
    document.addEventListener('freeze', () => this.end('the page was frozen'));
    document.addEventListener('visibilitychange', () => {
      if (document.hidden) this.end('the page was hidden');
    });
    connection.addEventListener('stamp', event => {
      this.stamp = event.detail.stamp;
      this.stampAt = performance.now();
    });
    connection.addEventListener('lost', () => {
      this.end('the connection was lost');
      this.stamp = null;
    });
  }

  /**
   * Add a source of directions; its `reset()` is called when a hold ends without letting go, and
   * its `check()`, if it has one, before each velocity.
   * @param {{reset: function(): void, check: (function(): void)|undefined}} source
   */
  add(source) {
    this.sources.push(source);
  }

  /**
   * Allow or forbid holding.
   * @param {boolean} isEnabled
   * @param {string} reason shown when a hold ends by it
   */
  enable(isEnabled, reason = '') {
    if (isEnabled === this.isEnabled) return;
    this.isEnabled = isEnabled;
    if (!isEnabled) this.end(reason);
    this.dispatchEvent(new Event('change'));
  }

  /**
   * Hold a direction. A second source is ignored until the first one lets go.
   * @param {string} source
   * @param {number} ahead from -1 (back) to 1 (ahead)
   * @param {number} left from -1 (turn right) to 1 (turn left)
   */
  hold(source, ahead, left) {
    if (ahead === 0 && left === 0) {
      this.letGo(source);
      return;
    }
    if (!this.isEnabled || (this.holder !== null && this.holder !== source)) return;
    this.direction = [ahead, left];
    if (this.holder !== null) return;
    if (!this.hasStamp()) {
      this.note = 'no stamp from the robot yet: let go and try again';
      this.dispatchEvent(new Event('change'));
      return;
    }
    this.holder = source;
    this.note = '';
    this.tickAt = performance.now();
    this.beganAt = this.tickAt;
    // The drive process asks for a zero first: the zero of an earlier hold may have been lost.
    this.sendVelocity(0, 0);
    this.tick();
    this.timer = setInterval(() => this.tick(), SEND_PERIOD);
    this.dispatchEvent(new Event('change'));
  }

  /** End the hold of a source, which has let go itself. */
  letGo(source) {
    if (this.holder === source) this.finish('');
  }

  /**
   * End any hold for another reason than letting go; each source has to be pressed anew.
   * @param {string} note the reason, for the driver
   */
  end(note) {
    if (this.holder !== null) this.finish(note);
    for (const source of this.sources) source.reset();
  }

  /** Send one zero at once, and nothing after it. */
  finish(note) {
    clearInterval(this.timer);
    this.timer = null;
    this.holder = null;
    this.direction = [0, 0];
    this.sendVelocity(0, 0);
    this.note = note;
    this.dispatchEvent(new Event('change'));
  }

  /**
   * The robot stands, told by its state. If it has been held for a while, the velocities have
   * lapsed on their way, and the drive process waits for a zero.
   */
  noteRest() {
    if (this.holder !== null && performance.now() - this.beganAt > 2 * LAPSE_AFTER) {
      this.end('the velocities came too late at the robot');
    }
  }

  /** Return whether the newest stamp is fresh. */
  hasStamp() {
    return this.stamp !== null && performance.now() - this.stampAt < LAPSE_AFTER;
  }

  /** Return whether stamps have stopped coming. */
  get isLate() {
    return this.stamp === null || performance.now() - this.stampAt > 4 * LAPSE_AFTER;
  }

  /** Send the held velocity, or end the hold if it has lapsed. */
  tick() {
    const now = performance.now();
    if (now - this.tickAt > LAPSE_AFTER) {
      this.end('the page was late');
      return;
    }
    this.tickAt = now;
    if (!this.hasStamp()) {
      this.end('stamps of the robot are late');
      return;
    }
    for (const source of this.sources) source.check?.();
    if (this.holder === null || this.connection.backlog > MOST_WAITING) return;
    this.sendVelocity(...this.velocity());
  }

  /** Return the wanted velocity [m/s, rad/s]. */
  velocity() {
    if (this.limits === null) return [0, 0];
    const [ahead, left] = this.direction;
    const most = ahead < 0 ? this.limits.max_backward_velocity : this.limits.max_linear_velocity;
    return [ahead * most * this.scale, left * this.limits.max_angular_velocity * this.scale];
  }

  /** Send one velocity with the next sequence number and the newest stamp. */
  sendVelocity(linear, angular) {
    if (this.stamp === null) return;
    this.sequence += 1;
    this.connection.send('hand', {
      sequence: this.sequence, stamp: this.stamp, linear_x: linear, angular_z: angular});
  }
}
