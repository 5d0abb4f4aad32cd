// SPDX-License-Identifier: Apache-2.0
// The page /pattern: a blinking board that needs no login.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

for (const size of sizes) {
  test(`the board of the ${size.name}: its true size is kept, it blinks, and it stops`, async () => {
    await visit(size, { locked: true }, async ({ address, page }) => {
      await page.goto(`${address}/pattern`);
      await page.getByText(/as measured/).waitFor();
      await checkPage(page, 'pattern');
      await page.getByRole('slider').fill('5');
      const card = await page.locator('#card').boundingBox();
      assert.ok(card && Math.abs(card.height - 5 * 53.98) < 1);
      const text = await page.locator('#text').textContent();
      assert.match(text ?? '', /^board:circles,4x11,0\.\d+,0\.\d+$/);
      await page.reload();
      await page.getByText(/as measured/).waitFor();
      assert.equal(await page.getByRole('slider').inputValue(), '5');
      await page.getByRole('button', { name: 'Show full screen' }).click();
      const canvas = page.locator('#board');
      for (const shown of ['true', 'false', 'true']) await page.locator(`#board[data-shown=${shown}]`).waitFor();
      // White discs on black, and the text for --board below.
      await page.locator('#board[data-shown=true]').waitFor();
      const share = await canvas.evaluate((board: HTMLCanvasElement) => {
        const { data } = board.getContext('2d')!.getImageData(0, 0, board.width, board.height);
        let white = 0;
        for (let i = 0; i < data.length; i += 4) white += data[i]! > 200 ? 1 : 0;
        return white / (data.length / 4);
      });
      assert.ok(share === 0 || share > 0.05, `${share} of it is white`);
      assert.match(await page.locator('#told').textContent() ?? '', /^board:circles/);
      await page.keyboard.press('Escape');
      await page.getByRole('button', { name: 'Show full screen' }).waitFor();
    });
  });
}

test('after five minutes it ends and asks', async () => {
  await visit(sizes[0], {}, async ({ address, page }) => {
    await page.goto(`${address}/pattern`);
    await page.getByText(/as measured/).waitFor();
    await page.evaluate(() => {
      // Frames of a clock that is six minutes ahead from now on.
      const real = globalThis.requestAnimationFrame;
      globalThis.requestAnimationFrame = (call) => real((now) => call(now + 6 * 60_000));
    });
    await page.getByRole('button', { name: 'Show full screen' }).click();
    await page.getByText(/blinked for 5 minutes/).waitFor();
  });
});
