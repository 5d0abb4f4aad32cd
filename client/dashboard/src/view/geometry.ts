// SPDX-License-Identifier: Apache-2.0
// Poses of cameras in the rig frame. Frames: cam is x right, y down, z forward.
import type { Quaternion, RigidTransform, Vector3 } from '../api/types';

/** x y z. */
export type Vec3 = readonly [number, number, number];
/** Rows of a rotation matrix. */
export type Mat3 = readonly [Vec3, Vec3, Vec3];

/** A message as three numbers; missing ones are 0. */
export function toVec3(v: Vector3 | undefined): Vec3 {
  return [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];
}

export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
export const length = (a: Vec3): number => Math.sqrt(dot(a, a));
export const cross = (a: Vec3, b: Vec3): Vec3 =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Of length 1; a zero vector stays. */
export function normalized(a: Vec3): Vec3 {
  const n = length(a);
  return n > 0 ? scale(a, 1 / n) : a;
}

/** Rotation matrix of a quaternion; undefined where it is not set. */
export function rotationOf(q: Quaternion | undefined): Mat3 | undefined {
  if (!q) return undefined;
  let [w, x, y, z] = [q.w ?? 0, q.x ?? 0, q.y ?? 0, q.z ?? 0];
  const n = Math.hypot(w, x, y, z);
  if (!(n > 0)) return undefined;
  [w, x, y, z] = [w / n, x / n, y / n, z / n];
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

export const transposed = (m: Mat3): Mat3 => [
  [m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]];
export const times = (m: Mat3, v: Vec3): Vec3 => [dot(m[0], v), dot(m[1], v), dot(m[2], v)];
export function product(a: Mat3, b: Mat3): Mat3 {
  const columns = transposed(b);
  return a.map((row) => columns.map((column) => dot(row, column))) as unknown as Mat3;
}

/** A pose as a rotation and a translation: x_in_target = r * x_in_source + t. */
export interface Pose {
  r: Mat3;
  t: Vec3;
}

/** Undefined where the rotation is not known. */
export function poseOf(transform: RigidTransform | undefined): Pose | undefined {
  const r = rotationOf(transform?.rotation);
  return r ? { r, t: toVec3(transform?.translation_m) } : undefined;
}

/** The other way round. */
export function inverse({ r, t }: Pose): Pose {
  const back = transposed(r);
  return { r: back, t: scale(times(back, t), -1) };
}

/** c_from_b * b_from_a. */
export function compose(outer: Pose, inner: Pose): Pose {
  return { r: product(outer.r, inner.r), t: add(times(outer.r, inner.t), outer.t) };
}

/** Angle of a rotation, radians. */
export function rotationAngle(r: Mat3): number {
  const sine = 0.5 * Math.hypot(r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
  return Math.atan2(sine, 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1));
}

/** A camera to draw. */
export interface DrawnCamera {
  name: string;
  /** rig_from_cam: axes of the camera in its columns, and its centre. */
  rigFromCam: Pose;
  /** Half the field of view as tangents. */
  halfWidth: number;
  halfHeight: number;
}

/** A camera from its pose, image size and focal length (pixels); undefined without a pose. */
export function drawnCamera(name: string, camFromRig: RigidTransform | undefined, width: number,
  height: number, focalPx: number): DrawnCamera | undefined {
  const pose = poseOf(camFromRig);
  if (!pose) return undefined;
  const focal = focalPx > 0 ? focalPx : Math.max(width, height, 1);
  return { name, rigFromCam: inverse(pose), halfWidth: 0.5 * (width || focal) / focal,
    halfHeight: 0.5 * (height || focal) / focal };
}

/** Rows: right, forward (both level) and up of a room, in the rig frame. Cameras mostly stand upright:
 * up is against the mean of their y axes, forward is where the first one looks. */
export function roomFromRig(cameras: readonly DrawnCamera[]): Mat3 {
  let down: Vec3 = [0, 0, 0];
  for (const { rigFromCam: { r } } of cameras) down = add(down, [r[0][1], r[1][1], r[2][1]]);
  // Cameras that cancel each other out say nothing.
  const up: Vec3 = length(down) > 0.2 * cameras.length && length(down) > 0
    ? normalized(scale(down, -1)) : [0, -1, 0];
  const first = cameras[0]?.rigFromCam.r;
  let forward: Vec3 = first ? [first[0][2], first[1][2], first[2][2]] : [0, 0, 1];
  forward = subtract(forward, scale(up, dot(forward, up)));
  if (length(forward) < 1e-3) {
    const other: Vec3 = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 0, 1];
    forward = subtract(other, scale(up, dot(other, up)));
  }
  forward = normalized(forward);
  return [normalized(cross(forward, up)), forward, up];
}

/** Smallest box around points; undefined without any. */
export function boxOf(points: readonly Vec3[]): { min: Vec3; max: Vec3 } | undefined {
  if (points.length === 0) return undefined;
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (let k = 0; k < 3; ++k) {
      min[k] = Math.min(min[k]!, point[k]!);
      max[k] = Math.max(max[k]!, point[k]!);
    }
  }
  return { min: min as unknown as Vec3, max: max as unknown as Vec3 };
}
