// SPDX-License-Identifier: Apache-2.0
// The page in Debian's Chromium against the mock server: a whole wave by clicks, on a desk and on a
// phone; no fault that axe-core calls serious; nothing that the Content-Security-Policy forbids.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import type { Browser, BrowserContext, Page } from 'playwright-core';
import { startChromium } from './chromium';
import { MockServer, type MockOptions } from './mock_server';
import { checkPage, sizes, watchFaults } from './page_checks';

const dist = process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist';

let browser: Browser;
before(async () => { browser = await startChromium(); });
after(async () => { await browser.close(); });

interface Visit {
  server: MockServer;
  address: string;
  context: BrowserContext;
  page: Page;
  /** What the page has complained about. */
  faults: string[];
}

async function visit(size: { width: number; height: number }, options: Partial<MockOptions>,
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

for (const size of sizes) {
  test(`${size.name}: a whole wave, from join to the downloaded calibration`, async () => {
    await visit(size, {}, async ({ server, address, page }) => {
      await page.goto(`${address}/#/join`);
      await page.getByRole('button', { name: 'Make a join string' }).click();
      await page.getByText(/^rigcal-agent join rk1\./).waitFor();
      await page.getByRole('img', { name: 'QR code of the command' }).waitFor();
      await checkPage(page, 'join');
      await page.getByLabel(/A person who calibrates/).check();
      await page.getByRole('button', { name: 'Make a join string' }).click();
      await page.getByText(/\/login#token=rk1\./).waitFor();
      await page.getByRole('img', { name: 'QR code of the link' }).waitFor();

      await page.getByRole('link', { name: 'Wave', exact: true }).click();
      await page.getByRole('heading', { name: 'Cameras (8)' }).waitFor();
      await page.getByLabel('Markers along the wand, m').fill('0, 130, 390');
      await page.getByText('positions are in metres').waitFor();
      await page.getByLabel('Markers along the wand, m').fill('0.13, 0');
      await page.getByText('The first marker is at 0.').waitFor();
      assert.ok(await page.getByRole('button', { name: 'Start capture' }).isDisabled());
      await page.getByText('event_3 is an event camera').waitFor();
      await page.getByLabel('Markers along the wand, m').fill('wand:0,0.13,0.39;diameter=0.04;hz=500');
      assert.equal(await page.getByLabel('Marker diameter, m').inputValue(), '0.04', 'a text of the command line fills all fields');
      assert.equal(await page.getByText('event_3 is an event camera').count(), 0);
      await page.getByLabel('Stop below, mm').fill('0.9');
      await page.getByText('Cameras: all 8').click();
      await page.getByLabel('frame_2', { exact: true }).uncheck();
      await page.getByText('Cameras: 7 of 8').waitFor();
      await checkPage(page, 'wave before the start');
      await page.getByRole('button', { name: 'Start capture' }).click();
      await page.getByRole('button', { name: 'Stop capture' }).waitFor();
      assert.equal(server.rig.session?.goal?.until_mm, 0.9);
      assert.deepEqual(server.rig.session?.target, { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39], diameter_m: 0.04, blink_hz: [500] });
      assert.equal(server.rig.session?.requested_cameras?.length, 7);
      assert.ok(!server.rig.session?.requested_cameras?.includes('frame_2'));
      assert.deepEqual(server.rig.session?.target?.marker_positions_m, [0, 0.13, 0.39]);

      server.rig.advance(3);
      await page.getByText('both see it').first().waitFor();
      server.rig.cameras[2]!.blind = true;
      server.rig.advance(9);
      await page.locator('.big .digits').filter({ hasText: /^\d+\.\d+$/ }).waitFor();
      await page.getByText(/has not seen the wand for/).first().waitFor();
      await page.locator('.tile.bad').getByText('no wand').waitFor();
      await page.locator('.scene canvas').waitFor();
      await checkPage(page, 'wave');
      await page.getByRole('button', { name: 'Top and side' }).click();
      assert.equal(await page.locator('.plans canvas').count(), 2);

      await page.getByRole('link', { name: 'Distance mode' }).click();
      await page.locator('.distance .huge').waitFor();
      await checkPage(page, 'distance');
      for (const word of ['Beeps on', 'Voice off']) assert.ok(await page.getByRole('button', { name: word }).isVisible());
      await page.getByRole('button', { name: 'Beeps on' }).click();
      await page.getByRole('button', { name: 'Beeps off' }).waitFor();
      server.rig.advance(240);
      await page.getByText('Good enough').first().waitFor();
      await page.getByRole('link', { name: 'Back' }).click();

      await page.getByText(/Stopped by itself: the expected error is/).waitFor();
      await page.getByRole('button', { name: 'Calibrate', exact: true }).click();
      await page.getByRole('heading', { name: /is being solved/ }).waitFor();
      await page.getByRole('heading', { name: /version 3 of rig/ }).waitFor();
      await page.getByText('usable, aware of the reasons').waitFor();
      await page.locator('.result .scene canvas, .result .plans canvas').first().waitFor();
      assert.equal(await page.locator('.percamera tbody tr').count(), 8);
      await page.getByRole('button', { name: 'RMS px' }).click();
      const rms = await page.locator('.percamera tbody td:nth-child(2)').allTextContents();
      assert.deepEqual(rms, [...rms].sort((a, b) => Number(a) - Number(b)));
      await page.locator('.compare select').selectOption('c-000001');
      await page.getByText(/both as seen from/).waitFor();
      assert.equal(await page.locator('.compare tbody tr').count(), 8);
      assert.equal(await page.locator('.plots .plot').count(), 8);
      const drawn = await page.locator('.plots canvas').first().evaluate((canvas: HTMLCanvasElement) => {
        const data = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height).data;
        const colours = new Set<string>();
        for (let i = 0; i < data.length; i += 4) colours.add(`${data[i]},${data[i + 1]},${data[i + 2]}`);
        return colours.size;
      });
      assert.ok(drawn > 4, 'vectors are drawn');
      await checkPage(page, 'result');
      const waiting = page.waitForEvent('download');
      await page.getByRole('link', { name: 'JSON', exact: true }).click();
      const download = await waiting;
      assert.equal(download.suggestedFilename(), 'c-000003-json.json');
      const saved = JSON.parse(readFileSync(await download.path(), 'utf8')) as { id: string; cameras: unknown[] };
      assert.equal(saved.id, 'c-000003');
      assert.equal(saved.cameras.length, 8);
      assert.equal(await page.getByRole('link', { name: 'none' }).count(), 0, 'a format that cannot be had is no link');
      await page.getByText('it has no metric scale').waitFor();
    });
  });

  test(`${size.name}: rig with previews, lists with filter, delete after a question`, async () => {
    await visit(size, {}, async ({ server, address, page }) => {
      await page.goto(`${address}/#/rig`);
      await page.getByRole('heading', { name: 'Agents (3)' }).waitFor();
      await page.locator('.preview img').first().scrollIntoViewIfNeeded();
      await page.locator('.preview img:not(.none)').first().waitFor();
      await checkPage(page, 'rig');
      assert.ok(server.counts.previewsAtOnce <= 2, `${server.counts.previewsAtOnce} previews at once`);
      assert.ok(server.counts.previews > 0);

      await page.getByRole('link', { name: 'Sessions', exact: true }).click();
      await page.getByRole('link', { name: 's-000002' }).waitFor();
      await checkPage(page, 'records');
      await page.getByLabel('Find').fill('first');
      await page.getByRole('link', { name: 's-000002' }).waitFor({ state: 'detached' });
      await page.getByLabel('Find').fill('');
      await page.getByRole('link', { name: 's-000001' }).click();
      await page.getByRole('heading', { name: 'Session s-000001' }).waitFor();
      await page.getByRole('button', { name: 'Delete s-000001' }).click();
      await page.getByRole('dialog').getByRole('button', { name: 'Keep' }).click();
      assert.ok(server.sessions.has('s-000001'), 'kept');
      await page.getByRole('button', { name: 'Delete s-000001' }).click();
      await checkPage(page, 'question');
      await page.getByRole('dialog').getByRole('button', { name: 'Delete' }).click();
      await page.getByRole('button', { name: 'Delete s-000001' }).waitFor({ state: 'detached' });
      assert.ok(!server.sessions.has('s-000001'), 'deleted');
      await page.getByLabel('Select s-000002').check();
      await page.getByRole('button', { name: 'Calibrate', exact: true }).click();
      await page.waitForURL(/#\/result\/c-000003/);
      assert.equal(server.counts.withoutHeader, 0);
    });
  });

  test(`${size.name}: mask and colour of a detector, by keys; previews that a camera does not give`, async () => {
    await visit(size, {}, async ({ server, address, page }) => {
      const name = server.rig.cameras.find((camera) => !camera.name.startsWith('event'))!.name;
      server.withoutPreviews.add(name);
      await page.goto(`${address}/#/rig`);
      const open = page.getByRole('button', { name: `Mask and colour of ${name}`, exact: true });
      await open.waitFor();
      const agentCameras = server.rig.cameras.filter((camera) => !camera.name.startsWith('event'));
      assert.equal(await page.getByRole('button', { name: /^Mask and colour of/ }).count(), agentCameras.length, 'event cameras have none');
      await page.locator('.preview img').first().scrollIntoViewIfNeeded();
      await page.getByText('its source yields observations').waitFor();

      await open.focus();
      await page.keyboard.press('Enter');
      const dialog = page.getByRole('dialog', { name: `Detector of ${name}` });
      await dialog.getByText('0° to 50°').waitFor();
      await dialog.getByRole('button', { name: 'Learn mask' }).focus();
      await page.keyboard.press('Enter');
      await dialog.getByText(/takes frames only while a session captures/).waitFor();
      await checkPage(page, 'detector refused');

      server.rig.create({ id: 's-000009', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] } });
      server.rig.start();
      await dialog.getByRole('button', { name: 'Learn mask' }).press('Enter');
      await dialog.getByText(/Learning the mask: \d+ of 100 frames/).waitFor();
      assert.ok(await dialog.getByRole('button', { name: 'Tune colour' }).isDisabled());
      await dialog.getByText('The mask is in use').waitFor();
      await dialog.getByText(/1.?234 pixels.*mask learnt here/).waitFor();
      server.learningFault = 'nothing like the wand in 50 of 50 frames; show all of it';
      await dialog.getByRole('button', { name: 'Tune colour' }).press('Enter');
      await dialog.getByText('nothing like the wand').waitFor();
      server.learningFault = '';
      await dialog.getByRole('button', { name: 'Tune colour' }).press('Enter');
      await dialog.getByText('The colour is in use').waitFor();
      await dialog.getByText('340° to 15°').waitFor();
      await dialog.getByText('Colour by hand').press('Enter');
      await dialog.getByLabel('Brightness from').fill('300');
      assert.ok(await dialog.getByRole('button', { name: 'Use this colour' }).isDisabled());
      await dialog.getByLabel('Brightness from').fill('90');
      await checkPage(page, 'detector');
      await dialog.getByRole('button', { name: 'Use this colour' }).press('Enter');
      await dialog.getByText('brightness from 90').waitFor();
      assert.deepEqual(server.detectors.get(name)?.colour,
        { hue_min_deg: 340, hue_max_deg: 15, saturation_min: 0.35, value_min: 90, washed_out_min: 250 });
      await dialog.getByRole('button', { name: "Back to the agent's configuration" }).press('Enter');
      await dialog.getByText('0° to 50°').waitFor();
      await dialog.getByRole('button', { name: 'Forget mask' }).press('Enter');
      await dialog.getByRole('button', { name: 'Forget mask' }).waitFor({ state: 'detached' });
      await page.keyboard.press('Escape');
      await dialog.waitFor({ state: 'detached' });
      assert.ok(await open.evaluate((button) => button === document.activeElement), 'the focus is back');
      assert.equal(server.counts.withoutHeader, 0);

      // Once before the session, and once when it had begun; others go on once a second.
      while (server.counts.refusedPreviews < 2) await page.waitForTimeout(50);
      await page.locator('.preview img').nth(1).scrollIntoViewIfNeeded();
      await page.locator('.preview img:not(.none)').first().waitFor();
      const before = server.counts.previews;
      while (server.counts.previews < before + 6) await page.waitForTimeout(50);
      assert.equal(server.counts.refusedPreviews, 2);
    });
  });
}

