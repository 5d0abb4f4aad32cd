// SPDX-License-Identifier: Apache-2.0
// Backoff, previews, sounds, progress.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { qrPath } from '../src/join/qr_code';
import { backoffMs } from '../src/live/backoff';
import { LiveFeed } from '../src/live/live_feed';
import { emptyRigState, type RigState } from '../src/live/live_merge';
import { PreviewQueue } from '../src/rig/preview_queue';
import { overlapCount } from '../src/wave/overlap_matrix';
import { progressOf } from '../src/wave/progress';
import { nextSounds, nothingSaid } from '../src/wave/progress_sound';
import { MockServer } from './mock_server';

test('waits double up to five seconds', () => {
  assert.deepEqual([1, 2, 3, 4, 5, 6, 50].map((n) => backoffMs(n, 0)), [250, 500, 1000, 2000, 4000, 5000, 5000]);
  assert.equal(backoffMs(6, 1), 4000);
});

test('at most two previews are under way, each camera at most once in a period', async () => {
  const periodMs = 40;
  let [flying, most] = [0, 0];
  const times = new Map<string, number[]>(['a', 'b', 'c', 'd'].map((name) => [name, []]));
  const queue = new PreviewQueue(2, periodMs);
  for (const [name, at] of times) {
    queue.add(name, async () => {
      at.push(performance.now());
      flying += 1;
      most = Math.max(most, flying);
      await new Promise((done) => setTimeout(done, 5));
      flying -= 1;
    });
  }
  while ([...times.values()].some((at) => at.length < 4)) await new Promise((done) => setTimeout(done, 10));
  for (const name of times.keys()) queue.remove(name);
  assert.equal(most, 2);
  for (const [name, at] of times) {
    // The period begins just before the preview is asked for.
    at.slice(1).forEach((t, i) => assert.ok(t - at[i]! >= periodMs - 1, name));
  }
});

test('a preview that fails does not stop the others, one that is gone is not asked again', async () => {
  const queue = new PreviewQueue(1, 1);
  const asked = { bad: 0, good: 0 };
  queue.add('bad', () => {
    asked.bad += 1;
    return Promise.reject(new Error('no image'));
  });
  queue.add('good', async () => { asked.good += 1; });
  while (asked.good < 3 || asked.bad < 3) await new Promise((done) => setTimeout(done, 5));
  queue.remove('bad');
  queue.remove('good');
  const before = { ...asked };
  await new Promise((done) => setTimeout(done, 40));
  assert.deepEqual(asked, before);
});

test('a camera that gives no preview rests until something changes, on the screen or not', async () => {
  const queue = new PreviewQueue(2, 1, () => performance.now(), 60000);
  const asked = { none: 0, good: 0 };
  const none = async (): Promise<'none'> => {
    asked.none += 1;
    return 'none';
  };
  queue.add('none', none);
  queue.add('good', async () => { asked.good += 1; });
  const goOn = async (): Promise<void> => {
    const before = asked.good;
    while (asked.good < before + 5) await new Promise((done) => setTimeout(done, 5));
  };
  await goOn();
  assert.equal(asked.none, 1);
  queue.remove('none');
  queue.add('none', none);
  await goOn();
  assert.equal(asked.none, 1, 'scrolled away and back');
  queue.wake('none');
  await goOn();
  assert.equal(asked.none, 2);
  queue.remove('none');
  queue.remove('good');
});

const rigWith = (change: Partial<RigState>): RigState => ({ ...emptyRigState, session: { id: 's', state: 'STATE_CAPTURING' }, ...change });
const withError = (mm: number, until?: number): RigState => rigWith({
  estimate: { state: 'STATE_READY', scale_known: true, volume: { p95_mm: mm } }, goal: until ? { until_mm: until } : undefined });

test('progress: one word for each state', () => {
  assert.equal(progressOf(emptyRigState, false).stage, 'no_session');
  assert.equal(progressOf(rigWith({}), false).stage, 'waiting');
  assert.equal(progressOf(rigWith({ estimate: { state: 'STATE_FAILED' } }), false).stage, 'failed');
  assert.equal(progressOf(withError(2, 0.5), false).stage, 'waving');
  assert.equal(progressOf(withError(0.7, 0.5), false).stage, 'near');
  assert.equal(progressOf(withError(0.4, 0.5), false).stage, 'near', 'below the target the server decides whether it is reached');
  assert.equal(progressOf({ ...withError(0.4), goal: { until_mm: 0.5, reached: true } }, false).stage, 'reached');
  assert.equal(progressOf(rigWith({ session: { state: 'STATE_FINISHED' } }), false).word, 'Finished');
  assert.equal(progressOf(withError(0.4, 0.5), true).stage, 'stale', 'old data are never shown as progress');
});

test('no millimetres without a scale', () => {
  const rig = rigWith({ estimate: { state: 'STATE_READY', scale_known: false, volume: { p95_mm: 0.3 } } });
  assert.equal(progressOf(rig, false).nowMm, undefined);
});

test('sounds: a beep per new figure, higher when better; no repetition', () => {
  const first = nextSounds(nothingSaid, progressOf(withError(2, 0.5), false), '', '', 0);
  assert.equal(first.tonesHz.length, 1);
  assert.deepEqual(first.words, ['2.0 millimetres.']);
  const again = nextSounds(first.said, progressOf(withError(2, 0.5), false), '', '', 1);
  assert.deepEqual([again.tonesHz, again.words], [[], []]);
  const better = nextSounds(again.said, progressOf(withError(1, 0.5), false), '', '', 2);
  assert.ok(better.tonesHz[0]! > first.tonesHz[0]!);
  const little = nextSounds(better.said, progressOf(withError(0.95, 0.5), false), '', '', 3);
  assert.deepEqual([little.tonesHz.length, little.words], [1, []]);
});

