// SPDX-License-Identifier: Apache-2.0
// Calibrations of the simulated rig.
import type { Calibration, CameraResiduals, GetAccuracyResponse } from '../src/api/types';
import { epochMs, type MockRig, quaternionOf } from './mock_rig';

/** A calibration that has succeeded; `seed` moves its figures a little. */
export function mockCalibration(rig: MockRig, id: string, version: number, sessionIds: string[], seed: number):
  Calibration {
  const cameras = rig.cameras.map((camera, i) => {
    const wobble = Math.sin(seed * 7 + i * 3);
    const t = camera.camFromRig.map((row) => -(row[0] * camera.centre[0] + row[1] * camera.centre[1] +
      row[2] * camera.centre[2])) as [number, number, number];
    const rms = 0.3 + 0.05 * i + 0.03 * wobble;
    const figures = (factor: number, count: number) => ({ mean_px: rms * 0.85 * factor, rms_px: rms * factor,
      median_px: rms * 0.75 * factor, p95_px: rms * 1.9 * factor, marker_count: count });
    return {
      camera: camera.name, image_size_px: { width: 1440, height: 1080 },
      cam_from_rig: { rotation: quaternionOf(camera.camFromRig),
        translation_m: { x: t[0] + 4e-4 * wobble, y: t[1], z: t[2] - 3e-4 * wobble } },
      intrinsics: { model: 'MODEL_BROWN_CONRADY' as const, fx_px: 1100 + wobble, fy_px: 1100, cx_px: 720, cy_px: 540,
        distortion: [-0.1, 0.02, 0, 0, 0] },
      intrinsics_refined: i % 2 === 0, clock_id: camera.name, time_offset_s: (i - 3) * 0.0021 + 1e-5 * wobble,
      time_offset_estimated: true,
      residuals: { all: figures(1.4, 4200), inlier: figures(1, 4100), observation_count: 1400, outlier_count: 100 - 9 * i },
      uncertainty: { rotation_sigma_rad: { x: 8e-5, y: 9e-5, z: 5e-5 },
        position_sigma_m: { x: 3e-4 + 5e-5 * i, y: 2e-4, z: 6e-4 }, time_offset_sigma_s: 2e-5 + 4e-6 * i },
      held_out: figures(1.1, 800), leave_one_out: figures(1.6, 800),
      observation_count: 5200, wand_count: 4300 - 120 * i,
    };
  });
  return {
    id, rig: 'rig', version, session_ids: sessionIds, state: 'STATE_SUCCEEDED', scale_known: true,
    reference_camera: cameras[0]?.camera, instant_count: 1800, cameras,
    target: { given: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39], diameter_m: 0.04 },
      marker_positions_m: [0, 0.1302, 0.3899], marker_positions_estimated: true, scale_sigma_rel: 3e-4,
      length_error_rms_m: 4.1e-4,
      spans: [{ length_m: 0.13, mean_error_m: 2e-5, error_rms_m: 3.5e-4, count: 1800, held_out_error_rms_m: 3.9e-4,
        held_out_count: 350 }, { length_m: 0.26, mean_error_m: -4e-5, error_rms_m: 4.4e-4, count: 1800,
        held_out_error_rms_m: 5.2e-4, held_out_count: 350 }] },
    findings: [
      { kind: 'FINDING_KIND_WEAK_LINK', severity: 'FINDING_SEVERITY_WARNING', camera: cameras[3]?.camera, value: 42,
        unit: 'instants', advice: `wave the wand where both ${cameras[3]?.camera} and ${cameras[4]?.camera} see it` },
      { kind: 'FINDING_KIND_INTRINSICS_REFINED', severity: 'FINDING_SEVERITY_INFO', camera: cameras[0]?.camera,
        value: 0.31, unit: 'px', advice: 'refined intrinsics fit held-out data better' }],
    observation_digest: 'e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855',
    quality: { grade: 'GRADE_USABLE', reasons: [`${cameras[3]?.camera}: weak_link, 42 common instants`] },
    wand_volume: { min_m: { x: -1.4, y: 0, z: 1.6 }, max_m: { x: 1.4, y: 1.8, z: 4.4 } },
    run: { create_time: new Date(epochMs + version * 60000).toISOString(),
      start_time: new Date(epochMs + version * 60000 + 500).toISOString(),
      end_time: new Date(epochMs + version * 60000 + 4200).toISOString(), solve_duration: '3.700s',
      software_version: '0.1.0', iteration_count: 38 },
  };
}

/** Its residuals: radial at the edge of the image, some left out. */
export function mockResiduals(calibration: Calibration): CameraResiduals[] {
  return (calibration.cameras ?? []).map((camera, c) => {
    const one: Required<CameraResiduals> = { camera: camera.camera ?? '', image_size_px: camera.image_size_px ?? {}, x_px: [], y_px: [],
      dx_px: [], dy_px: [], outlier: [], bin_px: 0.05, inlier_counts: new Array<number>(40).fill(0), outlier_counts: new Array<number>(40).fill(0) };
    // As random, the same each time.
    const noise = (i: number) => (Math.sin(i * 12.9898 + c * 78.233) * 43758.5453) % 1;
    for (let i = 0; i < 520; ++i) {
      const out = i >= 500 && c !== 1;
      const [x, y] = [720 + 700 * noise(i), 540 + 520 * noise(i + 0.5)];
      const size = out ? 4 : 0.25 + 0.05 * c;
      const [dx, dy] = [size * noise(i + 0.25) + 0.0002 * (x - 720), size * noise(i + 0.75) + 0.0002 * (y - 540)];
      one.x_px.push(x);
      one.y_px.push(y);
      one.dx_px.push(dx);
      one.dy_px.push(dy);
      one.outlier.push(out);
      const bin = Math.min(39, Math.floor(Math.hypot(dx, dy) / one.bin_px));
      if (out) one.outlier_counts[bin]! += 1;
      else one.inlier_counts[bin]! += 8;
    }
    return one;
  });
}

/** Its expected errors. */
export function mockAccuracy(id: string): GetAccuracyResponse {
  const grid = [];
  for (let x = -1.4; x < 1.5; x += 0.4) {
    for (let y = 0; y < 1.9; y += 0.4) {
      for (let z = 1.6; z < 4.5; z += 0.4) {
        const total = 2.2e-4 * (1 + 0.4 * (x * x + (y - 0.9) ** 2 + (z - 3) ** 2));
        grid.push({ point_m: { x, y, z }, camera_count: 4, calibration_total_m: total * 0.8, shape_total_m: total, total_m: total * 1.2 });
      }
    }
  }
  return { id, sigma_px: 0.3, grid_step_m: 0.4, scale_sigma_rel: 3e-4, grid,
    shape: { count: grid.length, median_m: 3.6e-4, p95_m: 5.1e-4, worst_m: 6.2e-4, worst_point_m: { x: -1.4, y: 0, z: 1.6 } },
    with_scale: { count: grid.length, median_m: 6.1e-4, p95_m: 8.4e-4, worst_m: 1.1e-3 },
    calibration_p95_m: 4.4e-4 };
}