test('a server that is gone: a banner with the age, no frozen numbers; back by itself, and restarted', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    server.rig.advance(20);
    await page.goto(address);
    await page.locator('.big .digits').filter({ hasText: /^\d/ }).waitFor();
    server.failing = true;
    await page.getByText(/Data are \d+ s old/).waitFor();
    assert.equal(await page.locator('.big .digits').textContent(), '–');
    assert.match((await page.locator('.tile').first().textContent()) ?? '', /not known/);
    assert.ok(await page.getByRole('button', { name: 'Stop capture' }).isDisabled(), 'nothing that the server would have to do can be pressed');
    await page.getByText('Alerts are not known').waitFor();
    assert.equal(await page.getByText('No alerts').count(), 0);
    assert.match(await page.locator('.panel.tiles').evaluate((panel) => getComputedStyle(panel).filter), /grayscale/);
    await page.getByRole('link', { name: 'Distance mode' }).click();
    assert.ok(await page.getByRole('button', { name: 'Stop' }).isDisabled());
    await page.getByRole('link', { name: 'Back' }).click();
    await page.getByRole('link', { name: 'Rig', exact: true }).click();
    await page.getByText('does not answer').first().waitFor();
    assert.equal(await page.locator('.panel.agents .chip.good, .panel.cameras .chip.live').count(), 0);
    await page.getByRole('link', { name: 'Wave', exact: true }).click();
    await checkPage(page, 'stale');
    server.restart();
    server.failing = false;
    await page.getByText(/The server was restarted/).waitFor();
    await page.locator('.big .digits').filter({ hasText: /^\d/ }).waitFor();
    assert.equal(await page.getByText(/Data are/).count(), 0);
    await page.getByRole('button', { name: 'Read' }).click();
    await page.getByText(/The server was restarted/).waitFor({ state: 'detached' });
  });
});

