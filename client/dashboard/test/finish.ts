// SPDX-License-Identifier: Apache-2.0
// A real rigcal-server on loopback and an agent with recorded markers, by clicks alone: wave, calibrate and activate
// in the distance mode; set the floor, and download undistorted cameras, on the page of the result.
// RIGCAL_PROGRAMS: folder of the programs. RIGCAL_SHOTS: folder for a picture of each page; unset: none.
import assert from 'node:assert/strict';
import { type ChildProcess, execFileSync, spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import type { Browser } from 'playwright-core';
import { startChromium } from './chromium';
import { millimetres } from '../src/view/format';
import { checkPage, sizes, watchFaults } from './page_checks';
import { radiusM, writeRecordedRig } from './recorded_rig';

const programs = process.env['RIGCAL_PROGRAMS'] ?? '../../build/test/bin';
const shots = process.env['RIGCAL_SHOTS'];
const patienceMs = 120_000;
const children: ChildProcess[] = [];
let browser: Browser;
let folder = '';

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'rigcal-finish-'));
  if (shots) mkdirSync(shots, { recursive: true });
  browser = await startChromium();
});

after(async () => {
  await browser?.close();
  const ended = children.map((child) => new Promise((done) => { child.on('exit', done); if (child.exitCode !== null) done(0); }));
  for (const child of children.reverse()) child.kill('SIGTERM');
  await Promise.all(ended);
  rmSync(folder, { recursive: true, force: true });
});

function start(program: string, parts: string[]): void {
  children.push(spawn(join(programs, program), parts, { stdio: ['ignore', 'ignore', 'inherit'], env: { ...process.env, OMP_THREAD_LIMIT: '1' } }));
}

async function portIn(file: string): Promise<string> {
  for (const end = Date.now() + patienceMs; Date.now() < end;) {
    const text = existsSync(file) ? readFileSync(file, 'utf8').trim() : '';
    if (text !== '') return text;
    await new Promise((done) => setTimeout(done, 50));
  }
  return assert.fail(`no port in ${file}`);
}

