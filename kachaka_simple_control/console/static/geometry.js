// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Plane geometry for the plan: poses are [x, y, heading] in metres and radians, x ahead. */

/** The lengths that a scale bar or a grid may have [m]. */
const NICE_LENGTHS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

/**
 * Return the corners of an outline at a pose [m].
 * @param {number[][]} footprint
 * @param {number[]} pose
 * @returns {number[][]}
 */
export function outlineAt(footprint, [x, y, heading]) {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  return footprint.map(([ahead, left]) => [
    x + cos * ahead - sin * left, y + sin * ahead + cos * left]);
}

/**
 * Return a pose as it is seen from another one.
 * @param {number[]} origin
 * @param {number[]} pose
 * @returns {number[]}
 */
export function relativeTo([x0, y0, heading], [x, y, theta]) {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  return [
    cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0), theta - heading];
}

/**
 * Return the smallest and largest x and y of points: x0, y0, x1, y1.
 * @param {number[][]} points
 */
export function boxOf(points) {
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x, y] of points) {
    x0 = Math.min(x0, x);
    y0 = Math.min(y0, y);
    x1 = Math.max(x1, x);
    y1 = Math.max(y1, y);
  }
  return [x0, y0, x1, y1];
}

/**
 * Return the box around two boxes.
 * @param {number[]} one
 * @param {number[]} other
 */
export function joinBoxes(one, other) {
  return [
    Math.min(one[0], other[0]), Math.min(one[1], other[1]),
    Math.max(one[2], other[2]), Math.max(one[3], other[3])];
}

/**
 * Return the size of a box as text, rounded up to a centimetre.
 * @param {number[]} box
 */
export function sizeText([x0, y0, x1, y1]) {
  const size = [x1 - x0, y1 - y0].map(length => (Math.ceil(length * 100 - 1e-6) / 100).toFixed(2));
  return `${size[0]} m × ${size[1]} m`;
}

/**
 * Return the largest nice length that is at most a length [m].
 * @param {number} most
 */
export function niceLength(most) {
  return NICE_LENGTHS.filter(length => length <= most).at(-1) ?? NICE_LENGTHS[0];
}

/**
 * Return the arrows on a path: poses whose heading is the direction of travel.
 * @param {number[][]} points
 * @param {number} spacing between two arrows [m]
 */
export function arrowsOn(points, spacing) {
  const arrows = [];
  let due = spacing / 2;
  for (let place = 1; place < points.length; place += 1) {
    const [[x0, y0], [x1, y1]] = [points[place - 1], points[place]];
    const length = Math.hypot(x1 - x0, y1 - y0);
    while (length > 0 && due <= length) {
      const share = due / length;
      arrows.push([x0 + (x1 - x0) * share, y0 + (y1 - y0) * share, Math.atan2(y1 - y0, x1 - x0)]);
      due += spacing;
    }
    due -= length;
  }
  return arrows;
}

/**
 * Return the turns in place of a path: the place, the heading before and the turned angle.
 * @param {number[][]} points
 */
export function turnsOn(points) {
  const turns = [];
  for (let place = 1; place < points.length; place += 1) {
    const [[x0, y0, from], [x1, y1, to]] = [points[place - 1], points[place]];
    if (Math.hypot(x1 - x0, y1 - y0) > 1e-6 || Math.abs(to - from) < 1e-6) continue;
    const last = turns.at(-1);
    if (last && last.end === place - 1) {
      last.angle += to - from;
      last.end = place;
    } else {
      turns.push({x: x0, y: y0, from, angle: to - from, end: place});
    }
  }
  return turns;
}
