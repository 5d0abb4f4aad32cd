// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { blinkChoices, layoutBoard, refreshHz, wanderAt } from '../src/pattern/board_layout';

test('the board fits phones and monitors, is never mirrored, and says its size', () => {
  for (const [width, height, pxPerMm] of [[390, 844, 6.2], [1440, 900, 3.8], [820, 1180, 5.2]] as const) {
    const layout = layoutBoard(width, height, pxPerMm);
    const most = layout.wanderPx + layout.radiusPx;
    for (const { x, y } of layout.centres) {
      assert.ok(x - most >= 0 && x + most <= width && y - most >= 0 && y + most <= height - 12, `${x},${y} of ${width}x${height}`);
    }
    const [first, second, , , below] = layout.centres;
    assert.ok(first && second && below);
    // Row 1 is shifted by a spacing along a row, and a spacing down.
    const row = { x: second.x - first.x, y: second.y - first.y }, down = { x: below.x - first.x, y: below.y - first.y };
    assert.ok(row.x * down.y - row.y * down.x > 0, 'not mirrored');
    assert.ok(Math.abs(Math.hypot(row.x, row.y) - 2 * layout.spacingMm * pxPerMm) < 1e-6);
    assert.ok(Math.abs(Math.hypot(down.x, down.y) - Math.SQRT2 * layout.spacingMm * pxPerMm) < 1e-6);
    const [, spacing, diameter] = /^board:circles,4x11,([\d.]+),([\d.]+)$/.exec(layout.text) ?? [];
    assert.ok(Math.abs(1000 * Number(spacing) - layout.spacingMm) < 1e-9);
    assert.ok(Math.abs(2000 * layout.radiusPx / pxPerMm / 1000 - 1000 * Number(diameter)) < 1e-6);
  }
});

test('it wanders slower than a millimetre a second, and comes back', () => {
  const layout = layoutBoard(1440, 900, 3.8);
  let least = 0, most = 0;
  for (let s = 0; s < 300; ++s) {
    const now = wanderAt(layout, s), next = wanderAt(layout, s + 1);
    assert.ok(Math.hypot(next.x - now.x, next.y - now.y) / 3.8 < 2);
    least = Math.min(least, now.x);
    most = Math.max(most, now.x);
  }
  assert.ok(most > 0.9 * layout.wanderPx && least < -0.9 * layout.wanderPx);
});

test('the refresh rate is measured, with a frame that is late', () => {
  for (const hz of [60, 75, 119.88, 144]) {
    const times = Array.from({ length: 91 }, (_, i) => Math.round(10 * (i + (i > 40 ? 1 : 0)) * 1000 / hz) / 10);
    assert.ok(Math.abs(refreshHz(times) / hz - 1) < 0.01, `${hz}: ${refreshHz(times)}`);
  }
  assert.equal(refreshHz([1, 2, 3]), 0);
});

test('blinks of 2 to 15 a second, the first one near 5, nothing shown for more than a second', () => {
  assert.deepEqual(blinkChoices(60), [6, 15, 10, 4, 3, 2]);
  for (const hz of [30, 60, 75, 120, 144, 240]) {
    for (const refreshes of blinkChoices(hz)) assert.ok(refreshes >= 2 && refreshes / hz <= 1);
  }
});