for (const size of sizes) {
  test(`${size.name}: from the wave to the file, in the distance mode and on its result`, async () => {
    await visit(size, {}, async ({ server, address, page }) => {
      await page.goto(`${address}/#/distance`);
      await page.getByRole('button', { name: 'Start', exact: true }).click();
      await page.getByRole('button', { name: 'Stop' }).waitFor();
      server.rig.advance(400);
      await page.getByText('Good enough').first().waitFor();
      assert.equal(await page.getByRole('button', { name: 'Start', exact: true }).count(), 0, 'what follows is the calibration');
      await page.getByRole('button', { name: 'Calibrate', exact: true }).click();
      await page.getByRole('heading', { name: 'Calibrating' }).waitFor();
      await page.getByRole('heading', { name: /usable, aware of the reasons/ }).waitFor();
      await checkPage(page, 'grade');
      const first = server.activations.length;
      server.activationFault = 'c-000003 has no camera frame_4, which the active calibration has';
      await page.getByRole('button', { name: 'Activate', exact: true }).click();
      await page.getByText('has no camera frame_4').waitFor();
      assert.equal(server.activations.length, first);
      await page.getByRole('button', { name: 'Activate it nevertheless' }).click();
      await page.getByText(/Active since/).waitFor();
      server.activationFault = '';
      assert.deepEqual([server.activations[0]?.calibration_id, server.activations[0]?.forced], ['c-000003', true]);
      // The page knows it again after a reload.
      await page.reload();
      await page.getByRole('heading', { name: /usable, aware of the reasons/ }).waitFor();

      await page.getByRole('link', { name: 'Floor, downloads' }).click();
      await page.getByRole('heading', { name: /c-000003, version 3 of rig/ }).waitFor();
      await page.getByText(/Active since/).waitFor();
      const frame = page.locator('.panel.frame');
      assert.equal(await frame.getByLabel('Height of the marker centres').inputValue(), '0.02', 'half the diameter of the wand');
      assert.ok(await frame.getByRole('button', { name: 'Set floor' }).isDisabled(), 'there is no recording');
      await frame.getByRole('button', { name: 'Record now' }).click();
      await frame.getByRole('button', { name: 'Stop recording' }).waitFor();
      const floor = server.rig.session!;
      assert.deepEqual(floor.target?.marker_positions_m, [0, 0.13, 0.39], 'the wand of the calibration');
      server.rig.advance(6);
      await frame.getByRole('button', { name: 'Stop recording' }).click();
      await checkPage(page, 'floor');
      await frame.getByRole('button', { name: 'Set floor', disabled: false }).click();
      await page.getByRole('heading', { name: /c-000004, version 4 of rig/ }).waitFor();
      assert.deepEqual(server.calibrations.get('c-000004')?.options,
        { kind: 'KIND_ORIGIN', parent_id: 'c-000003', origin: { source: 'FRAME_SOURCE_FLOOR', height_m: 0.02 } });
      assert.deepEqual(server.calibrations.get('c-000004')?.session_ids, [floor.id]);
      await frame.getByText('The frame is z = 0 is the floor, z up').waitFor();
      await page.locator('.panel.summary').getByRole('button', { name: 'Activate', exact: true }).click();
      await page.locator('.panel.summary').getByText(/Active since/).waitFor();

      const history = page.locator('.panel.history');
      await history.getByText('c-000004').waitFor();
      assert.equal(await history.locator('tbody tr').count(), 2);
      await history.getByText('against the refusal').waitFor();
      await history.getByRole('button', { name: 'Roll back to c-000003' }).click();
      await history.getByText('rolled back').waitFor();
      await page.locator('.panel.summary').getByRole('button', { name: 'Activate', exact: true }).waitFor();
      assert.equal(server.activations[0]?.calibration_id, 'c-000003');

      const downloads = page.locator('.panel.downloads');
      await downloads.getByText('its cameras have no lens distortion').waitFor();
      assert.equal(await downloads.getByRole('link', { name: 'Blender' }).count(), 0);
      await downloads.getByLabel(/Undistorted/).check();
      const waiting = page.waitForEvent('download');
      await downloads.getByRole('link', { name: 'Blender' }).click();
      assert.equal((await waiting).suggestedFilename(), 'c-000004-blender-undistorted.py');
      const wide = await downloads.evaluate((panel) => panel.getBoundingClientRect().width / document.documentElement.clientWidth);
      assert.ok(wide > 0.9, 'the downloads use the width');
      await checkPage(page, 'finished');
      await page.getByRole('link', { name: 'Sessions', exact: true }).click();
      await page.locator('.panel.calibrations tr', { hasText: 'c-000003' }).locator('.chip.good', { hasText: 'active' }).waitFor();
    }, () => localStorage.setItem('rigcal', JSON.stringify({ untilMm: '0.9', scene: 'plan' })));
  });

  test(`${size.name}: without a camera there is nothing to start, and a server for its own PC says what to start`, async () => {
    await visit(size, { cameras: 0, local: true }, async ({ address, page }) => {
      await page.goto(address);
      await page.getByText('No camera is connected').first().waitFor();
      await page.getByText('rigcal-agent').first().waitFor();
      assert.equal(await page.getByRole('button', { name: /Start/ }).count(), 0);
      await checkPage(page, 'no camera');
      await page.getByRole('link', { name: 'Distance mode' }).click();
      await page.getByText('No camera is connected').waitFor();
      assert.equal(await page.getByRole('button', { name: /Start/ }).count(), 0);
      await page.getByRole('link', { name: 'Back' }).click();
      await page.getByRole('link', { name: 'Join', exact: true }).click();
      await page.getByText('rigcal-server --listen 0.0.0.0', { exact: true }).waitFor();
      await page.getByText(/warns of its certificate once/).waitFor();
      assert.equal(await page.getByRole('button', { name: 'Make a join string' }).count(), 0);
      await checkPage(page, 'join on loopback');
    });
  });
}

