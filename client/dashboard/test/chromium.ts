// SPDX-License-Identifier: Apache-2.0
// Debian's Chromium, driven by playwright-core.
import { existsSync } from 'node:fs';
import { type Browser, chromium } from 'playwright-core';

const places = [process.env['RIGCAL_CHROMIUM'], '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];

/** The browser's program; ends the process as skipped where there is none. */
export function chromiumProgram(): string {
  const found = places.find((place) => place && existsSync(place));
  if (found) return found;
  console.log('[  SKIPPED ] chromium is not installed; deploy/install-deps.sh installs it');
  process.exit(0);
}

/** A headless browser. WebGL is drawn by software. */
export function startChromium(extra: readonly string[] = []): Promise<Browser> {
  return chromium.launch({ executablePath: chromiumProgram(), headless: true,
    args: ['--no-sandbox', '--disable-dev-shm-usage', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', ...extra] });
}
