// SPDX-License-Identifier: Apache-2.0
// The page of a real rigcal-server with real agents, by clicks alone: a PC joins with the string of
// the join page, a person logs in with the link, waves, stops, calibrates, and downloads every export.
// RIGCAL_PROGRAMS: folder of the programs. RIGCAL_SHOTS: folder for a picture of each page; unset: none.
import assert from 'node:assert/strict';
import { type ChildProcess, execFileSync, spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { startChromium } from './chromium';
import { checkPage, sizes, watchFaults } from './page_checks';

const programs = process.env['RIGCAL_PROGRAMS'] ?? '../../build/test/bin';
const shots = process.env['RIGCAL_SHOTS'];
const patienceMs = 120_000;
const children: ChildProcess[] = [];
let browser: Browser;
let folder = '';
let ports = { http: '', https: '' };

function start(program: string, parts: string[]): void {
  const child = spawn(join(programs, program), parts, { stdio: ['ignore', 'ignore', 'inherit'], env: { ...process.env, OMP_THREAD_LIMIT: '1' } });
  children.push(child);
}

async function until<T>(what: string, read: () => T | undefined): Promise<T> {
  for (const end = Date.now() + patienceMs; Date.now() < end;) {
    const value = read();
    if (value !== undefined) return value;
    await new Promise((done) => setTimeout(done, 50));
  }
  return assert.fail(`never: ${what}`);
}

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'rigcal-real-'));
  if (shots) mkdirSync(shots, { recursive: true });
  // An address under [https] makes it a server that others join: with TLS, tokens and cookies.
  writeFileSync(join(folder, 'server.toml'), '[https]\nlisten = "127.0.0.1:0"\n');
  start('rigcal-server', ['--config', join(folder, 'server.toml'), '--listen', '127.0.0.1:0', '--data-dir', join(folder, 'data'),
    '--http-port-file', join(folder, 'http_port'), '--log-level', 'warn']);
  const port = await until('the server\'s port', () => (existsSync(join(folder, 'http_port')) &&
    readFileSync(join(folder, 'http_port'), 'utf8').trim()) || undefined);
  ports = { http: `http://127.0.0.1:${port}`, https: `https://127.0.0.1:${port}` };
  browser = await startChromium();
});

after(async () => {
  await browser?.close();
  const ended = children.map((child) => new Promise((done) => { child.on('exit', done); if (child.exitCode !== null) done(0); }));
  for (const child of children.reverse()) child.kill('SIGTERM');
  await Promise.all(ended);
  rmSync(folder, { recursive: true, force: true });
});

interface Visit {
  page: Page;
  check: (what: string) => Promise<void>;
}

/** Checks a page, and takes its picture where somebody wants to look at it. */
function checker(page: Page, size: string): (what: string) => Promise<void> {
  return async (what) => {
    await checkPage(page, `${size}: ${what}`);
    if (shots) await page.screenshot({ path: join(shots, `${what.replaceAll(' ', '-')}-${size}.png`), fullPage: what !== 'distance' });
  };
}

/** A PC joins with the string that the page shows, and brings its cameras. */
async function joinPc({ page, check }: Visit, name: string, cameras: readonly number[]): Promise<void> {
  await page.goto(`${ports.http}/#/join`);
  await page.getByLabel('Name').fill(name);
  await page.getByRole('button', { name: 'Make a join string' }).click();
  const command = await page.getByText(/^rigcal-agent join rk1\./).textContent();
  await check('join');
  const state = join(folder, name);
  execFileSync(join(programs, 'rigcal-agent'), ['join', command!.split(' ')[2]!, '--state-dir', state], { stdio: 'ignore' });
  start('rigcal-agent', ['--state-dir', state, '--log-level', 'warn',
    ...cameras.flatMap((i) => ['--source', `sim:camera=${i};cameras=4;rate=50;duration=600;speed=1`])]);
  await page.locator('.panel.who').getByText(name).waitFor();
}