test('a rigid target is typed in, and is no target of a goal', async () => {
  await visit(sizes[1], {}, async ({ server, address, page }) => {
    await page.goto(address);
    await page.getByRole('combobox', { name: 'Target', exact: true }).selectOption('rigid');
    await page.getByLabel(/Points: label/).fill('A 0 0 0 0.0002\nB 0.3 0');
    await page.getByText(/Line 2/).waitFor();
    await page.getByLabel(/Points: label/).fill('A 0 0 0 0.0002\nB 0.3 0 0\nC 0 0.2 0\nD 0 0 0.1');
    assert.ok(await page.getByLabel('Goal: stop below, mm').isDisabled());
    await checkPage(page, 'rigid target');
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    assert.equal(server.rig.session?.target?.points?.length, 4);
    assert.equal(server.rig.session?.goal, undefined);
  });
});

test('pictures of the cameras lie below their coverage, for who wants them', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    await page.goto(address);
    await page.locator('.tile .seen img').first().scrollIntoViewIfNeeded();
    await page.locator('.tile .seen img:not(.none)').first().waitFor();
    const frames = server.rig.cameras.filter((camera) => !camera.name.startsWith('event')).length;
    assert.equal(await page.locator('.tile .seen img').count(), frames, 'event cameras give none');
    await page.getByRole('button', { name: 'Pictures' }).click();
    assert.equal(await page.locator('.tile .seen img').count(), 0);
    await page.reload();
    await page.locator('.tile').first().waitFor();
    assert.equal(await page.locator('.tile .seen img').count(), 0, 'it stays chosen');
  });
});

