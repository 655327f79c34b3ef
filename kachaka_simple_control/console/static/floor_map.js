// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** What stands on the floor of simulated robots, in metres. */

import {createSvg} from './dom.js';

/** A drawing is large enough for what stands within this distance of what else it shows [m]. */
const AROUND = 0.5;

/**
 * Show what stands on a floor in a group whose unit is a metre, y upwards.
 * @param {SVGElement} group
 * @param {{walls: number[][][], posts: number[][], people: number[][]}|null} floor
 */
export function drawFloor(group, floor) {
  const {walls = [], posts = [], people = []} = floor ?? {};
  const disc = kind => ([cx, cy, r]) => createSvg('circle', {class: kind, cx, cy, r});
  group.replaceChildren(
    ...walls.map(wall => createSvg('polyline', {
      class: 'floor-wall', points: wall.map(point => point.join(',')).join(' ')})),
    ...posts.map(disc('floor-post')), ...people.map(disc('floor-person')));
}

/**
 * Return a box that is large enough for the ends of walls, posts and people near a box.
 * @param {{walls: number[][][], posts: number[][], people: number[][]}} floor
 * @param {number[]} box x0, y0, x1, y1 [m]
 * @param {function(number[]): number[]} place returns a point as it is drawn
 */
export function withFloor({walls, posts, people}, [x0, y0, x1, y1], place) {
  const box = [x0, y0, x1, y1];
  const discs = [...posts, ...people].map(([x, y, radius]) => [...place([x, y]), radius]);
  for (const [x, y, radius = 0] of [...walls.flat().map(place), ...discs]) {
    const isNear = x > x0 - AROUND && x < x1 + AROUND && y > y0 - AROUND && y < y1 + AROUND;
    if (!isNear) continue;
    box[0] = Math.min(box[0], x - radius);
    box[1] = Math.min(box[1], y - radius);
    box[2] = Math.max(box[2], x + radius);
    box[3] = Math.max(box[3], y + radius);
  }
  return box;
}
