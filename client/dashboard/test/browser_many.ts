// SPDX-License-Identifier: Apache-2.0
// A rig of 500 cameras on a desk's screen and on a phone: what needs something first, a map, a search.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fewCameras } from '../src/cameras/camera_needs';
import type { MockServer } from './mock_server';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

/** Cameras that see nothing, by index: more alerts than stand alone. */
const blind = [5, 77, 123, 300, 301, 302, 303, 304, 305, 306];

function wave(server: MockServer): string[] {
  server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] }, goal: { until_mm: 0.5 } });
  for (const i of blind) server.rig.cameras[i]!.blind = true;
  server.rig.start();
  server.rig.advance(16);
  return blind.map((i) => server.rig.cameras[i]!.name);
}

for (const size of sizes) {
  test(`500 cameras on a ${size.name}: what needs something is first, the rest is found`, async () => {
    await visit(size, { cameras: 500 }, async ({ server, address, page }) => {
      const names = wave(server);
      await page.goto(address);
      await page.getByText('488 good, 12 need something').waitFor();
      assert.equal(await page.locator('.tile').count(), 0);
      const listed = page.locator('.cameralist .name');
      assert.deepEqual((await listed.allTextContents()).slice(0, 10).sort(), [...names].sort());
      await page.getByText('10 cameras').waitFor();
      assert.ok(await page.locator('.alerts li').count() <= 3);
      // What counts beside the wand stays in the first screen.
      const digits = await page.locator('.big .digits').boundingBox();
      assert.ok(digits!.y + digits!.height < size.height / 2);
      await page.getByLabel('Find a camera').fill('frame_42');
      await page.waitForFunction(() => document.querySelectorAll('.cameralist li').length <= 12);
      assert.ok((await listed.allTextContents()).every((name) => name.includes('frame_42')));
      await page.locator('.cameralist button').first().click();
      await page.locator('.chosen .tile').waitFor();
      assert.equal(await page.locator('.chosen h3').textContent(), await listed.first().textContent());
      await page.getByLabel('Find a camera').fill('no such camera');
      await page.getByText('No camera has this').waitFor();
      await page.getByLabel('Find a camera').fill('');
      await checkPage(page, `500 cameras, ${size.name}`);
    });
  });

  test(`the map of 500 cameras on a ${size.name}: a tap names a camera, and beside all of them none`, async () => {
    await visit(size, { cameras: 500 }, async ({ server, address, page }) => {
      wave(server);
      await page.goto(address);
      const map = page.locator('.cameramap');
      await map.scrollIntoViewIfNeeded();
      await page.waitForTimeout(800);
      const box = (await map.boundingBox())!;
      // Somewhere in the ring of cameras; the exact places are those of plan tests.
      for (let i = 0; i < 24 && await page.locator('.chosen').count() === 0; ++i) {
        await map.click({ position: { x: box.width / 2 + (box.height / 60) * i, y: box.height / 2 } });
      }
      const name = await page.locator('.chosen h3').textContent();
      assert.ok(server.rig.cameras.some((camera) => camera.name === name), name ?? '');
      await map.click({ position: { x: 3, y: 3 } });
      await page.locator('.chosen').waitFor({ state: 'detached' });
    });
  });

  test(`the rig page of 500 cameras on a ${size.name} has a dozen cards and a search`, async () => {
    await visit(size, { cameras: 500 }, async ({ server, address, page }) => {
      const names = wave(server);
      await page.goto(`${address}/#/rig`);
      await page.getByText('488 good, 12 need something').waitFor();
      assert.equal(await page.locator('.cameracard').count(), 12);
      assert.ok(names.includes((await page.locator('.cameracard h3').first().textContent()) ?? ''));
      await page.getByText('has not seen the wand').first().waitFor();
      assert.equal(await page.locator('.panel.agents tbody tr').count(), fewCameras);
      await page.getByLabel('Find an agent').fill('pc-42');
      await page.waitForFunction(() => document.querySelectorAll('.panel.agents tbody tr').length === 1);
      await page.getByLabel('Find an agent').fill('');
      await page.getByRole('button', { name: /Show all \d+ agents/ }).click();
      await page.waitForFunction((few) => document.querySelectorAll('.panel.agents tbody tr').length > few, fewCameras);
      await page.getByLabel('Find a camera').fill('event_107');
      await page.waitForFunction(() => document.querySelectorAll('.cameracard').length === 1);
      await checkPage(page, `rig of 500 cameras, ${size.name}`);
    });
  });
}

