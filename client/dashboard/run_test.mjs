// SPDX-License-Identifier: Apache-2.0
// Bundles a test program and runs it: node run_test.mjs unit|browser|real|finish|heap|usable|many|shots|mock
// What cannot run here says so on a line "[  SKIPPED ] ...".
import { build } from 'esbuild';
import { spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, readdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const kind = process.argv[2] ?? 'unit';
const files = {
  unit: readdirSync(join(here, 'test')).filter((name) => name.endsWith('_test.ts')).map((name) => `test/${name}`),
  browser: ['test/browser_finish.ts', 'test/browser_lens.ts', 'test/browser_sessions.ts', 'test/browser_page.ts', 'test/browser_pattern.ts', 'test/browser_many.ts'], real: ['test/real.ts'], finish: ['test/finish.ts'], heap: ['test/heap.ts'], shots: ['test/shots.ts'], usable: ['test/usable.ts'], many: ['test/many.ts'], mock: ['test/mock_main.ts'],
}[kind];
if (!files) throw new Error(`run_test: unit, browser, real, finish, heap, usable, many, shots or mock, not "${kind}"`);
const env = { ...process.env };
if (kind !== 'unit' && kind !== 'mock') {
  env.RIGCAL_CHROMIUM ??= ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!env.RIGCAL_CHROMIUM) {
    console.log('[  SKIPPED ] chromium is not installed; deploy/install-deps.sh installs it');
    process.exit(0);
  }
}
const out = join(here, 'node_modules/.cache/rigcal', kind);
mkdirSync(out, { recursive: true });
await build({ absWorkingDir: here, entryPoints: files, outdir: out, bundle: true, format: 'esm', platform: 'node',
  target: 'node18', packages: 'external', external: ['*/proto_types.mjs'], outExtension: { '.js': '.mjs' },
  sourcemap: 'inline', jsx: 'automatic', jsxImportSource: 'preact', logLevel: 'warning' });
const programs = files.map((file) => join(out, file.replace('test/', '').replace('.ts', '.mjs')));
const test = kind === 'unit' || kind === 'browser' || kind === 'real' || kind === 'finish' ? ['--test'] : [];
const result = spawnSync(process.execPath, ['--enable-source-maps', ...test, ...programs],
  { cwd: here, stdio: 'inherit', env });
process.exit(result.status ?? 1);
