// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { frameText, originOptions } from '../src/result/frame_panel';
import { gradeOf } from '../src/result/grade';

const fields = { height: '', points: '', numbers: '' };

test('a new frame is asked for as the fields say', () => {
  assert.deepEqual(originOptions('floor', { ...fields, height: '0,02' }), { source: 'FRAME_SOURCE_FLOOR', height_m: 0.02 });
  assert.deepEqual(originOptions('down', { ...fields, numbers: '0, 1, 0.2' }), { source: 'FRAME_SOURCE_DOWN', down: { x: 0, y: 1, z: 0.2 } });
  assert.deepEqual(originOptions('transform', { ...fields, numbers: '1 2 3 1 0 0 0' }), { source: 'FRAME_SOURCE_TRANSFORM',
    new_from_rig: { translation_m: { x: 1, y: 2, z: 3 }, rotation: { w: 1, x: 0, y: 0, z: 0 } } });
  assert.deepEqual(originOptions('points', { ...fields, points: 'A 0 0 0\nB 0.3 0 0 0.001\nC 0 0.2 0' }).points?.[1],
    { label: 'B', sigma_m: 0.001, position_m: { x: 0.3, y: 0, z: 0 } });
});

test('a field that is wrong is named before the server is asked', () => {
  for (const [way, change, why] of [['floor', { height: 'x' }, /height/], ['down', { numbers: '0 0 0' }, /direction/], ['down', { numbers: '1 2' }, /three numbers/],
    ['transform', { numbers: '1 2 3' }, /seven numbers/], ['points', { points: 'A 0 0 0' }, /three points/], ['points', { points: 'A 0' }, /Line 1/]] as const) {
    assert.throws(() => originOptions(way, { ...fields, ...change }), why);
  }
});

test('where a frame comes from is said in words', () => {
  assert.equal(frameText({ reference_camera: 'left' }), 'that of left');
  assert.equal(frameText({ frame: { source: 'FRAME_SOURCE_FLOOR', calibration_id: 'c-1', residual_rms_m: 4e-4, lowest_camera: 'a', lowest_camera_m: 1.234 } }),
    'z = 0 is the floor, z up, from c-1, residuals 0.40 mm rms, lowest camera a at 1.23 m');
  assert.equal(frameText({ reference_camera: 'left', frame: { source: 'FRAME_SOURCE_NOT_KEPT', problem: 'three cameras moved' } }), 'that of left: three cameras moved');
});

test('a calibration without a grade says how it stands', () => {
  assert.deepEqual(gradeOf({ state: 'STATE_FAILED' }), ['bad', 'failed']);
  assert.deepEqual(gradeOf({ state: 'STATE_CANCELLED' }), ['idle', 'cancelled']);
  assert.deepEqual(gradeOf({ state: 'STATE_SUCCEEDED', quality: { grade: 'GRADE_GOOD' } }), ['good', 'good: use it']);
});
