// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** A small chart of one velocity over the last seconds, with its limits and zero. */

import {createSvg} from './dom.js';

/** How much of the past is shown [s]. */
const SPAN = 20;
const LEFT = 44;
const EDGE = 8;

/** Keeps what was told and draws it, in the pixels of its SVG element. */
export class Chart {
  /**
   * @param {SVGElement} svg
   * @param {string} kind a class for the line
   */
  constructor(svg, kind) {
    this.svg = svg;
    this.changes = [];
    this.frame = createSvg('g');
    this.line = createSvg('polyline', {class: `velocity-line ${kind}`});
    svg.append(this.frame, this.line);
    this.limits = [-1, 1];
    this.unit = '';
    new ResizeObserver(() => this.drawFrame()).observe(svg);
  }

  /**
   * Set the limits of the scale.
   * @param {number} lowest
   * @param {number} highest
   * @param {string} unit
   */
  setLimits(lowest, highest, unit) {
    this.limits = [lowest, highest];
    this.unit = unit;
    this.drawFrame();
  }

  /**
   * Note a velocity, which holds until the next one.
   * @param {number} value
   * @param {number} now [s]
   */
  add(value, now) {
    this.changes.push([now, value]);
    // The last one before the span still holds at its beginning.
    while (this.changes.length > 1 && this.changes[1][0] < now - SPAN) this.changes.shift();
  }

  /** Return the height of a value [px]. */
  height(value) {
    const [lowest, highest] = this.limits;
    const inner = this.svg.clientHeight - 2 * EDGE;
    const share = (value - lowest) / (highest - lowest);
    return EDGE + inner * (1 - Math.min(1.05, Math.max(-0.05, share)));
  }

  /** Draw the scale. */
  drawFrame() {
    const width = this.svg.clientWidth;
    if (width === 0) return;
    this.svg.setAttribute('viewBox', `0 0 ${width} ${this.svg.clientHeight}`);
    this.frame.replaceChildren();
    for (const value of [this.limits[0], 0, this.limits[1]]) {
      const y = this.height(value);
      this.frame.append(createSvg('line', {
        class: value === 0 ? 'zero-line' : 'limit-line', x1: LEFT, x2: width, y1: y, y2: y}));
      const label = Number(value.toPrecision(2)).toString().replace('-', '−');
      this.frame.append(createSvg('text', {
        x: LEFT - 8, y: y + 4, 'text-anchor': 'end'}, label));
    }
  }

  /**
   * Draw the line up to now.
   * @param {number} now [s]
   */
  draw(now) {
    const width = this.svg.clientWidth;
    const from = now - SPAN;
    const points = [];
    let last = null;
    for (const [time, value] of this.changes) {
      const x = LEFT + Math.max(0, (time - from) / SPAN) * (width - LEFT);
      const y = this.height(value);
      if (last !== null) points.push(`${x.toFixed(1)},${last.toFixed(1)}`);
      points.push(`${x.toFixed(1)},${y.toFixed(1)}`);
      last = y;
    }
    if (last !== null) points.push(`${width},${last.toFixed(1)}`);
    this.line.setAttribute('points', points.join(' '));
  }
}
