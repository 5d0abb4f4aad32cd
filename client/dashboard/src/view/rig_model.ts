// SPDX-License-Identifier: Apache-2.0
// What the 3-D view and the plan draw, made from the running estimate or from a calibration.
import type { Calibration, GetAccuracyResponse, LiveCamera, LiveEstimate } from '../api/types';
import { add, type DrawnCamera, drawnCamera, roomFromRig, times, toVec3, type Mat3, type Vec3 } from './geometry';

/** A place with an expected error. */
export interface ErrorPlace {
  /** Room frame: x right, y forward, z up, metres. */
  at: Vec3;
  /** One sigma, millimetres. */
  sigmaMm: number;
  /** The wand has been there. */
  waved: boolean;
}

/** Everything in the room frame (x right, y forward, z up), metres. */
export interface RigModel {
  cameras: DrawnCamera[];
  places: ErrorPlace[];
  /** Edge of the grid of places. */
  stepM: number;
  wand: Vec3[];
  worst: Vec3 | undefined;
  advice: Vec3[];
  /** By camera: one sigma of its centre along the axes of the rig frame, as three half axes. */
  ellipsoids: Map<string, readonly [Vec3, Vec3, Vec3]>;
  /** The rig frame: its origin, and its axes of length 1. */
  frame: { origin: Vec3; axes: readonly [Vec3, Vec3, Vec3] };
  /** Somebody has set that frame: z is up, and z = 0 is the floor. */
  frameIsSet: boolean;
}

/** z is up already. */
const asItIs: Mat3 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
/** Frames that nobody has set: those of a camera. */
const ofACamera: readonly unknown[] = [undefined, 'FRAME_SOURCE_UNSPECIFIED', 'FRAME_SOURCE_NOT_KEPT'];

const frameIn = (room: Mat3): RigModel['frame'] =>
  ({ origin: [0, 0, 0], axes: [times(room, [1, 0, 0]), times(room, [0, 1, 0]), times(room, [0, 0, 1])] });

function intoRoom(room: Mat3, cameras: DrawnCamera[]): DrawnCamera[] {
  return cameras.map((camera) => {
    const { r, t } = camera.rigFromCam;
    const columns = [0, 1, 2].map((k) => times(room, [r[0][k]!, r[1][k]!, r[2][k]!] as Vec3));
    const rows = [0, 1, 2].map((k) => columns.map((column) => column[k]!)) as unknown as Mat3;
    return { ...camera, rigFromCam: { r: rows, t: times(room, t) } };
  });
}

const isCamera = (camera: DrawnCamera | undefined): camera is DrawnCamera => camera !== undefined;

/** The model of the running estimate. Where nobody waves, there is neither a wand nor a place to wave at. */
export function modelOfEstimate(estimate: LiveEstimate | undefined, live: readonly LiveCamera[], waving = true): RigModel {
  const sizes = new Map(live.map((camera) => [camera.camera, camera.image_size_px]));
  const cameras = (estimate?.cameras ?? []).map((camera) => {
    const size = sizes.get(camera.camera);
    return drawnCamera(camera.camera ?? '', camera.cam_from_rig, size?.width ?? 0, size?.height ?? 0,
      camera.focal_length_px ?? 0);
  }).filter(isCamera);
  const room = roomFromRig(cameras);
  const volume = estimate?.volume;
  const places: ErrorPlace[] = [];
  const [nx, ny] = [volume?.count_x ?? 0, volume?.count_y ?? 0];
  const step = volume?.step_m ?? 0;
  const origin = toVec3(volume?.origin_m);
  const sigmas = volume?.sigma_mm ?? [];
  for (let i = 0; i < Math.min(sigmas.length, 4096) && nx * ny > 0; ++i) {
    const sigmaMm = Number(sigmas[i]);
    if (!(sigmaMm > 0)) continue;
    const index: Vec3 = [i % nx, Math.floor(i / nx) % ny, Math.floor(i / (nx * ny))];
    places.push({ at: times(room, add(origin, [index[0] * step, index[1] * step, index[2] * step])),
      sigmaMm, waved: (volume?.wand_counts?.[i] ?? 0) > 0 });
  }
  return {
    cameras: intoRoom(room, cameras), places, stepM: step,
    wand: (waving ? estimate?.wand_m ?? [] : []).map((point) => times(room, toVec3(point))),
    worst: volume?.worst_point_m ? times(room, toVec3(volume.worst_point_m)) : undefined,
    advice: (waving ? estimate?.advice ?? [] : []).filter((advice) => advice.point_m)
      .map((advice) => times(room, toVec3(advice.point_m))),
    ellipsoids: new Map(), frame: frameIn(room), frameIsSet: false,
  };
}

/** The model of a calibration, with its expected errors where they are known. */
export function modelOfCalibration(calibration: Calibration, accuracy: GetAccuracyResponse | undefined): RigModel {
  const drawn = (calibration.cameras ?? []).map((camera) => drawnCamera(camera.camera ?? '',
    camera.cam_from_rig, camera.image_size_px?.width ?? 0, camera.image_size_px?.height ?? 0,
    camera.intrinsics?.fx_px ?? 0)).filter(isCamera);
  const frameIsSet = !ofACamera.includes(calibration.frame?.source);
  const room = frameIsSet ? asItIs : roomFromRig(drawn);
  const ellipsoids = new Map<string, readonly [Vec3, Vec3, Vec3]>();
  for (const camera of calibration.cameras ?? []) {
    const sigma = camera.uncertainty?.position_sigma_m;
    if (!sigma) continue;
    ellipsoids.set(camera.camera ?? '', [times(room, [sigma.x ?? 0, 0, 0]), times(room, [0, sigma.y ?? 0, 0]),
      times(room, [0, 0, sigma.z ?? 0])]);
  }
  // The same figure as that of a running estimate, so that a place has one colour on both pages.
  const places = (accuracy?.grid ?? []).filter((point) => (point.calibration_total_m ?? 0) > 0).map((point): ErrorPlace => ({
    at: times(room, toVec3(point.point_m)), sigmaMm: (point.calibration_total_m ?? 0) * 1e3, waved: true }));
  const worst = places.reduce<ErrorPlace | undefined>((most, one) => (most && most.sigmaMm >= one.sigmaMm ? most : one), undefined);
  return {
    cameras: intoRoom(room, drawn),
    places,
    stepM: accuracy?.grid_step_m ?? 0,
    wand: [],
    worst: worst?.at,
    advice: [],
    ellipsoids, frame: frameIn(room), frameIsSet,
  };
}