for (const size of sizes) {
  test(`the result of 500 cameras on a ${size.name}: a screen of each, those with findings first, and one search for all`, async () => {
    await visit(size, { cameras: 500 }, async ({ server, address, page }) => {
      const id = [...server.calibrations.keys()].at(-1)!;
      const names = server.rig.cameras.map((camera) => camera.name);
      await page.goto(`${address}/#/result/${id}`);
      const rows = page.locator('.panel.percamera tbody tr');
      await rows.first().waitFor();
      assert.equal(await rows.count(), fewCameras);
      // The camera of the warning, that of the note, then the largest error.
      assert.deepEqual((await page.locator('.panel.percamera tbody th').allTextContents()).slice(0, 3), [names[3], names[0], names[499]]);
      const bars = page.locator('.panel.residuals .bars');
      assert.equal(await bars.count(), fewCameras);
      assert.equal(await bars.first().locator('.name').textContent(), names[3]);
      assert.equal(await page.locator('.panel.offsets .bars').count(), fewCameras);
      await page.locator('.panel.vectors .plot').first().waitFor();
      assert.equal(await page.locator('.panel.vectors .plot').count(), fewCameras);
      await page.locator('.panel.percamera').getByRole('button', { name: /Show more \(484 left\)/ }).click();
      assert.equal(await rows.count(), 5 * fewCameras);
      await page.getByLabel('Find a camera').fill(names[123]!);
      await page.waitForFunction(() => document.querySelectorAll('.panel.percamera tbody tr').length === 1);
      assert.equal(await bars.count(), 1);
      assert.equal(await page.locator('.panel.vectors h3').textContent(), names[123]);
      await page.getByLabel('Find a camera').fill('no such camera');
      await page.getByText('No camera has this').waitFor();
      await page.getByLabel('Find a camera').fill('');
      await checkPage(page, `result of 500 cameras, ${size.name}`);
    });
  });

  test(`a session of 500 cameras on a ${size.name}: those that have not ended or have no wand first, and a search`, async () => {
    await visit(size, { cameras: 500 }, async ({ server, address, page }) => {
      const names = server.rig.cameras.map((camera) => camera.name);
      const cameras = names.map((camera, i) => ({ description: { camera }, agent_id: `pc-${i}`, observation_count: '100',
        wand_count: blind.includes(i) ? '0' : '90', ended: i !== 200 }));
      Object.assign(server.sessions.get('s-000001')!, { cameras, missing_cameras: names.slice(0, 20) });
      await page.goto(`${address}/#/records/s-000001`);
      const rows = page.locator('.panel.detail tbody tr');
      await rows.first().waitFor();
      assert.equal(await rows.count(), fewCameras);
      const listed = page.locator('.panel.detail tbody th');
      assert.deepEqual((await listed.allTextContents()).slice(0, 11), [names[200], ...blind.map((i) => names[i])]);
      await page.getByText('500 cameras, 499 of them have ended, 490 have seen the wand').waitFor();
      await page.getByText('and 4 more').waitFor();
      await page.getByLabel('Find a camera or an agent').fill('pc-499');
      await page.waitForFunction(() => document.querySelectorAll('.panel.detail tbody tr').length === 1);
      assert.equal(await listed.textContent(), names[499]);
      await checkPage(page, `session of 500 cameras, ${size.name}`);
    });
  });
}

test('up to 16 cameras have their tiles as ever, 17 have the map', async () => {
  for (const [cameras, tiles, maps] of [[fewCameras, fewCameras, 0], [fewCameras + 1, 0, 1]] as const) {
    await visit(sizes[0], { cameras }, async ({ server, address, page }) => {
      server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
      server.rig.start();
      server.rig.advance(10);
      await page.goto(address);
      await page.locator(maps ? '.cameramap canvas' : '.tile').first().waitFor();
      assert.deepEqual([await page.locator('.tile').count(), await page.locator('.cameramap').count()], [tiles, maps]);
      assert.equal(await page.locator('.matrix').count(), 1);
    });
  }
});
