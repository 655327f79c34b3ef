// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** The plan to scale: path, direction, outline, area, grid and scale bar, and the live robot. */

import {createSvg} from './dom.js';
import {drawFloor, withFloor} from './floor_map.js';
import {
  arrowsOn, boxOf, joinBoxes, outlineAt, relativeTo, sizeText, turnsOn,
} from './geometry.js';
import {ARROW, ScaleDrawing} from './scale_drawing.js';

/** The area that is shown before there is a plan [m]. */
const EMPTY_BOX = [-1, -0.75, 1, 0.75];
/** Points of the driven path closer than this are not kept [m]. */
const TRAIL_STEP = 0.005;
const MOST_TRAIL_POINTS = 6_000;
/** So many places are marked where the robot was held. */
const MOST_HELD_MARKS = 50;

/** The plan of a motion, and one robot. */
export class PlanView extends ScaleDrawing {
  /** @param {SVGElement} svg */
  constructor(svg) {
    super(svg);
    this.plan = null;
    this.footprint = null;
    this.shape = ARROW;
    this.trail = [];
    this.poses = {planned: null, driven: null};
    this.origin = null;
    this.floor = null;
    this.floorGroup = createSvg('g', {class: 'floor-map'});
    this.scan = null;
    /** Where the robot was held, as it is told. */
    this.heldPoses = [];
    this.isHeld = false;
    this.live = createSvg('g');
    this.scanPoints = createSvg('path', {class: 'scan-points'});
    this.heldMarks = createSvg('path', {class: 'held-mark'});
    this.trailLine = createSvg('polyline', {class: 'driven-line'});
    this.bodies = {
      planned: createSvg('path', {class: 'robot-planned'}),
      driven: createSvg('path', {class: 'robot-driven'})};
    this.live.append(
      this.trailLine, this.heldMarks, this.bodies.planned, this.bodies.driven, this.scanPoints);
    svg.append(this.floorGroup, this.live);
  }

  /** Return the floor area of the robot's outline: x0, y0, x1, y1 [m]; null without a plan. */
  get area() {
    return this.plan === null ? null : this.plan.box;
  }

  /** Show the outline of a robot [m]. */
  setFootprint(footprint) {
    this.footprint = footprint;
    this.shape = footprint ?? ARROW;
    this.draw();
  }

  /** Show what stands on the floor, in the frame in which poses are told; null for nothing. */
  setFloor(floor) {
    this.floor = floor;
    drawFloor(this.floorGroup, floor);
    this.draw();
  }

  /** Show a plan, or none. */
  setPlan(plan) {
    this.plan = plan;
    const label = plan === null ? 'No plan' :
      `Plan from above: area ${sizeText(this.area)}, ${plan.duration.toFixed(1)} s, ` +
      `${plan.steps} steps`;
    this.svg.setAttribute('aria-label', label);
    this.draw();
  }

  /**
   * Forget the driven path, and begin anew with the plan's start at a pose.
   * @param {number[]|null} origin the pose as it is told; null for that of the next one
   */
  restart(origin) {
    this.origin = origin;
    this.trail = [];
    this.heldPoses = [];
    this.poses = {planned: null, driven: null};
    this.draw();
  }

  /**
   * Show what the laser has seen.
   * @param {{pose: number[]|null, points: number[][]}} scan the pose as it is told
   */
  setScan(scan) {
    this.scan = scan;
    this.drawLive();
  }

  /**
   * Show how old the scan is, or none without an obstacle watch.
   * @param {{state: string}|null} watch
   */
  setWatch(watch) {
    if (watch === null) this.scan = null;
    this.scanPoints.classList.toggle('old', ['no scan', 'blind'].includes(watch?.state));
    this.drawLive();
  }

  /**
   * Mark where the robot is held; the mark stays when it goes on.
   * @param {number[]|null} toldPose where it is, as it is told; null while nothing holds it
   */
  setHeld(toldPose) {
    if (toldPose !== null) {
      const last = this.heldPoses.at(-1) ?? [Infinity, Infinity];
      const moved = Math.hypot(toldPose[0] - last[0], toldPose[1] - last[1]);
      // It brakes, so the mark moves with it; after a pause it may be held at the same place.
      if (this.isHeld || moved < TRAIL_STEP) this.heldPoses.pop();
      this.heldPoses = [...this.heldPoses.slice(1 - MOST_HELD_MARKS), toldPose];
    }
    const wasHeld = this.isHeld;
    this.isHeld = toldPose !== null;
    if (this.isHeld || wasHeld) this.drawLive();
  }

  /** Show where the robot should be and where odometry says that it is, as it is told. */
  setPoses(toldPlanned, toldDriven) {
    if (this.origin === null && toldDriven !== null) {
      this.origin = toldDriven;
      if (this.floor !== null) this.draw();
    }
    const [planned, driven] = [this.shown(toldPlanned), this.shown(toldDriven)];
    this.poses = {planned, driven};
    if (driven !== null) {
      const last = this.trail.at(-1);
      const step = last ? Math.hypot(driven[0] - last[0], driven[1] - last[1]) : Infinity;
      if (step >= TRAIL_STEP) this.trail.push(driven);
      if (this.trail.length > MOST_TRAIL_POINTS) this.trail.shift();
      if (!this.isInView(this.shape, driven)) {
        this.draw();
        return;
      }
    }
    this.drawLive();
  }

