// SPDX-License-Identifier: Apache-2.0
// A live wave for a while: the page's heap must not grow by more than a fifth.
//   HEAP_MINUTES=10 node run_test.mjs heap        (default: 1; simulated time is as fast as real time)
import { startChromium } from './chromium';
import { MockServer } from './mock_server';

const minutes = Number(process.env['HEAP_MINUTES'] ?? 1);
const server = new MockServer({ dist: process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist', speed: 1, cameras: 12 });
const address = await server.listen();
const browser = await startChromium();
const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
const session = await page.context().newCDPSession(page);
const usedMiB = async (): Promise<number> => {
  await session.send('HeapProfiler.collectGarbage');
  await session.send('HeapProfiler.collectGarbage');
  return (await session.send('Runtime.getHeapUsage')).usedSize / 2 ** 20;
};
server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] } });
server.rig.start();
// Until the history of the figure has its 300 points the state itself grows.
server.rig.advance(610);
const began = Date.now();
await page.goto(address);
await page.locator('.scene canvas').waitFor();
await page.locator('.big .digits').filter({ hasText: /^\d/ }).waitFor();
console.log(`usable after ${Date.now() - began} ms`);
await page.waitForTimeout(10000);
const first = await usedMiB();
console.log(`heap at the start: ${first.toFixed(2)} MiB`);
let last = first;
for (let i = 1; i <= 6; ++i) {
  await page.waitForTimeout((minutes * 60000) / 6);
  last = await usedMiB();
  console.log(`after ${((minutes * i) / 6).toFixed(1)} min: ${last.toFixed(2)} MiB`);
}
const metrics = await page.evaluate(() => document.querySelectorAll('*').length);
console.log(`${metrics} elements, ${server.counts.live} polls, ${server.counts.unchanged} of them unchanged`);
await browser.close();
await server.close();
const growth = last / first - 1;
console.log(`growth ${(100 * growth).toFixed(1)} %`);
if (growth > 0.2) {
  console.error('heap: the page grew by more than 20 %');
  process.exit(1);
}