test('3-D that is slow gives way to the plan, until a person asks for it', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    server.rig.advance(20);
    await page.goto(address);
    await page.getByText(/3-D is slow here/).waitFor();
    await page.locator('.plans canvas').first().waitFor();
    await page.getByRole('button', { name: '3-D' }).click();
    await page.locator('.scene canvas').waitFor();
    assert.equal(await page.getByText(/3-D is slow here/).count(), 0);
  }, () => {
    const real = WebGL2RenderingContext.prototype.readPixels;
    WebGL2RenderingContext.prototype.readPixels = function (this: WebGL2RenderingContext, ...rest: unknown[]) {
      for (const end = performance.now() + 450; performance.now() < end;);
      return (real as (...all: unknown[]) => void).apply(this, rest);
    } as typeof real;
  });
});

test('a screen of 3840 x 2160 is filled', async () => {
  await visit({ width: 3840, height: 2160 }, {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    server.rig.advance(20);
    await page.goto(address);
    await page.locator('.plans canvas').first().waitFor();
    const bottom = await page.locator('.wave').evaluate((wave) => wave.getBoundingClientRect().bottom);
    assert.ok(bottom > 2160 * 0.97 && bottom <= 2160, `the page ends at ${bottom}`);
  }, () => localStorage.setItem('rigcal', JSON.stringify({ scene: 'plan' })));
});