for (const size of sizes) {
  test(`${size.name}: wave, calibrate, activate, set the floor, download undistorted Blender`, { timeout: 3 * patienceMs }, async () => {
    const here = mkdtempSync(join(folder, `${size.name}-`));
    const names = writeRecordedRig(here);
    start('rigcal-server', ['--listen', '127.0.0.1:0', '--data-dir', join(here, 'data'), '--port-file', join(here, 'port'),
      '--http-port-file', join(here, 'http_port'), '--log-level', 'warn']);
    const [port, httpPort] = [await portIn(join(here, 'port')), await portIn(join(here, 'http_port'))];
    const address = `http://127.0.0.1:${httpPort}`;
    const context = await browser.newContext({ viewport: { width: size.width, height: size.height }, reducedMotion: 'reduce' });
    await context.addInitScript(() => localStorage.setItem('rigcal', JSON.stringify({ scene: 'plan', untilMm: '' })));
    const page = await context.newPage();
    page.setDefaultTimeout(patienceMs);
    const faults = watchFaults(page, [address]);
    const check = async (what: string): Promise<void> => {
      await checkPage(page, `${size.name}: ${what}`);
      if (shots) await page.screenshot({ path: join(shots, `finish-${what.replaceAll(' ', '-')}-${size.name}.png`), fullPage: what === 'result' });
    };

    // Without a camera there is nothing to press.
    await page.goto(`${address}/#/wave`);
    await page.getByText('No camera is connected').first().waitFor();
    assert.equal(await page.getByRole('button', { name: /Start/ }).count(), 0);
    await check('no camera');
    await page.getByRole('link', { name: 'Join', exact: true }).click();
    await page.getByText('rigcal-server --listen 0.0.0.0', { exact: true }).waitFor();
    await check('join');
    start('rigcal-agent', ['--server', `127.0.0.1:${port}`, '--state-dir', join(here, 'agent'), '--log-level', 'warn',
      ...names.flatMap((name) => ['--source', `${name}=csv:${join(here, `${name}.csv`)};speed=max`])]);

    await page.getByRole('link', { name: 'Wave', exact: true }).click();
    await page.getByRole('heading', { name: 'Cameras (4)' }).waitFor();
    await page.getByLabel('Marker diameter, m').fill(String(2 * radiusM));
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByRole('link', { name: 'Distance mode' }).click();
    // A recording ends by itself.
    await page.getByRole('button', { name: 'Calibrate', exact: true, disabled: false }).waitFor();
    await check('recorded');
    await page.getByRole('button', { name: 'Calibrate', exact: true }).click();
    await page.getByRole('heading', { name: /good: use it/ }).waitFor();
    await check('grade');
    await page.getByRole('button', { name: 'Activate', exact: true }).click();
    await page.getByText(/Active since/).waitFor();
    await page.getByRole('link', { name: 'Floor, downloads' }).click();
    await page.getByRole('heading', { name: /c-000001, version 1 of rig/ }).waitFor();

    // One figure, in the same words, on the page, in the API and on the command line.
    const solved = (await page.evaluate(async () => (await fetch('/v1/calibrations/c-000001')).json() as Promise<unknown>)) as
      { calibration: { headline: { point_error_m: number; used_mean_px: number }; target: { scale_sigma_rel: number } } };
    const { headline, target } = solved.calibration;
    const error = `${millimetres(1e3 * headline.point_error_m)} mm`;
    const scale = `+ ${(100 * target.scale_sigma_rel).toFixed(2)} % of every length`;
    const shown = (await page.locator('.panel.summary').innerText()).replaceAll(/\s+/g, ' ');
    for (const words of [`expected error ${error}`, scale, `${headline.used_mean_px.toFixed(3)} px`]) assert.ok(shown.includes(words), `${words} in ${shown}`);
    const printed = execFileSync(join(programs, 'rigcal'), ['--server', `127.0.0.1:${port}`, 'calibration', 'get', 'c-000001'], { encoding: 'utf8' })
      .replaceAll(/\s+/g, ' ');
    for (const words of [`expected error ${error} ${scale}`, `${headline.used_mean_px.toFixed(3)} px`]) assert.ok(printed.includes(words), `${words} in ${printed}`);

    const frame = page.locator('.panel.frame');
    assert.equal(await frame.getByLabel('Height of the marker centres').inputValue(), String(radiusM));
    await frame.getByLabel('Recording').selectOption('s-000001');
    await frame.getByRole('button', { name: 'Set floor' }).click();
    await page.getByRole('heading', { name: /c-000002, version 2 of rig/ }).waitFor();
    await frame.getByText('The frame is z = 0 is the floor, z up').waitFor();
    await page.locator('.panel.summary').getByRole('button', { name: 'Activate', exact: true }).click();
    await page.locator('.panel.summary').getByText(/Active since/).waitFor();
    await page.locator('.panel.history').getByRole('button', { name: 'Roll back to c-000001' }).waitFor();
    assert.equal(await page.locator('.panel.history tbody tr').count(), 2);
    await page.locator('.plans canvas').first().waitFor();
    await check('result');

    const downloads = page.locator('.panel.downloads');
    await downloads.getByRole('link', { name: 'JSON', exact: true }).waitFor();
    assert.equal(await downloads.getByRole('link', { name: 'Blender', exact: true }).count(), 0, 'a lens that Blender does not have');
    await downloads.getByLabel(/Undistorted/).check();
    const waiting = page.waitForEvent('download');
    await downloads.getByRole('link', { name: 'Blender', exact: true }).click();
    const download = await waiting;
    assert.equal(download.suggestedFilename(), 'c-000002-blender-undistorted.py');
    assert.match(readFileSync(await download.path(), 'utf8'), /cam3/);
    const answer = await page.evaluate(async () => (await fetch('/v1/calibrations/c-000002')).json() as Promise<unknown>);
    const { calibration } = answer as { calibration: { cameras: { camera: string; cam_from_rig: { rotation: Record<string, number>; translation_m: Record<string, number> } }[] } };
    // The cameras hang where they were put, above the floor.
    for (const [i, camera] of calibration.cameras.entries()) {
      const { w = 0, x = 0, y = 0, z = 0 } = camera.cam_from_rig.rotation;
      const t = camera.cam_from_rig.translation_m;
      const third = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
      const height = -(third[0]! * (t['x'] ?? 0) + third[1]! * (t['y'] ?? 0) + third[2]! * (t['z'] ?? 0));
      assert.ok(Math.abs(height - (2.1 + 0.15 * i)) < 0.01, `${camera.camera} is ${height} m above the floor`);
    }
    assert.deepEqual(faults, []);
    await context.close();
  });
}
