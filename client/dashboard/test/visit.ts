// SPDX-License-Identifier: Apache-2.0
// A visit of the page in Debian's Chromium against the mock server; nothing that the
// Content-Security-Policy forbids.
import assert from 'node:assert/strict';
import { after, before } from 'node:test';
import type { Browser, BrowserContext, Page } from 'playwright-core';
import { startChromium } from './chromium';
import { MockServer, type MockOptions } from './mock_server';
import { watchFaults } from './page_checks';

const dist = process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist';

let browser: Browser;
before(async () => { browser = await startChromium(); });
after(async () => { await browser.close(); });

/** What a test works with. */
export interface Visit {
  server: MockServer;
  address: string;
  context: BrowserContext;
  page: Page;
  /** What the page has complained about. */
  faults: string[];
}

/** Opens the page for `work`, and wants no faults of it. `init` runs in the page before its own code. */
export async function visit(size: { width: number; height: number }, options: Partial<MockOptions>,
  work: (visit: Visit) => Promise<void>, init?: () => void): Promise<void> {
  const server = new MockServer({ dist, speed: 0, ...options });
  const address = await server.listen();
  const context = await browser.newContext({ viewport: { width: size.width, height: size.height }, reducedMotion: 'reduce' });
  const page = await context.newPage();
  page.setDefaultTimeout(30000);
  const faults = watchFaults(page, [address]);
  if (init) await page.addInitScript(init);
  try {
    await work({ server, address, context, page, faults });
    assert.deepEqual(faults, []);
  } finally {
    await context.close();
    await server.close();
  }
}