test('two people: who starts second is told', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    await page.goto(address);
    await page.getByRole('button', { name: 'Start capture' }).waitFor();
    // The page cannot know of the other one yet: its looks at the state are held back. It has one look under way at
    // a time, so once one is held, the answers of all before it have been shown.
    let letGo = (): void => {};
    const free = new Promise<void>((done) => { letGo = done; });
    await new Promise<void>((isHeld) => {
      void page.route('**/v1/live**', async (route) => {
        isHeld();
        await free;
        await route.continue();
      });
    });
    server.rig.create({ id: 's-other', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByText('session s-other captures').waitFor();
    letGo();
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    await page.unrouteAll({ behavior: 'ignoreErrors' });
  });
});

test('a session that was stopped by its target can be gone on with, calibrated or thrown away', async () => {
  await visit(sizes[1], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-000009', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] }, goal: { until_mm: 2 } });
    server.rig.start();
    server.rig.advance(60);
    assert.notEqual(server.rig.session?.stop_reason, undefined);
    await page.goto(address);
    await page.getByRole('button', { name: 'New capture' }).click();
    await page.getByLabel(/Go on with s-000009/).check();
    await page.getByLabel('Not before, s').fill('x');
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByText('The shortest time is a number of seconds').waitFor();
    await page.getByLabel('Not before, s').fill('12');
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByRole('button', { name: 'Stop capture' }).click();
    await page.getByRole('button', { name: 'Throw away' }).waitFor();
    assert.equal(server.rig.session?.continues, 's-000009');
    assert.deepEqual(server.rig.session?.target?.marker_positions_m, [0, 0.2], 'the target of the session gone on with');
    assert.equal(server.rig.session?.goal?.min_duration, '12s');
    const id = server.rig.session?.id;
    await page.getByRole('button', { name: 'Throw away' }).click();
    await page.getByText('Nothing of it is deleted.').waitFor();
    await page.getByRole('button', { name: 'Start capture' }).waitFor();
    assert.ok(server.rig.session?.discard_time);
    await checkPage(page, 'thrown away');
    await page.getByRole('button', { name: 'Take it back' }).click();
    await page.getByRole('button', { name: 'Resume' }).click();
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    assert.equal(server.rig.session?.continues, id);
    assert.deepEqual(server.rig.session?.target?.marker_positions_m, [0, 0.2]);
  });
});

