// SPDX-License-Identifier: Apache-2.0
// The lens of a camera for the page's tests, from so many views of a board. The figures are made up.
import type { Lens, LensView } from '../src/api/types';

const width = 1440;
const height = 1080;

/** Corner (0..1, 0..1) of a board whose middle is at (x, y), tilted by `tilt` to one side. */
function corner(u: number, v: number, x: number, y: number, size: number, tilt: number): [number, number] {
  const near = 1 + tilt * (u - 0.5);
  return [x + size * (u - 0.5) * near, y + 0.7 * size * (v - 0.5) * near];
}

function view(i: number): LensView {
  const [x, y] = [width * (0.25 + 0.25 * (i % 3)), height * (0.28 + 0.22 * (Math.floor(i / 3) % 3))];
  const shown: LensView = { time_ns: String(1e9 * (i + 1)), x_px: [], y_px: [], rms_px: 0.11, tilt_deg: 30 };
  for (let row = 0; row < 6; ++row) {
    for (let column = 0; column < 9; ++column) {
      const [px, py] = corner(column / 8, row / 5, x, y, 520, i % 2 ? 0.5 : -0.4);
      shown.x_px!.push(Math.round(10 * px) / 10);
      shown.y_px!.push(Math.round(10 * py) / 10);
    }
  }
  return shown;
}

/** What the server answers after so many views. */
export function mockLens(sessionId: string, camera: string, views: number): Lens {
  const stored = String(views * 20);
  const lens: Lens = { session_id: sessionId, camera, state: 'STATE_COLLECTING', stored_count: stored,
    image_size_px: { width, height }, board: 'board:checker,9x6,0.025', observation_count: stored,
    board_count: String(views * 15), alike_count: String(views * 13), blurred_count: String(views),
    views: Array.from({ length: views }, (_, i) => view(i)), covered_share: Math.min(0.86, views / 20),
    bare_sides: views < 9 ? ['no corner in the lower fifth of the image'] : [],
    next_pose: { words: 'Near, in the lower right corner, tilted by 40 degrees to the left' } };
  if (views < 6) return { ...lens, problem: `there are ${views} views that differ, and a lens needs 6 at least` };
  const outline = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => corner(u!, v!, 1020, 780, 640, 0.6));
  const values = Array.from({ length: 30 * 24 }, (_, i) => {
    const [x, y] = [((i % 30) - 14.5) / 15, (Math.floor(i / 30) - 11.5) / 12];
    return i % 30 === 29 && i < 60 ? ('NaN' as unknown as number) : 0.05 + (0.9 * (x * x + y * y) ** 2) / views;
  });
  return { ...lens, state: 'STATE_SOLVED',
    next_pose: { ...lens.next_pose, outline_x_px: outline.map(([x]) => x), outline_y_px: outline.map(([, y]) => y), expected_p95_px: 0.11 },
    uncertainty: { columns: 30, rows: 24, values_px: values, median_px: 0.07, p95_px: 0.19 },
    result: { model: 'pinhole5', intrinsics: { model: 'MODEL_BROWN_CONRADY', fx_px: 1101.25, fy_px: 1100.5, cx_px: 719.6, cy_px: 540.2,
      distortion: [-0.2, 0.08, 0, 0, -0.01] }, rms_px: 0.102, held_out_rms_px: 0.118, view_count: views, corner_count: views * 54,
    candidates: [['pinhole4', 0.131], ['pinhole5', 0.118], ['fisheye', 0.402], ['pinhole8', 0.121]].map(([model, px]) =>
      ({ model: String(model), rms_px: Number(px) * 0.9, held_out_rms_px: Number(px) })),
    halves_median_px: 0.09, halves_p95_px: 0.21, observation_count: stored, opencv_yaml: `%YAML:1.0\n---\ncamera_name: "${camera}"\n`,
    advice: views < 20 ? [`only ${views} views were used: take 20 to 40`] : [] } };
}
