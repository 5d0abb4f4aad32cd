// SPDX-License-Identifier: Apache-2.0
// Page Lens, on a desk and on a phone: from a board and a camera without a lens to its file.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

for (const size of sizes) {
  test(`${size.name}: a board is recorded, the page says what is missing, the lens is downloaded and used`, async () => {
    await visit(size, { cameras: 2 }, async ({ server, address, page }) => {
      const [with_lens, bare] = server.rig.cameras.map((camera) => camera.name) as [string, string];
      server.boardViews.set(bare, 3);
      await page.goto(`${address}/#/lens`);
      await page.getByLabel('Board', { exact: true }).fill('board:checker,8x5,0.03');
      await page.getByRole('button', { name: 'Start capture' }).click();
      await page.getByRole('button', { name: 'Stop capture' }).waitFor();
      assert.equal(server.rig.session?.target?.board, 'board:checker,8x5,0.03');

      // The camera without a lens comes first, and what it lacks is said.
      await page.getByRole('heading', { name: `Where the board has been: ${bare}` }).waitFor();
      await page.getByText('there are 3 views that differ').waitFor();
      await page.getByText('no corner in the lower fifth of the image').waitFor();
      await page.getByText('tilted by 40 degrees to the left').waitFor();
      assert.ok(await page.getByRole('button', { name: `Download ${bare}.yaml` }).isDisabled());
      assert.equal(await page.getByRole('heading', { name: 'How uncertain the lens is, px' }).count(), 0);
      await checkPage(page, 'lens, few views');

      server.boardViews.set(bare, 12);
      await page.getByText('pinhole5', { exact: true }).waitFor();
      await page.getByText('a lens that can be better').waitFor();
      await page.getByText('only 12 views were used: take 20 to 40').waitFor();
      await page.getByText(/With it the lens would be uncertain by 0\.11 px instead/).waitFor();
      await page.getByRole('img', { name: /12 views, in 60 % of the image; next: Near/ }).waitFor();
      await page.getByRole('img', { name: /uncertain by 0\.070? pixels in half of the image, 0\.19 in 95 %/ }).waitFor();
      await checkPage(page, 'lens');

      server.boardViews.set(bare, 24);
      await page.getByText('a good lens').waitFor();
      const waiting = page.waitForEvent('download');
      await page.getByRole('button', { name: `Download ${bare}.yaml` }).click();
      const download = await waiting;
      assert.equal(download.suggestedFilename(), `${bare}.yaml`);
      assert.ok(readFileSync(await download.path(), 'utf8').startsWith('%YAML:1.0'));

      await page.getByRole('button', { name: new RegExp(`^${with_lens}`) }).click();
      await page.getByText('This camera had a lens when it was recorded.').waitFor();

      await page.getByRole('button', { name: 'Stop capture' }).click();
      server.rig.advance(5);
      await page.getByRole('button', { name: 'Calibrate the rig with these lenses' }).click();
      await page.waitForURL(/#\/result\/c-000003/);
      const given = server.calibrations.get('c-000003')?.options?.given_intrinsics ?? [];
      assert.deepEqual(given.map((one) => one.camera), [bare]);
      assert.equal(given[0]?.intrinsics?.fx_px, 1101.25);
    });
  });
}

test('a refusal is shown, and another target that captures is not interrupted', async () => {
  await visit(sizes[0], { cameras: 2 }, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] } });
    server.rig.start();
    await page.goto(`${address}/#/lens`);
    await page.getByText('Session s-1 captures something else: stop it on page Wave first.').waitFor();
    assert.ok(await page.getByRole('button', { name: 'Start capture' }).isDisabled());
    await page.goto(`${address}/#/lens/s-none`);
    await page.getByText('there is no session "s-none"').waitFor();
    await page.goto(`${address}/#/lens/s-000001`);
    await page.getByText('its target is no board').waitFor();
    await checkPage(page, 'lens of a wand');
  });
});

test('a board is a target of page Wave, too, and the rig says where lenses are made', async () => {
  await visit(sizes[1], { cameras: 2 }, async ({ server, address, page }) => {
    await page.goto(address);
    await page.getByLabel('Target').selectOption('board');
    await page.getByLabel('Board: kind, counts, metres').fill('9x6');
    await page.getByText(/A board is written as on the command line/).waitFor();
    await page.getByLabel('Board: kind, counts, metres').fill('board:circles,4x11,0.02');
    await checkPage(page, 'wave, board');
    await page.getByRole('button', { name: 'Start capture' }).click();
    await page.getByRole('button', { name: 'Stop capture' }).waitFor();
    assert.deepEqual(server.rig.session?.target, { kind: 'KIND_RIGID', board: 'board:circles,4x11,0.02' });
  });
});
