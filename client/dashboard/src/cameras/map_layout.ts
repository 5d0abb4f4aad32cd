// SPDX-License-Identifier: Apache-2.0
// Where the dots of the map of a large rig are.
import type { DrawnCamera } from '../view/geometry';

/** Pixels from the top left. */
export type Point = readonly [number, number];

/** Dots by the name of their camera. */
export interface MapLayout {
  at: Map<string, Point>;
  /** Of the scale; undefined: the places are not known, and all dots stand in the order of their names. */
  pixelsPerMetre: number | undefined;
  /** Cameras without a place of their own, below the others. */
  unplaced: number;
}

/** Room at each side, and above and below for the words, pixels. */
const margin = { side: 16, top: 30, bottom: 30 };

/** Rows of dots in the order of their names, as square as the box allows. */
function inRows(names: readonly string[], left: number, top: number, width: number, height: number): [string, Point][] {
  const columns = Math.max(1, Math.ceil(Math.sqrt((names.length * width) / Math.max(1, height))));
  const rows = Math.max(1, Math.ceil(names.length / columns));
  return names.map((name, i): [string, Point] => [name, [left + ((i % columns) + 0.5) * (width / columns),
    top + (Math.floor(i / columns) + 0.5) * (height / rows)]]);
}

/** Lays out cameras seen from above, in a box of so many pixels. `posed`: in the room frame (x right, y forward), metres. */
export function layoutMap(names: readonly string[], posed: readonly DrawnCamera[], width: number, height: number): MapLayout {
  const known = new Map(posed.map((camera) => [camera.name, camera.rigFromCam.t]));
  const placed = names.filter((name) => known.has(name));
  const others = names.filter((name) => !known.has(name));
  const [w, h] = [Math.max(1, width - 2 * margin.side), Math.max(1, height - margin.top - margin.bottom)];
  if (placed.length < 2) {
    return { at: new Map(inRows(names, margin.side, margin.top, w, h)), pixelsPerMetre: undefined, unplaced: 0 };
  }
  // Those without a place take at most a third, by how many they are.
  const below = others.length === 0 ? 0 : Math.min(h / 3, Math.max(20, (h * others.length) / names.length));
  const [xs, ys] = [placed.map((name) => known.get(name)![0]), placed.map((name) => known.get(name)![1])];
  const bounds = { x: [Math.min(...xs), Math.max(...xs)] as const, y: [Math.min(...ys), Math.max(...ys)] as const };
  const scale = Math.min(w / Math.max(0.5, bounds.x[1] - bounds.x[0]), (h - below) / Math.max(0.5, bounds.y[1] - bounds.y[0]));
  const [mx, my] = [(bounds.x[0] + bounds.x[1]) / 2, (bounds.y[0] + bounds.y[1]) / 2];
  const at = new Map<string, Point>(placed.map((name): [string, Point] => {
    const [x, y] = known.get(name)!;
    return [name, [width / 2 + (x - mx) * scale, margin.top + (h - below) / 2 - (y - my) * scale]];
  }));
  for (const [name, point] of inRows(others, margin.side, margin.top + h - below + 8, w, below - 8)) at.set(name, point);
  return { at, pixelsPerMetre: scale, unplaced: others.length };
}

/** The camera whose dot is next to a point, within `reach` pixels; of those at one distance the first. */
export function cameraAt(layout: MapLayout, [x, y]: Point, reach: number): string | undefined {
  let nearest: string | undefined;
  let least = reach;
  for (const [name, [px, py]] of layout.at) {
    const distance = Math.hypot(px - x, py - y);
    if (distance < least || (distance === least && nearest === undefined)) [nearest, least] = [name, distance];
  }
  return nearest;
}
