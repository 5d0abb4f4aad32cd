// SPDX-License-Identifier: Apache-2.0
// Debian's Chromium, driven by playwright-core.
import { type Browser, chromium } from 'playwright-core';

/** A headless browser, the program that run_test.mjs has found. WebGL is drawn by software. */
export function startChromium(): Promise<Browser> {
  return chromium.launch({ executablePath: process.env['RIGCAL_CHROMIUM'], headless: true,
    args: ['--no-sandbox', '--disable-dev-shm-usage', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'] });
}
