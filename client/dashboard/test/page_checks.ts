// SPDX-License-Identifier: Apache-2.0
// What every page of the dashboard must hold to, whichever server it comes from.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { Page } from 'playwright-core';

const axeSource = readFileSync(createRequire(`${process.cwd()}/package.json`).resolve('axe-core/axe.min.js'), 'utf8');

/** Sizes of screens: a desk's, and a phone held beside the wand. */
export const sizes = [{ name: 'desk', width: 1440, height: 900 }, { name: 'phone', width: 390, height: 844 }] as const;

/** Collects what a page complains about, and requests to any other origin. */
export function watchFaults(page: Page, origins: readonly string[]): string[] {
  const faults: string[] = [];
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => {
    // A refused or dropped call is logged by the browser itself.
    if (message.type() === 'error' && !message.text().includes('Failed to load resource')) faults.push(message.text());
  });
  page.on('request', (request) => {
    if (!origins.some((origin) => request.url().startsWith(origin)) && !/^(blob|data):/.test(request.url())) {
      faults.push(`foreign request: ${request.url()}`);
    }
  });
  return faults;
}

/** No fault of impact serious or critical; and nothing wider than the screen. */
export async function checkPage(page: Page, what: string): Promise<void> {
  await page.evaluate(axeSource);
  const found = await page.evaluate(async () => {
    const axe = (globalThis as unknown as { axe: { run: (root: Document, options: object) => Promise<{ violations:
      { id: string; impact: string; nodes: { target: string[]; failureSummary: string }[] }[]; passes: { id: string }[] }> } }).axe;
    const result = await axe.run(document, { resultTypes: ['violations'] });
    if (!result.passes.some((one) => one.id === 'color-contrast')) return ['axe-core looked at no text'];
    return result.violations.filter((one) => one.impact === 'serious' || one.impact === 'critical')
      .map((one) => `${one.id}: ${one.nodes.slice(0, 3).map((node) => `${node.target.join(' ')} ${node.failureSummary}`).join('; ')}`);
  });
  assert.deepEqual(found, [], what);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.equal(wide, 0, `${what}: wider than the screen by ${wide} px`);
}