  /** Return a pose as it is drawn, from one as it is told. */
  shown(pose) {
    return pose && this.origin ? relativeTo(this.origin, pose) : pose;
  }

  /** Fit the box to the plan and the driven path, and draw all. */
  draw() {
    let box = this.area;
    if (this.trail.length > 0) {
      const [left, low, right, high] = boxOf(this.trail);
      // More than the outline needs, so that a robot that goes on is not drawn anew at each pose.
      const edge = Math.max(...this.shape.map(([x, y]) => Math.hypot(x, y))) + 0.1;
      const trailBox = [left - edge, low - edge, right + edge, high + edge];
      box = box === null ? trailBox : joinBoxes(box, trailBox);
    }
    if (this.floor !== null) {
      box = withFloor(this.floor, box ?? EMPTY_BOX, point => this.shown([...point, 0]).slice(0, 2));
    }
    this.begin(box ?? EMPTY_BOX);
    const [left, top] = this.at([0, 0]);
    const [x, y, heading] = this.origin ?? [0, 0, 0];
    this.floorGroup.setAttribute(
      'transform', `matrix(${this.scale} 0 0 ${-this.scale} ${left} ${top}) ` +
      `rotate(${degrees(-heading)}) translate(${-x} ${-y})`);
    if (this.plan === null) this.drawEmpty('No plan to show');
    else this.drawPlan();
    this.drawScaleBar();
    this.drawLive();
  }

  /** Draw area, outlines, path, arrows and turns. */
  drawPlan() {
    const {points} = this.plan;
    const [x0, y0, x1, y1] = this.area;
    const [left, top] = this.at([x0, y1]);
    const [right, bottom] = this.at([x1, y0]);
    this.add('rect', {
      class: 'area-box', x: left, y: top, width: Math.max(right - left, 1),
      height: Math.max(bottom - top, 1)});
    this.add('text', {
      class: 'area-text halo', x: (left + right) / 2, y: top - 9, 'text-anchor': 'middle',
    }, sizeText(this.area));
    if (this.footprint && points.length > 0) {
      this.add('path', {class: 'footprint end', d: this.bodyPath(points.at(-1))});
      this.add('path', {class: 'footprint', d: this.bodyPath(points[0])});
    }
    for (const turn of turnsOn(points)) this.drawTurn(turn);
    this.add('polyline', {class: 'planned-line', points: this.text(points)});
    for (const pose of arrowsOn(points, Math.max(0.25, 80 / this.scale))) this.drawArrow(pose);
    if (points.length > 0) {
      const [cx, cy] = this.at(points[0]);
      this.add('circle', {class: 'start-dot', cx, cy, r: 5.5});
    }
  }

  /** Draw an arrow in the direction of travel. */
  drawArrow(pose) {
    const [x, y] = this.at(pose);
    this.add('path', {
      class: 'arrow', d: 'M9,0 L-6,-7 L-3,0 L-6,7 Z',
      transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${degrees(-pose[2])})`});
  }

  /** Draw a turn in place as an arc with an arrow, beside the path. */
  drawTurn({x, y, from, angle}) {
    const radius = 15;
    const sweep = Math.sign(angle) * Math.min(Math.abs(angle), 5.2);
    const [cx, cy] = this.at([x, y]);
    const on = heading => [cx + radius * Math.cos(heading), cy - radius * Math.sin(heading)];
    const [start, end] = [on(from), on(from + sweep)];
    const isLarge = Math.abs(sweep) > Math.PI ? 1 : 0;
    this.add('path', {
      class: 'turn-line',
      d: `M${start} A${radius},${radius} 0 ${isLarge} ${angle > 0 ? 0 : 1} ${end}`});
    const heading = from + sweep + Math.sign(angle) * Math.PI / 2;
    this.add('path', {
      class: 'arrow', d: 'M5,0 L-4,-4.5 L-4,4.5 Z',
      transform: `translate(${end}) rotate(${degrees(-heading)})`});
  }

  /** Draw the driven path and the robot, planned and driven. */
  drawLive() {
    this.trailLine.setAttribute('points', this.text(this.trail));
    for (const [name, body] of Object.entries(this.bodies)) {
      const pose = this.poses[name];
      body.setAttribute('d', pose === null ? '' : this.bodyPath(pose));
    }
    this.heldMarks.setAttribute(
      'd', this.heldPoses.map(pose => this.bodyPath(this.shown(pose))).join(' '));
    this.scanPoints.setAttribute('d', this.scan === null ? '' : this.scanPath(this.scan));
  }

  /** Return the points of a scan as lines without a length, which are drawn as dots. */
  scanPath({pose, points}) {
    const from = this.shown(pose) ?? this.poses.driven ?? this.poses.planned ?? [0, 0, 0];
    return outlineAt(points, from).map(point => `M${this.text([point])} h0`).join(' ');
  }

  /** Return the outline at a pose with a tick ahead. */
  bodyPath(pose) {
    const front = Math.max(...this.shape.map(corner => corner[0]));
    const tick = outlineAt([[front * 0.45, 0], [front, 0]], pose);
    return `M${this.text(outlineAt(this.shape, pose))} Z M${this.text(tick)}`;
  }
}

/** Return an angle in degrees, for a transform. */
function degrees(angle) {
  return (angle * 180 / Math.PI).toFixed(1);
}