test('sounds: the end, lost data, alerts and advice', () => {
  const done = nextSounds(nothingSaid, progressOf({ ...withError(0.46), goal: { until_mm: 0.5, reached: true } }, false), '', '', 0);
  assert.equal(done.tonesHz.length, 3);
  assert.match(done.words[0]!, /Good enough. 0.46/);
  const lost = nextSounds(nothingSaid, progressOf(withError(2), true), 'low', 'x', 0);
  assert.deepEqual(lost.words, ['No data from the server.']);
  const advised = nextSounds(nothingSaid, progressOf(rigWith({}), false), 'low', 'frame_1 sees nothing', 10);
  assert.deepEqual(advised.words, ['frame_1 sees nothing', 'Wave low.']);
  assert.deepEqual(nextSounds(advised.said, progressOf(rigWith({}), false), 'high', 'frame_1 sees nothing', 12).words, []);
  assert.deepEqual(nextSounds(advised.said, progressOf(rigWith({}), false), 'high', 'frame_1 sees nothing', 18).words, ['Wave high.']);
});

test('pairs of the overlap matrix, both ways round', () => {
  const overlap = { cameras: ['a', 'b', 'c', 'd'], counts: [1, 2, 3, 4, 5, 6] };
  const found = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]].map(([i, j]) => [overlapCount(overlap, i!, j!), overlapCount(overlap, j!, i!)]);
  assert.deepEqual(found, [[1, 1], [2, 2], [3, 3], [4, 4], [5, 5], [6, 6]]);
});

test('a QR code has its three corners and holds a long join string', () => {
  const { path, side } = qrPath(`rigcal-agent join rk1.${'x'.repeat(300)}`);
  assert.ok(side >= 57 && path.startsWith('M0 0h7v1H0z'));
});

test('the feed: deltas, 304 for what has not changed, a lost server, a restarted one', async () => {
  const server = new MockServer({ dist: '.', speed: 0, cameras: 4 });
  const address = await server.listen();
  const realFetch = globalThis.fetch;
  globalThis.fetch = ((path: string, init: RequestInit) => realFetch(`${address}${path}`, init)) as typeof fetch;
  const feed = new LiveFeed();
  const until = async (what: string, holds: () => boolean): Promise<void> => {
    for (let i = 0; i < 400; ++i) {
      if (holds()) return;
      await new Promise((done) => setTimeout(done, 50));
    }
    assert.fail(`never: ${what}`);
  };
  try {
    feed.start('');
    await until('a first state', () => feed.state.rig.cameras.length === 4);
    await until('an answer without a body', () => server.counts.unchanged > 0);
    const before = feed.state.rig;
    server.failing = true;
    await until('old data are marked', () => feed.state.stale && feed.state.problem !== '');
    assert.equal(feed.state.rig, before, 'what was known stays');
    server.restart();
    server.failing = false;
    feed.retryNow();
    await until('it is back', () => !feed.state.stale && feed.state.problem === '');
    assert.notEqual(feed.state.restartedAt, undefined);
    assert.notEqual(feed.state.rig.revision, before.revision);
    assert.equal(feed.state.rig.cameras.length, 4);
  } finally {
    feed.stop();
    globalThis.fetch = realFetch;
    await server.close();
  }
});

test('the feed says that a login is wanted', async () => {
  const server = new MockServer({ dist: '.', speed: 0, locked: true });
  const address = await server.listen();
  const realFetch = globalThis.fetch;
  globalThis.fetch = ((path: string, init: RequestInit) => realFetch(`${address}${path}`, init)) as typeof fetch;
  const feed = new LiveFeed();
  try {
    feed.start('');
    await new Promise<void>((done) => { feed.subscribe(() => { if (feed.state.needsLogin) done(); }); });
    assert.match(feed.state.problem, /token/);
  } finally {
    feed.stop();
    globalThis.fetch = realFetch;
    await server.close();
  }
});

test('a hidden page asks nothing and has no timers; shown again, it asks at once', async () => {
  const server = new MockServer({ dist: '.', speed: 0, cameras: 4 });
  const address = await server.listen();
  const realFetch = globalThis.fetch;
  globalThis.fetch = ((path: string, init: RequestInit) => realFetch(`${address}${path}`, init)) as typeof fetch;
  const page = Object.assign(new EventTarget(), { visibilityState: 'hidden' });
  Object.defineProperty(globalThis, 'document', { value: page, configurable: true });
  const timers = () => (process as unknown as { getActiveResourcesInfo(): string[] }).getActiveResourcesInfo().filter((one) => one === 'Timeout').length;
  const before = timers();
  const feed = new LiveFeed();
  try {
    feed.start('');
    assert.equal(timers(), before);
    assert.equal(server.counts.live, 0);
    page.visibilityState = 'visible';
    page.dispatchEvent(new Event('visibilitychange'));
    while (feed.state.rig.cameras.length < 4) await new Promise((done) => setTimeout(done, 20));
    assert.ok(server.counts.live > 0);
  } finally {
    feed.stop();
    globalThis.fetch = realFetch;
    Reflect.deleteProperty(globalThis, 'document');
    await server.close();
  }
});
