// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { countQuality, coverageStep, coverageStepQuality, errorQuality, inkOn, luminance, overlapStep, qualityRgb, type Rgb, wantedMm }
  from '../src/view/colour_scale';

/** How a person without red or green cones sees a colour (Viénot, Brettel and Mollon 1999), linear light. */
function withoutCone([r, g, b]: Rgb, cone: 'red' | 'green'): Rgb {
  const linear = [r, g, b].map((value) => (value / 255) ** 2.2);
  const [mix, blue] = cone === 'red' ? [[0.11238, 0.88762, 0], [0.00401, -0.00401, 1]] : [[0.29275, 0.70725, 0], [-0.02234, 0.02234, 1]];
  const by = (row: number[]) => row.reduce((sum, value, k) => sum + value * linear[k]!, 0);
  const seen = [by(mix!), by(mix!), by(blue!)];
  return seen.map((value) => 255 * Math.max(0, value) ** (1 / 2.2)) as unknown as Rgb;
}

test('the scale becomes lighter from bad to good, for each kind of colour vision', () => {
  for (const seen of [(c: Rgb) => c, (c: Rgb) => withoutCone(c, 'red'), (c: Rgb) => withoutCone(c, 'green')]) {
    let before = -1;
    for (let q = 0; q <= 1.0001; q += 0.05) {
      const light = luminance(seen(qualityRgb(q)));
      assert.ok(light > before, `at ${q}: ${light} after ${before}`);
      before = light;
    }
  }
});

test('neighbouring steps of coverage differ by at least a fifth in luminance', () => {
  for (let step = 1; step < coverageStepQuality.length; ++step) {
    const [a, b] = [luminance(qualityRgb(coverageStepQuality[step - 1]!)), luminance(qualityRgb(coverageStepQuality[step]!))];
    assert.ok((b + 0.05) / (a + 0.05) > 1.2);
  }
});

test('text on any colour of the scale has a contrast of at least 4.5', () => {
  for (let q = 0; q <= 1; q += 0.02) {
    const rgb = qualityRgb(q);
    const light = luminance(rgb);
    const ratio = inkOn(rgb) === '#000' ? (light + 0.05) / 0.05 : 1.05 / (light + 0.05);
    assert.ok(ratio >= 4.5, `at ${q}: ${ratio}`);
  }
});

test('values outside of the scale take its ends', () => {
  assert.deepEqual(qualityRgb(-3), qualityRgb(0));
  assert.deepEqual(qualityRgb(7), qualityRgb(1));
  assert.deepEqual(qualityRgb(NaN), qualityRgb(0));
});

test('errors: half of what is wanted is best, four times is worst, none is worst', () => {
  assert.equal(errorQuality(0.25, 0.5), 1);
  assert.equal(errorQuality(0.1, 0.5), 1);
  assert.equal(errorQuality(2, 0.5), 0);
  assert.ok(Math.abs(errorQuality(0.5, 0.5) - 2 / 3) < 1e-12);
  for (const none of [0, -1, NaN]) assert.equal(errorQuality(none, 0.5), 0);
});

test('counts become steps', () => {
  assert.deepEqual([0, 1, 4, 5, 19, 20, 255].map(coverageStep), [0, 1, 1, 2, 2, 3, 3]);
  assert.deepEqual([0, 1, 49, 50, 199, 200].map(overlapStep), [0, 1, 1, 2, 2, 3]);
  assert.equal(countQuality(100, 400), 0.5);
  assert.equal(countQuality(5, 0), 0);
});

test('errors in millimetres have one scale, whatever else is in the picture', () => {
  assert.equal(wantedMm(undefined), 0.5);
  assert.equal(wantedMm(0), 0.5);
  assert.equal(wantedMm(2), 2);
});
