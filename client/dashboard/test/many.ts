// SPDX-License-Identifier: Apache-2.0
// What a rig of many cameras costs the page: bytes of an answer, time of the browser for one, on a desk's screen and on
// a phone. CAMERAS=500 node run_test.mjs many
import { gzipSync } from 'node:zlib';
import { startChromium } from './chromium';
import { MockServer } from './mock_server';
import { sizes } from './page_checks';

const seconds = 10;
const cameras = Number(process.env['CAMERAS'] ?? 500);
const browser = await startChromium();
for (const size of sizes) {
  const server = new MockServer({ dist: process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist', speed: 0, cameras });
  const address = await server.listen();
  server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] } });
  for (let i = 0; i < 10; ++i) server.rig.cameras[(i * cameras) / 10 | 0]!.blind = true;
  server.rig.start();
  server.rig.advance(30);
  const page = await browser.newPage({ viewport: { width: size.width, height: size.height } });
  // The plan, as a phone would show it: WebGL by software says nothing.
  await page.addInitScript(() => localStorage.setItem('rigcal', JSON.stringify({ scene: 'plan' })));
  const session = await page.context().newCDPSession(page);
  await session.send('Performance.enable');
  const sizesOfAnswers: number[] = [];
  page.on('response', (response) => {
    if (response.url().includes('/v1/live') && response.status() === 200) {
      response.body().then((body) => sizesOfAnswers.push(body.length, gzipSync(body).length), () => undefined);
    }
  });
  await page.goto(address);
  await page.locator('.big .digits').filter({ hasText: /^\d/ }).waitFor();
  await page.waitForTimeout(2000);
  const read = async (): Promise<Record<string, number>> =>
    Object.fromEntries((await session.send('Performance.getMetrics')).metrics.map(({ name, value }) => [name, value]));
  const [before, polls] = [await read(), server.counts.live - server.counts.unchanged];
  for (let i = 0; i < seconds * 4; ++i) {
    server.rig.advance(0.25);
    await page.waitForTimeout(250);
  }
  const after = await read();
  const answers = server.counts.live - server.counts.unchanged - polls;
  const ms = (name: string): string => ((1e3 * (after[name]! - before[name]!)) / answers).toFixed(1);
  const [bytes, zipped] = [0, 1].map((k) => sizesOfAnswers.slice(2).filter((_, i) => i % 2 === k).sort((a, b) => a - b));
  const median = (values: number[]): string => `${Math.round(values[values.length >> 1]! / 1e3)} kB`;
  console.log(`${cameras} cameras, ${size.name}: ${answers} answers in ${seconds} s, the median ${median(bytes!)}, ${median(zipped!)} with gzip; ` +
    `for each ${ms('TaskDuration')} ms of the page's thread, of them ${ms('ScriptDuration')} scripts, ${ms('LayoutDuration')} layout, ` +
    `${ms('RecalcStyleDuration')} styles; ${await page.evaluate(() => document.querySelectorAll('*').length)} elements`);
  await page.close();
  await server.close();
}
await browser.close();
