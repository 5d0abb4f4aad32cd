// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { emptyRigState, mergeLive } from '../src/live/live_merge';
import { MockServer } from './mock_server';

const full = mergeLive(emptyRigState, { revision: 'a', full: true, rig: 'rig', time: '2026-01-01T00:00:00Z',
  session: { id: 's-1', goal: { until_mm: 0.5 } }, goal: { until_mm: 0.5, now_mm: 2 },
  cameras: [{ camera: 'b' }, { camera: 'a', wand_rate_hz: 3 }], overlap: { cameras: ['a', 'b'], counts: [4] },
  estimate: { state: 'STATE_READY' }, alerts: { alerts: [{ kind: 'no_wand' }] }, agents: { agents: [{ agent_id: 'p' }] } });

test('a full answer replaces everything, cameras sorted by name', () => {
  assert.deepEqual(full.cameras.map((camera) => camera.camera), ['a', 'b']);
  const next = mergeLive(full, { revision: 'z', full: true, rig: 'other' });
  assert.deepEqual(next, { ...emptyRigState, revision: 'z', rig: 'other' });
});

test('a delta keeps what it does not name, with its identity', () => {
  const next = mergeLive(full, { revision: 'b', cameras: [{ camera: 'b', wand_rate_hz: 9 }] });
  assert.equal(next.revision, 'b');
  assert.equal(next.cameras[0], full.cameras[0]);
  assert.equal(next.cameras[1]?.wand_rate_hz, 9);
  for (const part of ['session', 'overlap', 'estimate', 'alerts', 'agents', 'goal', 'time'] as const) {
    assert.equal(next[part], full[part], part);
  }
});

test('a camera that comes again is replaced as a whole: what is left out is back at its default', () => {
  const next = mergeLive(full, { revision: 'b', cameras: [{ camera: 'a' }] });
  assert.equal(next.cameras[0]?.wand_rate_hz, undefined);
});

test('removed cameras go, one that is removed and sent again stays', () => {
  const next = mergeLive(full, { revision: 'b', removed_cameras: ['a', 'b', 'never'], cameras: [{ camera: 'b' }] });
  assert.deepEqual(next.cameras.map((camera) => camera.camera), ['b']);
});

test('an answer with nothing but the known revision changes nothing', () => {
  assert.equal(mergeLive(full, { revision: 'a' }), full);
});

test('a full answer under the known name is taken all the same', () => {
  assert.equal(mergeLive(full, { revision: 'a', full: true }).cameras.length, 0);
});

test('alerts that are all gone are an empty message, not a missing one', () => {
  assert.equal(mergeLive(full, { revision: 'b' }).alerts.length, 1);
  assert.equal(mergeLive(full, { revision: 'b', alerts: {} }).alerts.length, 0);
});

test('the goal goes with a session without one', () => {
  assert.equal(mergeLive(full, { revision: 'b', session: { id: 's-2' } }).goal, undefined);
  assert.equal(mergeLive(full, { revision: 'b', session: { id: 's-1', goal: { until_mm: 0.5 } } }).goal, full.goal);
});

test('deltas of a whole wave end in the state that one full answer has', () => {
  const server = new MockServer({ dist: '.', cameras: 6 });
  let state = mergeLive(emptyRigState, server.live(''));
  server.rig.create({ id: 's-9', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.1] }, goal: { until_mm: 0.9 } });
  state = mergeLive(state, server.live(state.revision));
  server.rig.start();
  for (let step = 0; step < 200; ++step) {
    server.rig.advance(step % 7 === 0 ? 0 : 0.25);
    const answer = server.live(state.revision);
    assert.notEqual(answer.full, true, 'a known revision is answered with a delta');
    state = mergeLive(state, answer);
  }
  const other = mergeLive(emptyRigState, server.live('unknown'));
  assert.deepEqual(JSON.parse(JSON.stringify({ ...state, ageS: 0 })), JSON.parse(JSON.stringify({ ...other, ageS: 0 })));
  assert.ok((state.estimate?.history?.length ?? 0) > 5);
});
