// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { goalOf } from '../src/result/goal';

/** Answers of a server by path; others are not found. */
async function withServer<T>(answers: Record<string, unknown>, work: () => Promise<T>): Promise<T> {
  const real = globalThis.fetch;
  globalThis.fetch = (async (path: string) => (path in answers ? new Response(JSON.stringify(answers[path]))
    : new Response('{"code": "NOT_FOUND", "message": "gone"}', { status: 404 }))) as typeof fetch;
  try {
    return await work();
  } finally {
    globalThis.fetch = real;
  }
}

const signal = new AbortController().signal;

test('the colours of a calibration are made for the goal of its newest session, also in another frame', async () => {
  const answers = {
    '/v1/sessions/s-1': { session: { goal: { until_mm: 2 } } }, '/v1/sessions/s-2': { session: { goal: { until_mm: 0.8 } } },
    '/v1/sessions/s-3': { session: {} }, '/v1/calibrations/c-1': { calibration: { session_ids: ['s-1', 's-2', 's-3'] } },
    '/v1/calibrations/c-2': { calibration: { options: { kind: 'KIND_ORIGIN', parent_id: 'c-1' }, session_ids: ['s-9'] } },
  };
  await withServer(answers, async () => {
    assert.equal(await goalOf({ session_ids: ['s-1', 's-2', 's-3'] }, signal), 0.8);
    assert.equal(await goalOf({ options: { kind: 'KIND_SCALE', parent_id: 'c-2' } }, signal), 0.8);
    assert.equal(await goalOf({ session_ids: ['s-3'] }, signal), undefined);
    assert.equal(await goalOf({ session_ids: ['s-gone'] }, signal), undefined);
    assert.equal(await goalOf({ options: { kind: 'KIND_ORIGIN', parent_id: 'c-gone' } }, signal), undefined);
  });
});
