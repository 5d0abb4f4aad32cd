// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { durationSeconds, timeMs, toBytes, toCount, toDuration } from '../src/api/json_values';
import { bytes, count, dateTime, enumWords, fixed, inMs, millimetres, percent, seconds, span } from '../src/view/format';
import { hashOf, parseRoute, routeOf } from '../src/shell/route';
import { otherTargetText, parseTarget, targetText } from '../src/view/target_text';
import { filterText, matches } from '../src/records/filter';
import { optionalPositive } from '../src/wave/session_controls';

test('millimetres keep about three digits over all sizes', () => {
  const cases: [number, string][] = [[0.0463, '0.046'], [0.0994, '0.099'], [0.46, '0.46'], [9.94, '9.94'], [9.96, '10.0'],
    [99.4, '99.4'], [99.6, '100'], [1234, '1234']];
  for (const [value, text] of cases) assert.equal(millimetres(value), text);
});

test('what is not a number is an en dash, never 0 or NaN', () => {
  for (const show of [millimetres, count, bytes, seconds, span, percent, dateTime, inMs]) {
    assert.equal(show(undefined), '–');
    assert.equal(show(NaN), '–');
    assert.equal(show(Infinity), '–');
  }
});

test('signs: a true minus, and no minus zero', () => {
  assert.equal(fixed(-1.25, 1), '−1.3');
  assert.equal(fixed(-0.001, 2), '0.00');
  assert.equal(fixed(-0.4, 0), '0');
});

test('counts, sizes and times', () => {
  assert.equal(count(0), '0');
  assert.equal(count(12345), '12\u202f345');
  assert.equal(count(123456), '123 k');
  assert.equal(count(1234567), '1.2 M');
  assert.equal(bytes(1023), '1023 B');
  assert.equal(bytes(1024 * 1536), '1.5 MiB');
  assert.equal(seconds(-0.0063), '−6.30 ms');
  assert.equal(seconds(0.00002), '20 µs');
  assert.equal(span(59.9), '59 s');
  assert.equal(span(65), '1 min 05 s');
  assert.equal(span(7260), '2 h 1 min');
  assert.equal(span(-3), '0 s');
  assert.equal(enumWords('FINDING_KIND_WEAK_LINK', 'FINDING_KIND_'), 'weak link');
  assert.equal(enumWords(99, 'FINDING_KIND_'), 'unknown kind 99');
});

test('values of protobuf JSON', () => {
  assert.equal(toCount('9007199254740991'), 9007199254740991);
  assert.equal(toCount(undefined), 0);
  assert.equal(toCount('abc'), 0);
  assert.equal(durationSeconds('1.250s'), 1.25);
  assert.equal(durationSeconds('-3s'), -3);
  assert.equal(durationSeconds('3'), undefined);
  assert.equal(toDuration(20), '20s');
  assert.equal(timeMs('2026-01-05T09:00:00.123456Z'), Date.UTC(2026, 0, 5, 9, 0, 0, 123));
  assert.equal(timeMs('yesterday'), undefined);
  assert.deepEqual([...toBytes('AAH/')], [0, 1, 255]);
  assert.deepEqual([...toBytes('-_8=')], [251, 255]);
  assert.equal(toBytes('*').length, 0);
});

test('targets: millimetres, the form of the command line, and what is refused', () => {
  assert.deepEqual(parseTarget('0, 130 390').target, { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] });
  assert.deepEqual(parseTarget('wand:0,0.13;diameter=0.04;hz=500,700;tolerance=0.001').target,
    { kind: 'KIND_WAND', marker_positions_m: [0, 0.13], diameter_m: 0.04, blink_hz: [500, 700], span_tolerance_m: 0.001 });
  assert.deepEqual(parseTarget('point').target, { kind: 'KIND_POINT', marker_positions_m: [0] });
  for (const bad of ['', '0', '10, 130', '0, 130, 130', '0, 390, 130', '0, x', 'wand:0,0.1;colour=1', 'wand:0,0.1;hz=fast',
    '0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16', '0, 100000']) {
    assert.equal(parseTarget(bad).target, undefined, bad);
    assert.notEqual(parseTarget(bad).problem, '', bad);
  }
});

test('the text of a target is read as that target', () => {
  for (const text of ['0, 130, 390', 'wand:0,0.13,0.39;diameter=0.04;hz=500', 'point;diameter=0.03']) {
    assert.equal(targetText(parseTarget(text).target), text);
  }
});

test('numbers that may be left out', () => {
  assert.equal(optionalPositive(' '), undefined);
  assert.equal(optionalPositive('0,5'), 0.5);
  for (const bad of ['0', '-1', 'abc', '1e999']) assert.ok(Number.isNaN(optionalPositive(bad)), bad);
});

test('hashes lead to pages and back, and unknown ones to the wave', () => {
  const route = parseRoute(hashOf('result', 'c-1/ä', { with: 'c-2', none: '' }));
  assert.equal(route.page, 'result');
  assert.equal(route.id, 'c-1/ä');
  assert.equal(route.parameters.get('with'), 'c-2');
  assert.equal(route.parameters.has('none'), false);
  assert.equal(parseRoute('').page, 'wave');
  assert.equal(parseRoute('#/constructor').page, 'wave');
  assert.equal(parseRoute('#/result/%E0%A4%A').id, '%E0%A4%A');
});

test('the token of a login link, in the hash or in the query', () => {
  for (const [search, hash] of [['', '#token=rk1.a'], ['?token=rk1.a', ''], ['?token=x', '#/login?token=rk1.a']] as const) {
    const route = routeOf({ pathname: '/login', search, hash });
    assert.deepEqual([route.page, route.parameters.get('token')], ['login', 'rk1.a']);
  }
  assert.equal(routeOf({ pathname: '/', search: '', hash: '#/rig' }).page, 'rig');
});

test('filters quote what must be quoted', () => {
  assert.equal(filterText({ rig: 'lab 1', state: 'STATE_FINISHED', none: '' }), 'rig="lab 1" AND state=STATE_FINISHED');
  assert.equal(filterText({ rig: 'a" OR "b' }), 'rig="a OR b"');
  assert.ok(matches(' MORN ', [undefined, 'morning']));
  assert.ok(!matches('x', [undefined, 'morning']));
});

test('a further target is said with the sessions it was waved in', () => {
  assert.equal(otherTargetText({ given: { kind: 'KIND_RIGID', points: [{}, {}, {}, {}] }, session_ids: ['a', 'b'] }),
    'Also a rigid target of 4 points, waved in a, b');
  assert.equal(otherTargetText({ given: { kind: 'KIND_POINT', marker_positions_m: [0] }, session_ids: ['c'] }),
    'Also a single point, waved in c');
  assert.equal(otherTargetText({ given: { kind: 'KIND_STATIC', points: [{}, {}] }, session_ids: ['d'] }),
    'Also 2 static points, seen in d');
});
