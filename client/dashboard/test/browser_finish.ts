// SPDX-License-Identifier: Apache-2.0
// A whole wave by clicks, on a desk and on a phone, to the file on the disk; no fault that axe-core
// calls serious.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

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
      await downloads.getByLabel(/off by at most/).selectOption('50');
      await downloads.getByRole('link', { name: 'Blender' }).waitFor();
      await downloads.getByLabel(/off by at most/).selectOption('0');
      await downloads.getByText('its cameras have no lens distortion').waitFor();
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
}