/** A person logs in elsewhere, with the link that the page shows. */
async function loginLink(page: Page): Promise<string> {
  await page.getByLabel(/A person who calibrates/).check();
  await page.getByRole('button', { name: 'Make a join string' }).click();
  return (await page.getByText(/\/login#token=rk1\./).textContent())!;
}

async function downloads(page: Page, id: string): Promise<void> {
  for (const [link, name, begins] of [['OpenCV YAML', `${id}-opencv.zip`, 'PK'], ['JSON', `${id}-json.json`, '{']] as const) {
    const waiting = page.waitForEvent('download');
    await page.getByRole('link', { name: link, exact: true }).click();
    const download = await waiting;
    assert.equal(download.suggestedFilename(), name);
    const content = readFileSync(await download.path(), 'latin1');
    assert.ok(content.startsWith(begins), `${name} begins with ${content.slice(0, 20)}`);
    if (begins === '{') assert.equal((JSON.parse(content) as { id: string }).id, id);
  }
}

for (const [turn, size] of sizes.entries()) {
  test(`${size.name}: a whole wave, from the join page to the downloads`, { timeout: 3 * patienceMs }, async () => {
    const viewport = { width: size.width, height: size.height };
    const context = await browser.newContext({ viewport, ignoreHTTPSErrors: true, reducedMotion: 'reduce' });
    const page = await context.newPage();
    page.setDefaultTimeout(patienceMs);
    const faults = watchFaults(page, [ports.http, ports.https]);
    const check = checker(page, size.name);
    await joinPc({ page, check }, `pc-${turn + 1}`, turn === 0 ? [0, 1, 2] : [3]);
    const link = await loginLink(page);
    assert.ok(link.startsWith(`${ports.https}/login#token=`), link);

    // From here on by TLS, as somebody else.
    await page.goto(link);
    await page.getByRole('link', { name: 'Wave', exact: true }).click();
    await page.getByRole('heading', { name: `Cameras (${turn + 3})` }).waitFor();
    if (turn === 1) await page.getByRole('button', { name: 'New capture' }).click();
    await page.getByLabel('Markers along the wand, m').fill('0, 0.13, 0.39');
    await page.getByLabel('Stop below, mm').fill(turn === 0 ? '20' : '');
    if (turn === 0) await page.getByLabel('Not before, s').fill('6');
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    await page.locator('.big .digits').filter({ hasText: /^\d/ }).waitFor();
    await page.locator('.scene canvas, .plans canvas').first().waitFor();
    await check('wave');
    await page.getByRole('link', { name: 'Distance mode' }).click();
    await page.locator('.distance .huge .digits').filter({ hasText: /^\d/ }).waitFor();
    await check('distance');
    await page.getByRole('link', { name: 'Back' }).click();

    if (turn === 0) {
      await page.getByText(/Stopped by itself: the expected error is/).waitFor();
      await page.getByRole('button', { name: 'Throw away' }).click();
      await page.getByRole('button', { name: 'Take it back' }).click();
      await page.getByRole('button', { name: 'Resume' }).click();
      await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    }
    await page.getByRole('button', { name: 'Stop capture' }).click();
    await page.getByRole('button', { name: 'Calibrate', exact: true }).click();
    const heading = await page.getByRole('heading', { name: /^c-\d+, version \d+ of rig/ }).textContent();
    const id = /c-\d+/.exec(heading!)![0];
    assert.equal(await page.locator('.percamera tbody tr').count(), turn + 3);
    await page.locator('.plots canvas').first().waitFor();
    assert.equal(await page.locator('.plots .plot').count(), turn + 3);
    if (turn === 1) {
      await page.locator('.compare select').selectOption('c-000001');
      await page.getByText(/both as seen from/).waitFor();
    }
    await page.locator('.result .scene canvas, .result .plans canvas').first().waitFor();
    await check('result');
    await downloads(page, id);

    await page.getByRole('link', { name: 'Sessions', exact: true }).click();
    await page.getByRole('link', { name: id, exact: true }).waitFor();
    await check('sessions');
    await page.getByRole('link', { name: 'Rig', exact: true }).click();
    await page.getByRole('heading', { name: `Agents (${turn + 1})` }).waitFor();
    await check('rig');
    assert.deepEqual(faults, []);
    await context.close();
  });
}
