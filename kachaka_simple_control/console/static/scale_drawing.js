// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** A drawing of the floor to scale, with a grid and a scale bar: x to the right, y up. */

import {createSvg} from './dom.js';
import {boxOf, niceLength, outlineAt} from './geometry.js';

/** What is drawn for a robot whose outline is unknown [m]. */
export const ARROW = [[0.1, 0], [-0.07, 0.07], [-0.07, -0.07]];

/** Draws into one SVG element, in its own pixels, so that text keeps its size. */
export class ScaleDrawing {
  /** @param {SVGElement} svg is drawn anew, by `draw()`, when its size changes */
  constructor(svg) {
    this.svg = svg;
    /** The space around the drawn area, for labels [px]. */
    this.margin = 34;
    this.scene = createSvg('g');
    svg.append(this.scene);
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  /** Choose scale and middle so that a box is in view, and begin a new scene with a grid. */
  begin([x0, y0, x1, y1]) {
    this.width = this.svg.clientWidth || 600;
    this.height = this.svg.clientHeight || 400;
    this.scale = Math.min(
      (this.width - 2 * this.margin) / Math.max(x1 - x0, 0.2),
      (this.height - 2 * this.margin) / Math.max(y1 - y0, 0.2));
    this.middle = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.svg.setAttribute('viewBox', `0 0 ${this.width} ${this.height}`);
    this.scene.replaceChildren();
    this.drawGrid();
  }

  /** Return the pixels of a point [m]. */
  at([x, y]) {
    return [
      this.width / 2 + (x - this.middle[0]) * this.scale,
      this.height / 2 - (y - this.middle[1]) * this.scale];
  }

  /** Return points as the text of a polyline or path. */
  text(points) {
    return points.map(point => this.at(point).map(value => value.toFixed(1)).join(',')).join(' ');
  }

  /** Return whether the whole outline of a shape at a pose is in view, the edge left free. */
  isInView(shape, pose) {
    const [x0, y0, x1, y1] = boxOf(outlineAt(shape, pose).map(corner => this.at(corner)));
    return Math.min(x0, y0, this.width - x1, this.height - y1) >= this.margin / 2;
  }

  /** Add an element to the scene. */
  add(name, attributes, text = '') {
    this.scene.append(createSvg(name, attributes, text));
  }

  /** Draw lines at round metres, the axes stronger. */
  drawGrid() {
    const step = Math.max(niceLength(90 / this.scale), 0.1);
    const [halfWidth, halfHeight] = [this.width / 2 / this.scale, this.height / 2 / this.scale];
    const [mx, my] = this.middle;
    for (let n = Math.ceil((mx - halfWidth) / step); n * step <= mx + halfWidth; n += 1) {
      const x = this.at([n * step, 0])[0];
      const kind = n === 0 ? 'axis-line' : 'grid-line';
      this.add('line', {class: kind, x1: x, x2: x, y1: 0, y2: this.height});
    }
    for (let n = Math.ceil((my - halfHeight) / step); n * step <= my + halfHeight; n += 1) {
      const y = this.at([0, n * step])[1];
      const kind = n === 0 ? 'axis-line' : 'grid-line';
      this.add('line', {class: kind, x1: 0, x2: this.width, y1: y, y2: y});
    }
  }

  /** Draw the scale bar at the lower left. */
  drawScaleBar() {
    const length = niceLength(Math.min(this.width / 4, 140) / this.scale);
    const pixels = length * this.scale;
    const y = this.height - 12;
    this.add('path', {class: 'halo scale-bar', d: `M14,${y - 5} v5 h${pixels} v-5`});
    this.add('path', {class: 'scale-bar', d: `M14,${y - 5} v5 h${pixels} v-5`});
    this.add('text', {class: 'scale-text halo', x: 22 + pixels, y}, lengthText(length));
  }

  /** Say that there is nothing to draw yet. */
  drawEmpty(text) {
    const place = {x: this.width / 2, y: 30, 'text-anchor': 'middle'};
    this.add('text', {class: 'empty-text halo', ...place}, text);
  }
}

/** Return a length as a label. */
function lengthText(length) {
  return length < 1 ? `${Math.round(length * 100)} cm` : `${length} m`;
}
