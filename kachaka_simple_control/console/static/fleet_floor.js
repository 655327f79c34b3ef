// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The floor of a fleet to scale: robots, where they are to drive and where they have driven. */

import {createSvg} from './dom.js';
import {drawFloor, withFloor} from './floor_map.js';
import {boxOf, joinBoxes, outlineAt, sizeText} from './geometry.js';
import {ARROW, ScaleDrawing} from './scale_drawing.js';

/** The area that is shown before there is a fleet [m]. */
const EMPTY_BOX = [-2, -1.5, 2, 1.5];
/** Points of a driven path closer than this are not kept [m]. */
const TRAIL_STEP = 0.01;
/** A robot that is farther away than this was not driven there: the path begins anew [m]. */
const TRAIL_GAP = 0.5;
/** A driven path is drawn in parts of so many points: only the last one changes. */
const TRAIL_PART = 50;
/** So many parts of each robot are kept. */
const MOST_TRAIL_PARTS = 40;
/** How often it is decided anew which names have room [ms]. */
const NAMES_PERIOD = 400;
/** The size of a name [px]: of a character, and its height. */
const [NAME_CHARACTER, NAME_HEIGHT] = [7.2, 13];
/** Robots that are drawn shorter than this have thin lines, and most have no names [px]. */
const SMALL = 15;

/** Draws what does not move in a scene, and the rest in metres, which needs no new drawing. */
export class FleetFloor extends ScaleDrawing {
  /** @param {SVGElement} svg */
  constructor(svg) {
    super(svg);
    this.margin = 24;
    this.fleet = null;
    this.robots = [];
    this.selected = null;
    this.namesAt = -Infinity;
    /** Is called with the name of a robot that was clicked. */
    this.onSelect = () => {};
    this.world = createSvg('g', {class: 'world'});
    this.layers = Object.fromEntries(['floor', 'paths', 'trails', 'bodies'].map(name => {
      const layer = createSvg('g');
      this.world.append(layer);
      return [name, layer];
    }));
    this.names = createSvg('g');
    svg.append(this.world, this.names);
  }

  /** Show a fleet: its planned paths, and its robots where they are to start. */
  setFleet(fleet) {
    this.fleet = fleet;
    for (const layer of [...Object.values(this.layers), this.names]) layer.replaceChildren();
    this.robots = fleet.robots.map(robot => this.makeRobot(robot));
    this.area = this.robots.map(robot => robot.box).reduce(joinBoxes, this.robots[0].box);
    drawFloor(this.layers.floor, fleet.floor ?? null);
    this.view = fleet.floor ? withFloor(fleet.floor, this.area, point => point) : this.area;
    const [x0, y0, x1, y1] = this.area;
    this.svg.style.setProperty('--aspect', String((x1 - x0) / (y1 - y0)));
    this.svg.setAttribute('aria-label', `The floor from above: ${this.robots.length} robots on ` +
      sizeText(this.area));
    this.select(null);
    this.draw();
  }

  /** Return a robot with its elements, at its start. */
  makeRobot({name, start, path, outline}) {
    const shape = outline === null ? ARROW : this.fleet.outlines[outline];
    const xs = shape.map(([x]) => x);
    const [front, back] = [Math.max(...xs), Math.min(...xs)];
    const side = Math.max(...shape.map(([, y]) => y));
    const reach = Math.max(...shape.map(([x, y]) => Math.hypot(x, y)));
    const [x0, y0, x1, y1] = boxOf([start, ...path]);
    const body = createSvg('g', {class: 'floor-robot'});
    const tip = front - 0.12 * (front - back);
    const base = front - 0.5 * (front - back);
    body.append(
      createSvg('circle', {class: 'floor-ring', r: reach * 1.25}),
      createSvg('path', {class: 'floor-body', d: `M${pointsText(shape)} Z`}),
      createSvg('path', {class: 'floor-nose', d: `M${pointsText([
        [tip, 0], [base, side * 0.62], [base, -side * 0.62]])} Z`}),
      createSvg('title', {}, name));
    body.addEventListener('click', () => this.onSelect(name));
    this.layers.bodies.append(body);
    if (path.length > 1) {
      this.layers.paths.append(
        createSvg('polyline', {class: 'floor-path', points: pointsText(path)}));
    }
    const trail = createSvg('g');
    this.layers.trails.append(trail);
    const label = createSvg('text', {class: 'floor-name halo', 'text-anchor': 'middle'}, name);
    this.names.append(label);
    return {
      name, start, shape, reach, body, trail, label, pose: start, points: [], isNameBelow: false,
      box: [x0 - reach, y0 - reach, x1 + reach, y1 + reach]};
  }

  /** Forget the driven paths. */
  restart() {
    for (const robot of this.robots) {
      robot.points = [];
      robot.trail.replaceChildren();
    }
  }

  /**
   * Show where the robots are, and how they are.
   * @param {(number[]|null)[]} poses null: at its start, as far as is known
   * @param {string[]} tones
   * @param {boolean[]} areTroubled
   * @param {boolean} isDriving whether they drive since t = 0: before, a pose may be an older one
   */
  update(poses, tones, areTroubled, isDriving) {
    let isOutside = false;
    for (const [place, robot] of this.robots.entries()) {
      const pose = poses[place] ?? null;
      robot.pose = pose ?? robot.start;
      robot.isTroubled = areTroubled[place];
      setData(robot.body, 'tone', tones[place]);
      setData(robot.body, 'seen', String(pose !== null));
      setData(robot.body, 'trouble', String(robot.isTroubled));
      if (pose !== null) {
        if (isDriving) this.extendTrail(robot, pose);
        isOutside ||= !this.isInView(robot.shape, pose);
      }
    }
    if (isOutside) {
      this.view = joinBoxes(this.view, boxOf(this.robots.flatMap(
        ({shape, pose}) => outlineAt(shape, pose))));
      this.draw();
    } else {
      this.place();
    }
  }

