// SPDX-License-Identifier: Apache-2.0
// How long until the page can be used on loopback: first figures and tiles shown, buttons pressed.
import { startChromium } from './chromium';
import { MockServer } from './mock_server';

const server = new MockServer({ dist: process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist', speed: 0 });
const address = await server.listen();
const browser = await startChromium();
for (let i = 0; i < 5; ++i) {
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 } });
  const page = await context.newPage();
  await page.goto(address);
  await page.locator('.tile').first().waitFor();
  const ms = await page.evaluate(() => new Promise<number>((done) => requestAnimationFrame(() => done(performance.now()))));
  console.log(`usable ${Math.round(ms)} ms after the navigation began`);
  await context.close();
}
await browser.close();
await server.close();
