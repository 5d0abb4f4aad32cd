// SPDX-License-Identifier: Apache-2.0
// Join strings and residual vectors.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { serverAddresses } from '../src/join/join_string';
import { enlargement, residualQuantile } from '../src/result/draw_residuals';
import { named, worstFirst } from '../src/result/worst_first';
import { routeOf } from '../src/shell/route';

/** As the server makes it, with an expiry, hash, secret and check sum of zeros. */
function joinString(hosts: readonly string[], port: number, name: string): string {
  const text = (value: string) => [value.length, ...new TextEncoder().encode(value)];
  return `rk1.${Buffer.from([2, ...new Array<number>(8 + 32 + 16).fill(0), ...text(name), 0x1d, 0x0c, port >> 8, port & 255,
    hosts.length, ...hosts.flatMap(text), 0, 0, 0, 0]).toString('base64url')}`;
}

test('a join string names the addresses of its server', () => {
  assert.deepEqual(serverAddresses(joinString(['rig.lab', '10.0.0.5', 'fd00::7'], 7421, 'anna')),
    ['https://rig.lab:7421', 'https://10.0.0.5:7421', 'https://[fd00::7]:7421']);
  assert.deepEqual(serverAddresses(
    'rk1.AgAAAABrBDmucOEQ1TuX_a4a462Naa0MeHlOhtnW_uev3JsMXl8SjwxuzIqYgqdsodvRVzVyc31wAKkdkl0BCTEyNy4wLjAuMaeGb_g'),
  ['https://127.0.0.1:37469'], 'one that a server has made');
  for (const bad of ['', 'rk1.', 'rk1.AAAA', 'rk2.AAAA', joinString(['a b"c'], 1, '')]) assert.deepEqual(serverAddresses(bad), [], bad);
});

test('a link with the bare join string leads to the login, too', () => {
  const route = routeOf({ pathname: '/login', search: '', hash: '#rk1.abc_-' });
  assert.deepEqual([route.page, route.parameters.get('token')], ['login', 'rk1.abc_-']);
});

test('vectors of all cameras are enlarged alike, by 1, 2 or 5 times a power of ten', () => {
  const camera = (px: number) => ({ image_size_px: { width: 1000, height: 800 }, x_px: [1, 2], y_px: [1, 2], dx_px: [px, 900],
    dy_px: [0, 0], outlier: [false, true] });
  assert.equal(residualQuantile(camera(0.5), 0.95), 0.5, 'what was left out counts for nothing');
  assert.equal(enlargement([camera(0.5)]), 100);
  assert.equal(enlargement([camera(0.5), camera(2)]), 20);
  assert.equal(enlargement([camera(0.24)]), 200);
  assert.equal(enlargement([camera(300)]), 1);
  assert.equal(enlargement([]), 1);
});

test('cameras of a large result: the gravest finding first, then the largest error on what was held out', () => {
  const camera = (name: string, px?: number) => ({ camera: name, ...(px === undefined ? {} : { held_out: { mean_px: px } }) });
  const finding = (name: string, severity: 'ERROR' | 'WARNING' | 'INFO') => ({ camera: name, severity: `FINDING_SEVERITY_${severity}` as const });
  const cameras = [camera('c10', 0.3), camera('c9', 0.3), camera('good', 0.1), camera('noted', 0.1), camera('worse', 0.2), camera('bad', 0.1),
    camera('unmeasured')];
  const findings = [finding('noted', 'INFO'), finding('bad', 'INFO'), finding('bad', 'ERROR'), finding('bad', 'WARNING'), finding('worse', 'WARNING'),
    { severity: 'FINDING_SEVERITY_ERROR' as const }];
  assert.deepEqual(worstFirst(cameras, findings).map((one) => one.camera), ['bad', 'worse', 'noted', 'c9', 'c10', 'good', 'unmeasured']);
  assert.equal(cameras[0]!.camera, 'c10', 'what is given stays as it is');
  assert.deepEqual(worstFirst([], findings), []);
});

test('a search finds names that hold every word of it', () => {
  const names = ['hall_left_1', 'hall_right_1', 'HALL_LEFT_2'];
  const found = (text: string) => named(names, (name) => name, text);
  assert.deepEqual(found(''), names);
  assert.deepEqual(found(' left '), ['hall_left_1', 'HALL_LEFT_2']);
  assert.deepEqual(found('Left 1'), ['hall_left_1']);
  assert.deepEqual(found('top'), []);
});
