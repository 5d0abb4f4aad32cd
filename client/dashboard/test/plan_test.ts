// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { planProjection } from '../src/scene/draw_plan';
import { type LabelBox, placeLabels, scaleBar } from '../src/scene/plan_layout';
import { modelOfCalibration, modelOfEstimate } from '../src/view/rig_model';
import { mockAccuracy, mockCalibration } from './mock_calibration';
import { MockRig } from './mock_rig';

const apart = (a: LabelBox, b: LabelBox): boolean =>
  a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;

test('names are inside, on no other name, and near to what they name', () => {
  // Thirty cameras on a ring, as seen from the side: many are on top of each other.
  const labels = Array.from({ length: 30 }, (_, i) => ({ text: `frame_${i}`, width: 48,
    at: [200 + 170 * Math.cos(i), 100 + 8 * Math.sin(i)] as const }));
  const taken = [{ x: 0, y: 0, width: 80, height: 20 }];
  const placed = placeLabels(labels, taken, 400, 260, 14);
  assert.ok(placed.length >= 20, `${placed.length} of 30 have a place`);
  for (const [i, one] of placed.entries()) {
    assert.ok(one.x >= 0 && one.y >= 0 && one.x + one.width <= 400 && one.y + one.height <= 260, one.text);
    assert.ok(apart(one, taken[0]!), one.text);
    for (const other of placed.slice(0, i)) assert.ok(apart(one, other), `${one.text} covers ${other.text}`);
    assert.ok(Math.hypot(one.x + 24 - one.at[0], one.y + 7 - one.at[1]) < 130, one.text);
  }
});

test('the bar of the scale is 1, 2 or 5 times a power of ten', () => {
  assert.deepEqual(scaleBar(100, 120), { px: 100, text: '1 m' });
  assert.deepEqual(scaleBar(55, 120), { px: 110, text: '2 m' });
  assert.deepEqual(scaleBar(1000, 120), { px: 100, text: '0.1 m' });
  assert.deepEqual(scaleBar(2, 120), { px: 100, text: '50 m' });
});

test('all of a rig is inside its plan', () => {
  const rig = new MockRig(8);
  rig.create({ id: 's' });
  rig.start();
  rig.advance(30);
  const { estimate, cameras } = rig.parts();
  const model = modelOfEstimate(estimate, cameras);
  // What is said of is beyond everything that was seen.
  model.advice = [[9, 0, 0]];
  model.worst = [0, -7, 3];
  for (const [width, height] of [[360, 250], [340, 180], [1600, 900]] as const) {
    for (const view of ['top', 'side'] as const) {
      const { at } = planProjection(model, view, width, height)!;
      for (const p of [...model.cameras.map((one) => one.rigFromCam.t), ...model.places.map((one) => one.at), ...model.advice, model.worst]) {
        const [x, y] = at(p);
        assert.ok(x >= 12 && x <= width - 12 && y >= 22 && y <= height - 30, `${view} ${width}: ${x} ${y}`);
      }
    }
  }
});

test('a frame that somebody has set is drawn as it is; the one of a camera is put upright', () => {
  const rig = new MockRig(4);
  const calibration = mockCalibration(rig, 'c-1', 1, ['s'], 1);
  const own = modelOfCalibration(calibration, mockAccuracy('c-1'));
  assert.equal(own.frameIsSet, false);
  assert.ok(own.frame.axes[1][2] < -0.9, 'y of the camera is down');
  const set = modelOfCalibration({ ...calibration, frame: { source: 'FRAME_SOURCE_FLOOR' } }, undefined);
  assert.equal(set.frameIsSet, true);
  assert.deepEqual(set.frame.axes[2], [0, 0, 1]);
  const kept = modelOfCalibration({ ...calibration, frame: { source: 'FRAME_SOURCE_NOT_KEPT', problem: 'x' } }, undefined);
  assert.equal(kept.frameIsSet, false);
});

test('a place of a calibration has the figure that the running estimate would state', () => {
  const model = modelOfCalibration({}, { grid: [{ point_m: {}, calibration_total_m: 2e-4, shape_total_m: 9e-4 },
    { point_m: { z: 1 }, calibration_total_m: 3e-4 }, { point_m: { z: 2 } }] });
  assert.deepEqual(model.places.map((one) => one.sigmaMm.toFixed(3)), ['0.200', '0.300']);
  assert.ok(Math.abs(model.worst![1] - 1) < 1e-9 || Math.abs(model.worst![2]) <= 1);
});
