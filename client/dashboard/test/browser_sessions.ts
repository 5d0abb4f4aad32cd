// SPDX-License-Identifier: Apache-2.0
// The rig, its detectors, targets and sessions, on a desk and on a phone.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { foundCameras } from './mock_server';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

for (const size of sizes) {
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

  test(`${size.name}: a found camera is used under a name, refused with another's, and dropped`, async () => {
    await visit(size, {}, async ({ server, address, page }) => {
      server.offered.push(...foundCameras());
      await page.goto(`${address}/#/rig`);
      const found = page.getByRole('region', { name: 'Found cameras (4, 1 not used)' });
      await found.getByText('found on pc-1: FLIR Blackfly 2345, 192.168.1.5').waitFor();
      await found.getByText('in use by a program at 192.168.1.9: end that program').waitFor();
      await found.getByText('sudo adduser $USER rigcal').waitFor();
      assert.equal(await found.getByRole('button', { name: /^Drop/ }).count(), 0, 'a configured camera is dropped in its file');
      await checkPage(page, 'found cameras');
      const use = found.getByRole('button', { name: 'Use FLIR Blackfly 2345' });
      assert.ok(await use.isDisabled(), 'without a name');
      const name = found.getByLabel('Name for FLIR Blackfly 2345');
      await name.fill('a/b');
      assert.ok(await use.isDisabled(), 'no name');
      await name.fill('frame_1');
      await use.click();
      await found.getByText("the name 'frame_1' is taken").waitFor();
      await name.fill('left');
      await found.getByLabel('Lens file of FLIR Blackfly 2345').setInputFiles({ name: 'left.yaml', mimeType: 'text/yaml', buffer: Buffer.from('%YAML:1.0') });
      await use.click();
      await page.getByRole('region', { name: 'Found cameras (4, 0 not used)' }).waitFor();
      assert.equal(server.lastLens, '%YAML:1.0');
      await page.getByRole('button', { name: 'Drop left' }).click();
      await page.getByRole('region', { name: 'Found cameras (4, 1 not used)' }).waitFor();
      assert.equal(server.offered[0]!.use, 'USE_FREE');
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

  test(`${size.name}: without a camera there is nothing to start, and a server for its own PC says what to start`, async () => {
    await visit(size, { cameras: 0, local: true }, async ({ address, page }) => {
      await page.goto(address);
      await page.getByText('No camera is connected').first().waitFor();
      await page.getByText('rigcal-agent').first().waitFor();
      assert.equal(await page.getByRole('button', { name: /Start/ }).count(), 0);
      await checkPage(page, 'no camera');
      await page.getByRole('link', { name: 'Distance mode' }).click();
      await page.getByText('No camera is connected').first().waitFor();
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
    await page.getByText('The session has finished').waitFor();
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