  /** Add a pose to the driven path of a robot. */
  extendTrail(robot, [x, y]) {
    const last = robot.points.at(-1);
    const step = last === undefined ? Infinity : Math.hypot(x - last[0], y - last[1]);
    if (step < TRAIL_STEP) return;
    if (step > TRAIL_GAP || robot.points.length >= TRAIL_PART) {
      robot.points = step > TRAIL_GAP ? [] : [last];
      robot.trail.append(createSvg('polyline', {class: 'floor-trail'}));
      if (robot.trail.childElementCount > MOST_TRAIL_PARTS) robot.trail.firstElementChild.remove();
    }
    robot.points.push([x, y]);
    robot.trail.lastElementChild.setAttribute('points', pointsText(robot.points));
  }

  /** Mark a robot by its name; none if that is null. */
  select(name) {
    this.selected = name;
    for (const robot of this.robots) setData(robot.body, 'selected', String(robot.name === name));
    this.namesAt = -Infinity;
    if (this.scale !== undefined) this.place();
  }

  /** Fit all into the picture, and draw it. */
  draw() {
    this.begin(this.view ?? EMPTY_BOX);
    this.isSmall = this.robots.some(({reach}) => 2 * reach * this.scale < SMALL);
    setData(this.svg, 'small', String(this.isSmall));
    if (this.fleet === null) this.drawEmpty('No fleet yet');
    else this.drawArea();
    this.drawScaleBar();
    const [x, y] = this.at([0, 0]);
    this.world.setAttribute('transform', `matrix(${this.scale} 0 0 ${-this.scale} ${x} ${y})`);
    this.namesAt = -Infinity;
    this.place();
  }

  /** Draw the area that the robots need. */
  drawArea() {
    const [left, top] = this.at([this.area[0], this.area[3]]);
    const [right, bottom] = this.at([this.area[2], this.area[1]]);
    this.add('rect', {
      class: 'area-box', x: left, y: top, width: right - left, height: bottom - top});
  }

  /** Put robots and names where they are. */
  place() {
    const now = performance.now();
    if (now - this.namesAt >= NAMES_PERIOD) {
      this.namesAt = now;
      this.chooseNames();
    }
    for (const robot of this.robots) {
      const [x, y, heading] = robot.pose;
      const turn = (heading * 180 / Math.PI).toFixed(1);
      robot.body.setAttribute('transform', `translate(${x} ${y}) rotate(${turn})`);
      const [left, , right, bottom] = this.nameBox(robot, robot.isNameBelow);
      robot.label.setAttribute('x', ((left + right) / 2).toFixed(1));
      robot.label.setAttribute('y', (bottom - 2).toFixed(1));
    }
  }

  /** Return the box of a robot's name, above or below it [px]: x0, y0, x1, y1. */
  nameBox({pose, reach, name}, isBelow) {
    const [x, y] = this.at(pose);
    const away = reach * this.scale + 2;
    const bottom = isBelow ? y + away + NAME_HEIGHT : y - away;
    const half = name.length * NAME_CHARACTER / 2 + 2;
    return [x - half, bottom - NAME_HEIGHT, x + half, bottom];
  }

  /** Show the names that have room: first of the selected robot and of those in trouble. */
  chooseNames() {
    const rank = robot => robot.name === this.selected ? 0 : robot.isTroubled ? 1 : 2;
    // No name covers another one, or a robot: a square in the circle around it is kept free.
    const taken = this.robots.map(({pose, reach}) => {
      const [[x, y], half] = [this.at(pose), 0.7 * reach * this.scale];
      return [x - half, y - half, x + half, y + half];
    });
    for (const robot of [...this.robots].sort((one, other) => rank(one) - rank(other))) {
      const isFree = isBelow => {
        const box = this.nameBox(robot, isBelow);
        return !taken.some(other => overlap(box, other));
      };
      // As before, if there is room: a name that jumps is hard to read.
      const places = [robot.isNameBelow, !robot.isNameBelow].filter(isFree);
      robot.isNameBelow = places[0] ?? robot.isNameBelow;
      const isShown = rank(robot) < 2 || (!this.isSmall && places.length > 0);
      setData(robot.label, 'shown', String(isShown));
      if (isShown) taken.push(this.nameBox(robot, robot.isNameBelow));
    }
  }
}

/** Return whether two boxes overlap. */
function overlap([x0, y0, x1, y1], [u0, v0, u1, v1]) {
  return x0 < u1 && u0 < x1 && y0 < v1 && v0 < y1;
}

/** Return points in metres as the text of a polyline or path. */
function pointsText(points) {
  return points.map(([x, y]) => `${x.toFixed(4)},${y.toFixed(4)}`).join(' ');
}

/** Set a data attribute, only when it differs. */
function setData(element, name, value) {
  if (element.dataset[name] !== value) element.dataset[name] = value;
}
