// SPDX-License-Identifier: Apache-2.0
// A rig of four cameras as marker files: a wand is waved, and then lies on the floor at three places.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { add, cross, length, normalized, scale, subtract, times, type Mat3, type Vec3 } from '../src/view/geometry';

const image = { width: 1280, height: 1024 };
const focalPx = 1000;
const k1 = -0.12;
const rateHz = 50;
const wavedS = 20;
const places = 3;
const placeS = 2;
/** Radius of the markers: so high are their centres when they lie on the floor. */
export const radiusM = 0.02;
const markersM = [0, 0.13, 0.39];

interface Camera {
  name: string;
  centre: Vec3;
  camFromRoom: Mat3;
}

/** Cameras in the corners of a room of 5 m, looking at its middle; room: z up. */
const cameras: readonly Camera[] = [0, 1, 2, 3].map((i) => {
  const angle = 0.6 + (i * Math.PI) / 2;
  const centre: Vec3 = [3.2 * Math.cos(angle), 3.2 * Math.sin(angle), 2.1 + 0.15 * i];
  const forward = normalized(subtract([0, 0, 0.6], centre));
  const right = normalized(cross(forward, [0, 0, 1]));
  return { name: `cam${i}`, centre, camFromRoom: [right, cross(forward, right), forward] };
});

/** The same numbers in each run. */
function noise(): () => number {
  let state = 12345;
  const uniform = (): number => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state + 0.5) / 2 ** 32;
  };
  return () => Math.sqrt(-2 * Math.log(uniform())) * Math.cos(2 * Math.PI * uniform());
}

/** Where the wand begins and which way it points. */
function wandAt(timeS: number): { start: Vec3; along: Vec3 } {
  if (timeS < wavedS) {
    const [a, b] = [1.1 * timeS + Math.sin(0.5 * timeS), 0.9 * Math.sin(0.8 * timeS)];
    return { start: [0.7 * Math.sin(0.9 * timeS), 0.7 * Math.cos(0.67 * timeS), 0.8 + 0.5 * Math.sin(1.3 * timeS)],
      along: [Math.cos(a) * Math.cos(b), Math.sin(a) * Math.cos(b), Math.sin(b)] };
  }
  const place = Math.min(places - 1, Math.floor((timeS - wavedS) / placeS));
  const angle = 0.3 + 2.1 * place;
  return { start: [0.8 * Math.cos(angle), 0.8 * Math.sin(angle), radiusM], along: [Math.cos(angle + 1.7), Math.sin(angle + 1.7), 0] };
}

function pixelOf(camera: Camera, point: Vec3): readonly [number, number] | undefined {
  const [x, y, z] = times(camera.camFromRoom, subtract(point, camera.centre));
  if (z < 0.1) return undefined;
  const [u, v] = [x / z, y / z];
  const distortion = 1 + k1 * (u * u + v * v);
  const pixel = [focalPx * u * distortion + (image.width - 1) / 2, focalPx * v * distortion + (image.height - 1) / 2] as const;
  return pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < image.width - 1 && pixel[1] < image.height - 1 ? pixel : undefined;
}

/** Writes <camera>.csv and <camera>.yaml of each camera; returns the names. */
export function writeRecordedRig(folder: string): string[] {
  for (const camera of cameras) {
    const gauss = noise();
    const lines: string[] = [];
    for (let row = 0; row < rateHz * (wavedS + places * placeS); ++row) {
      const { start, along } = wandAt(row / rateHz);
      const pixels = markersM.map((m) => pixelOf(camera, add(start, scale(along, m / length(along)))));
      lines.push([row * (1e9 / rateHz) + 1e12, ...pixels.flatMap((pixel) => (pixel ? pixel.map((v) => (v + 0.2 * gauss()).toFixed(4)) : ['-1', '-1']))].join(';'));
    }
    writeFileSync(join(folder, `${camera.name}.csv`), `${lines.join('\n')}\n`);
    const matrix = (rows: number, columns: number, data: readonly number[]): string =>
      `!!opencv-matrix\n   rows: ${rows}\n   cols: ${columns}\n   dt: d\n   data: [ ${data.join(', ')} ]`;
    writeFileSync(join(folder, `${camera.name}.yaml`), ['%YAML:1.0', '---', `image_width: ${image.width}`, `image_height: ${image.height}`,
      `camera_matrix: ${matrix(3, 3, [focalPx, 0, (image.width - 1) / 2, 0, focalPx, (image.height - 1) / 2, 0, 0, 1])}`,
      `distortion_coefficients: ${matrix(1, 5, [k1, 0, 0, 0, 0])}`, ''].join('\n'));
  }
  return cameras.map((camera) => camera.name);
}
