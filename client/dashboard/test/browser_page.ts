// SPDX-License-Identifier: Apache-2.0
// The page itself: without its server, without WebGL, by keyboard, on large screens and in the light.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { checkPage, sizes } from './page_checks';
import { visit } from './visit';

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

test('leads to the documentation where the server has it', async () => {
  for (const docs of [true, false]) {
    await visit(sizes[0], { docs }, async ({ address, page }) => {
      const asked = page.waitForResponse((response) => response.url().endsWith('/docs.json'));
      await page.goto(address);
      await (await asked).finished();
      await page.getByText('connected').waitFor();
      const link = page.getByRole('link', { name: 'Docs' });
      if (docs) await link.waitFor();
      assert.equal(await link.count(), docs ? 1 : 0);
      if (docs) assert.equal(await link.getAttribute('href'), '/docs/');
    });
  }
});

test('the light theme is as readable, and stays chosen', async () => {
  await visit(sizes[0], {}, async ({ server, address, page }) => {
    server.rig.create({ id: 's-1', target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.2] }, goal: { until_mm: 1 } });
    server.rig.start();
    server.rig.advance(14);
    await page.goto(address);
    await page.getByRole('button', { name: /Light/ }).click();
    for (const [hash, heading] of [['wave', 'Session'], ['result/c-000001', 'Cameras'], ['rig', 'Agents (3)'], ['lens', 'Session'], ['records', 'Calibrations']] as const) {
      await page.goto(`${address}/#/${hash}`);
      await page.getByRole('heading', { name: heading, exact: true }).waitFor();
      await checkPage(page, `light ${hash}`);
    }
    await page.reload();
    assert.equal(await page.evaluate(() => document.documentElement.dataset['theme']), 'light');
  });
});
