// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Lens, Session } from '../src/api/types';
import { largestOfParts, shortPx } from '../src/lens/draw_lens';
import { chooseCamera, chooseSession, isBehind, isBoardSession, lensCameras, lensState } from '../src/lens/lens_state';

const board = { kind: 'KIND_RIGID', board: 'board:checker,9x6,0.025' } as const;

test('how far a lens is, in words', () => {
  assert.equal(lensState(undefined)[0], 'idle');
  assert.deepEqual(lensState({ state: 'STATE_COLLECTING', views: [{}] }), ['warn', '1 view, more are needed']);
  assert.deepEqual(lensState({ state: 'STATE_SOLVING', views: [{}, {}] }), ['live', 'the lens is being made from 2 views']);
  assert.equal(lensState({ state: 'STATE_FAILED' })[0], 'bad');
  const good: Lens = { state: 'STATE_SOLVED', stored_count: '90', result: { observation_count: '90' } };
  assert.deepEqual(lensState(good), ['good', 'a good lens']);
  assert.equal(lensState({ ...good, result: { observation_count: '90', advice: ['tilt the board'] } })[0], 'warn');
  assert.equal(isBehind(good), false);
  assert.match(lensState({ ...good, stored_count: '91' })[1], /made again/);
});

test('the session asked for, else that of the rig, else the newest with a board', () => {
  const wand: Session = { id: 's-3', target: { kind: 'KIND_WAND' } };
  const all: Session[] = [wand, { id: 's-2', target: board, discard_time: '2026-01-01T00:00:00Z' }, { id: 's-1', target: board }];
  assert.equal(chooseSession('s-9', wand, all), 's-9');
  assert.equal(chooseSession('', { id: 's-4', target: board }, all), 's-4');
  assert.equal(chooseSession('', wand, all), 's-1');
  assert.equal(chooseSession('', undefined, [wand]), '');
  assert.ok(!isBoardSession(all[1]));
});

test('the camera asked for, else the first without a lens', () => {
  const cameras = lensCameras({ cameras: [{ description: { camera: 'left', intrinsics: { fx_px: 900 } } },
    { description: { camera: 'right' } }] });
  assert.deepEqual(cameras, [{ name: 'left', hasLens: true }, { name: 'right', hasLens: false }]);
  assert.equal(chooseCamera('', cameras), 'right');
  assert.equal(chooseCamera('left', cameras), 'left');
  assert.equal(chooseCamera('gone', cameras), 'right');
  assert.equal(chooseCamera('', []), '');
});

test('a map has a number for each part of the image, and none where there is no ray', () => {
  const values: number[] = new Array<number>(12 * 8).fill(0.1);
  values[0] = 0.4;
  values[12 * 8 - 1] = 0.7;
  for (const i of [2, 3, 14, 15]) values[i] = 'NaN' as unknown as number;
  const parts = largestOfParts({ columns: 12, rows: 8, values_px: values });
  assert.equal(parts.length, 24);
  assert.equal(parts[0], 0.4);
  assert.equal(parts[1], undefined);
  assert.equal(parts[2], 0.1);
  assert.equal(parts[23], 0.7);
  assert.deepEqual([0.0123, 0.123, 1.234, 12.34, 123.4].map(shortPx), ['0.012', '0.12', '1.23', '12.3', '123']);
});