test('without WebGL: from above and from the side', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    server.rig.advance(20);
    await page.goto(address);
    await page.getByText('This browser has no WebGL.').waitFor();
    await page.locator('.plans canvas').first().waitFor();
    // The canvas is there before it is drawn on.
    const drawn = (): Promise<boolean> => page.evaluate(() => {
      const canvas = document.querySelector<HTMLCanvasElement>('.plans canvas');
      return !!canvas && canvas.width > 0 && canvas.height > 0 &&
        canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 100);
    });
    for (let tries = 0; !await drawn(); ++tries) {
      assert.ok(tries < 200, 'nothing is drawn in 10 s');
      await page.waitForTimeout(50);
    }
    assert.equal(await page.evaluate(() => performance.getEntriesByType('resource').some((one) => one.name.includes('webgl'))), false,
      'what cannot be used is not loaded');
  }, () => {
    const real = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
      return kind.startsWith('webgl') ? null : (real as (...all: unknown[]) => unknown).call(this, kind, ...rest);
    } as typeof real;
  });
});

test('a login is asked for, a wrong token refused, the one of a link taken and removed from the address', async () => {
  await visit(sizes[1], { locked: true }, async ({ address, page }) => {
    await page.goto(address);
    await page.getByLabel('Join string or link').fill('wrong');
    await page.getByRole('button', { name: 'Log in' }).click();
    await page.getByText('this token is not known').waitFor();
    await checkPage(page, 'login');
    await page.goto(`${address}/login#token=rk1.letmein`);
    await page.getByRole('button', { name: 'Start capture' }).waitFor();
    assert.equal(page.url(), `${address}/#/wave`);
  });
});

test('by keyboard alone: skip link, pages, start', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    await page.goto(address);
    // Until the first answer there is no camera to start, and the key does not reach a button that is disabled.
    await page.getByRole('button', { name: 'Start capture', disabled: false }).waitFor();
    await page.keyboard.press('Tab');
    assert.equal(await page.evaluate(() => document.activeElement?.textContent), 'To the content');
    await page.keyboard.press('Enter');
    assert.equal(await page.evaluate(() => document.activeElement?.id), 'main');
    for (let i = 0; i < 30; ++i) {
      await page.keyboard.press('Tab');
      if (await page.evaluate(() => document.activeElement?.textContent === 'Start capture')) break;
    }
    assert.equal(await page.evaluate(() => document.activeElement?.textContent), 'Start capture');
    const outline = await page.evaluate(() => getComputedStyle(document.activeElement!).outlineStyle);
    assert.equal(outline, 'solid', 'the focus is visible');
    await page.keyboard.press('Enter');
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    assert.ok(server.rig.capturing);
  });
});

test('the light theme is as readable, and stays chosen', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] }, goal: { until_mm: 1 } });
    server.rig.start();
    server.rig.advance(14);
    await page.goto(address);
    await page.getByRole('button', { name: /Light/ }).click();
    for (const [hash, heading] of [['wave', 'Session'], ['result/c-000001', 'Cameras'], ['rig', 'Agents (3)'], ['records', 'Calibrations']] as const) {
      await page.goto(`${address}/#/${hash}`);
      await page.getByRole('heading', { name: heading, exact: true }).waitFor();
      await checkPage(page, `light ${hash}`);
    }
    await page.reload();
    assert.equal(await page.evaluate(() => document.documentElement.dataset['theme']), 'light');
  });
});
