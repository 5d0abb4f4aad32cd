// SPDX-License-Identifier: Apache-2.0
// Pictures of all pages for a person to look at: RIGCAL_SHOTS=folder node run_test.mjs shots
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { startChromium } from './chromium';
import { MockServer } from './mock_server';

const folder = process.env['RIGCAL_SHOTS'] ?? 'dist/shots';
const only = process.env['RIGCAL_SHOTS_ONLY'] ?? '';
mkdirSync(folder, { recursive: true });
const server = new MockServer({ dist: process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist', speed: 0 });
const address = await server.listen();
const browser = await startChromium();
const sizes = { desktop: [1440, 900], phone: [390, 844], '4k': [3840, 2160] } as const;
const shoot = async (name: string, hash: string, size: keyof typeof sizes, theme = 'dark', full = false): Promise<void> => {
  const file = `${name}-${size}${theme === 'light' ? '-light' : ''}`;
  if (only && !file.includes(only)) return;
  const [width, height] = sizes[size];
  const context = await browser.newContext({ viewport: { width, height }, deviceScaleFactor: size === 'phone' ? 2 : 1 });
  const page = await context.newPage();
  page.on('console', (message) => { if (message.type() === 'error') console.log(`${file}: ${message.text()}`); });
  page.on('pageerror', (error) => console.log(`${file}: ${error.message}`));
  await page.addInitScript((chosen) => localStorage.setItem('rigcal', JSON.stringify({ theme: chosen })), theme);
  await page.goto(`${address}/#/${hash}`);
  await page.waitForTimeout(size === '4k' ? 6000 : 2500);
  if (name === 'join') {
    await page.getByRole('button', { name: 'Make a join string' }).click();
    await page.waitForTimeout(400);
  }
  await page.screenshot({ path: join(folder, `${file}.png`), fullPage: full });
  await context.close();
};
await shoot('idle', 'wave', 'desktop');
await shoot('idle', 'wave', 'phone', 'dark', true);
server.rig.create({ id: 's-000003', rig: 'rig', title: 'morning', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] },
  goal: { until_mm: 0.5, min_duration: '20s' } });
server.rig.cameras[5]!.blind = true;
server.rig.start();
server.rig.advance(4);
await shoot('early', 'wave', 'desktop');
await shoot('early-distance', 'distance', 'phone');
server.rig.advance(16);
for (const size of ['desktop', 'phone', '4k'] as const) await shoot('wave', 'wave', size);
await shoot('wave', 'wave', 'desktop', 'light', true);
await shoot('distance', 'distance', 'phone');
await shoot('distance', 'distance', 'desktop');
await shoot('rig', 'rig', 'desktop', 'dark', true);
await shoot('rig', 'rig', 'phone');
server.rig.advance(200);
await shoot('reached', 'wave', 'desktop');
await shoot('reached-distance', 'distance', 'desktop');
for (const size of ['desktop', 'phone'] as const) {
  await shoot('result', 'result/c-000002?with=c-000001', size, 'dark', true);
  await shoot('records', 'records', size);
  await shoot('join', 'join', size);
}
await shoot('result', 'result/c-000002', 'desktop', 'light');
server.boardViews.set(server.rig.cameras[0]!.name, 12);
server.rig.create({ id: 's-000004', rig: 'rig', target: { kind: 'KIND_RIGID', board: 'board:checker,9x6,0.025' } });
server.rig.start();
for (const size of ['desktop', 'phone'] as const) await shoot('lens', 'lens', size, 'dark', true);
await shoot('lens', 'lens', 'desktop', 'light', true);
await browser.close();
await server.close();
