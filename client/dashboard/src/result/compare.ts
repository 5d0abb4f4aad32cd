// SPDX-License-Identifier: Apache-2.0
// What differs between two calibrations, camera by camera.
import type { CalibratedCamera, Calibration } from '../api/types';
import { compose, inverse, length, poseOf, rotationAngle, subtract } from '../view/geometry';

/** Difference of a camera: this calibration minus the other. Undefined: only one has it. */
export interface CameraDifference {
  camera: string;
  /** Distance between the two centres, relative to the common camera, millimetres. */
  positionMm: number | undefined;
  /** That distance in combined sigmas of both calibrations. */
  positionSigmas: number | undefined;
  /** Angle between the two orientations, degrees. */
  rotationDeg: number | undefined;
  /** Focal length, per cent. */
  focalPercent: number | undefined;
  /** Time offset, milliseconds. */
  timeMs: number | undefined;
  /** Held-out error, pixels. */
  heldOutPx: number | undefined;
}

/** A comparison of two calibrations. */
export interface Comparison {
  /** Both are seen from this camera. Empty: they have none in common. */
  reference: string;
  cameras: CameraDifference[];
}

const byName = (calibration: Calibration): Map<string, CalibratedCamera> =>
  new Map((calibration.cameras ?? []).map((camera) => [camera.camera ?? '', camera]));

function sigmaM(camera: CalibratedCamera): number {
  const sigma = camera.uncertainty?.position_sigma_m;
  return sigma ? Math.hypot(sigma.x ?? 0, sigma.y ?? 0, sigma.z ?? 0) : 0;
}

/** Compares both as seen from one camera that both have: where possible the reference camera of the
 * first, so that a rig that was turned as a whole shows no difference. */
export function compareCalibrations(one: Calibration, other: Calibration): Comparison {
  const [first, second] = [byName(one), byName(other)];
  const common = [...first.keys()].filter((name) => poseOf(first.get(name)?.cam_from_rig) &&
    poseOf(second.get(name)?.cam_from_rig)).sort();
  const reference = common.includes(one.reference_camera ?? '') ? one.reference_camera! : (common[0] ?? '');
  const referenceOne = poseOf(first.get(reference)?.cam_from_rig);
  const referenceOther = poseOf(second.get(reference)?.cam_from_rig);
  const metric = Boolean(one.scale_known && other.scale_known);
  const cameras = [...new Set([...first.keys(), ...second.keys()])].sort().map((name): CameraDifference => {
    const [a, b] = [first.get(name), second.get(name)];
    const [poseA, poseB] = [poseOf(a?.cam_from_rig), poseOf(b?.cam_from_rig)];
    const difference: CameraDifference = { camera: name, positionMm: undefined, positionSigmas: undefined,
      rotationDeg: undefined, focalPercent: undefined, timeMs: undefined, heldOutPx: undefined };
    if (!a || !b) return difference;
    if (poseA && poseB && referenceOne && referenceOther) {
      const inOne = inverse(compose(poseA, inverse(referenceOne)));
      const inOther = inverse(compose(poseB, inverse(referenceOther)));
      difference.rotationDeg = (rotationAngle(compose(inverse(inOne), inOther).r) * 180) / Math.PI;
      if (metric) {
        const distance = length(subtract(inOne.t, inOther.t));
        difference.positionMm = distance * 1e3;
        const sigma = Math.hypot(sigmaM(a), sigmaM(b));
        if (sigma > 0 && name !== reference) difference.positionSigmas = distance / sigma;
      }
    }
    const [fa, fb] = [a.intrinsics?.fx_px, b.intrinsics?.fx_px];
    if (fa && fb) difference.focalPercent = (fa / fb - 1) * 100;
    difference.timeMs = ((a.time_offset_s ?? 0) - (b.time_offset_s ?? 0)) * 1e3;
    if (a.held_out?.marker_count && b.held_out?.marker_count) {
      difference.heldOutPx = (a.held_out.mean_px ?? 0) - (b.held_out.mean_px ?? 0);
    }
    return difference;
  });
  return { reference, cameras };
}
