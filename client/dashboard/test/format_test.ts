// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { durationSeconds, timeMs, toBytes, toCount, toDuration } from '../src/api/json_values';
import { bytes, count, dateTime, enumWords, fixed, inMs, millimetres, percent, seconds, span } from '../src/view/format';
import { hashOf, parseRoute, routeOf } from '../src/shell/route';
import { fieldsOf, fieldsOfText, otherTargetText, type ParsedTarget, type TargetFields, targetOf, targetText, usualFields } from '../src/view/target_text';
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

const read = (change: Partial<TargetFields>): ParsedTarget => targetOf({ ...usualFields, ...change });

test('targets: fields in metres, a text of the command line, and what is refused', () => {
  assert.deepEqual(read({ markers: '0, 0.13 0.39' }).target, { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] });
  assert.deepEqual(read({ markers: '0,0.13', diameter: '0,04', hz: '500, 700', tolerance: '0.001' }).target,
    { kind: 'KIND_WAND', marker_positions_m: [0, 0.13], diameter_m: 0.04, blink_hz: [500, 700], span_tolerance_m: 0.001 });
  assert.deepEqual(targetOf(fieldsOfText('wand:0,0.13;diameter=0.04;hz=500,700;tolerance=0.001')!),
    read({ markers: '0,0.13', diameter: '0.04', hz: '500, 700', tolerance: '0.001' }));
  assert.deepEqual(targetOf(fieldsOfText('point')!).target, { kind: 'KIND_POINT', marker_positions_m: [0] });
  assert.equal(fieldsOfText('0, 0.13'), undefined);
  assert.equal(fieldsOfText('wand:0,0.1;colour=1'), undefined);
  for (const bad of [{ markers: '' }, { markers: '0' }, { markers: '0.1, 0.13' }, { markers: '0, 0.13, 0.13' }, { markers: '0, 0.39, 0.13' },
    { markers: '0, x' }, { markers: '0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16' }, { hz: 'fast' }, { hz: '-1' }, { hz: '400, 500' },
    { diameter: '-1' }, { diameter: '40' }, { tolerance: 'x' }]) {
    assert.equal(read(bad).target, undefined, JSON.stringify(bad));
    assert.notEqual(read(bad).problem, '', JSON.stringify(bad));
  }
  assert.match(read({ markers: '0, 130, 390' }).problem, /390 m: positions are in metres/);
});

test('rigid targets: a line for each point, and which line is wrong', () => {
  const points = '# frame\nA1 0 0 0 0.0002\nA2, 0.3, 0, 0.01\n\nB1 0.3 0.2 0 0\nB2 0 0.2 0.1 0 # top';
  assert.deepEqual(read({ kind: 'rigid', points, diameter: '0.016', hz: '500' }).target, { kind: 'KIND_RIGID', diameter_m: 0.016, blink_hz: [500], points: [
    { label: 'A1', x_m: 0, y_m: 0, z_m: 0, sigma_m: 0.0002 }, { label: 'A2', x_m: 0.3, y_m: 0, z_m: 0.01, sigma_m: 0.0005 },
    { label: 'B1', x_m: 0.3, y_m: 0.2, z_m: 0, sigma_m: 0 }, { label: 'B2', x_m: 0, y_m: 0.2, z_m: 0.1, sigma_m: 0 }] });
  for (const [bad, why] of [['A 0 0 0\nB 0 0', /Line 2/], ['A 0 0 0\nA 1 0 0', /twice/], ['A 0 zero 0', /numbers/], ['A 0 0 0', /4 to 200/],
    ['A 300 0 0', /100 m/], ['A 0 0 0 -1', /negative/]] as const) {
    assert.match(read({ kind: 'rigid', points: bad }).problem, why, bad);
  }
});

test('the fields of a target are read as that target', () => {
  for (const change of [{}, { diameter: '0.04', hz: '500' }, { kind: 'point', diameter: '0.03' },
    { kind: 'rigid', points: 'A 0 0 0 0.001\nB 1 0 0 0.001\nC 0 1 0 0.001\nD 0 0 1 0' }] as Partial<TargetFields>[]) {
    const { target } = read(change);
    assert.deepEqual(targetOf(fieldsOf(target)!).target, target);
  }
  assert.equal(fieldsOf({ kind: 'KIND_STATIC' }), undefined);
  assert.equal(targetText(read({ diameter: '0.04', hz: '500' }).target), 'wand:0,0.13,0.39;diameter=0.04;hz=500');
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
