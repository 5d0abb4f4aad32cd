// SPDX-License-Identifier: Apache-2.0
// The page /pattern: a board of circles that blinks, for event cameras and others. It asks the server
// for nothing, so it needs no login.
import { blinkChoices, cardMm, layoutBoard, refreshHz, wanderAt, type BoardLayout } from './board_layout';
import '../style/main.css';
import './pattern.css';

/** Then it asks: a picture that stays burns into screens. */
const mostShownMs = 5 * 60_000;
const measuredFrames = 90;
const storageKey = 'rigcal.screen';
/** CSS pixels; browsers take 96 to the inch, which fits few screens. */
const usualPxPerMm = 96 / 25.4;

function find<T extends Element>(id: string, kind: new () => T): T {
  const element = document.getElementById(id);
  if (!(element instanceof kind)) throw new Error(`the page has no ${id}`);
  return element;
}

const setup = find('setup', HTMLElement), stage = find('stage', HTMLElement);
const canvas = find('board', HTMLCanvasElement), card = find('card', HTMLElement);
const size = find('size', HTMLInputElement), rate = find('rate', HTMLSelectElement);
const start = find('start', HTMLButtonElement), measured = find('measured', HTMLElement);
const text = find('text', HTMLElement), told = find('told', HTMLElement), ended = find('ended', HTMLElement);

function storedPxPerMm(): number {
  try {
    const stored = Number(localStorage.getItem(storageKey));
    if (stored >= Number(size.min) && stored <= Number(size.max)) return stored;
  } catch {
    // A browser without storage.
  }
  return usualPxPerMm;
}

const pxPerMm = (): number => Number(size.value);
let hz = 0;
let layout: BoardLayout = layoutBoard(innerWidth, innerHeight, storedPxPerMm());
let frame = 0;      // of requestAnimationFrame; 0: not shown
let beganMs = 0, frames = 0;
let lock: { release(): Promise<void> } | null = null;

function showSize(): void {
  card.style.width = `${cardMm.width * pxPerMm()}px`;
  card.style.height = `${cardMm.height * pxPerMm()}px`;
  layout = layoutBoard(innerWidth, innerHeight, pxPerMm());
  text.textContent = told.textContent = layout.text;
}

function resize(): void {
  showSize();
  canvas.width = Math.round(innerWidth * devicePixelRatio);
  canvas.height = Math.round(innerHeight * devicePixelRatio);
}

function draw(now: number): void {
  const context = canvas.getContext('2d', { alpha: false });
  if (!context) return;
  const refreshes = Number(rate.value);
  const isShown = Math.floor(frames++ / refreshes) % 2 === 0;
  context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
  context.fillStyle = '#000';
  context.fillRect(0, 0, innerWidth, innerHeight);
  if (isShown) {
    const { x, y } = wanderAt(layout, (now - beganMs) / 1000);
    context.fillStyle = '#fff';
    context.beginPath();
    for (const centre of layout.centres) {
      context.moveTo(centre.x + x + layout.radiusPx, centre.y + y);
      context.arc(centre.x + x, centre.y + y, layout.radiusPx, 0, 2 * Math.PI);
    }
    context.fill();
  }
  canvas.dataset['shown'] = String(isShown);
}

function stop(why: string): void {
  cancelAnimationFrame(frame);
  frame = 0;
  stage.hidden = true;
  setup.hidden = false;
  ended.textContent = why;
  void lock?.release().catch(() => undefined);
  lock = null;
  if (document.fullscreenElement) void document.exitFullscreen().catch(() => undefined);
  start.focus();
}

function next(now: number): void {
  if (now - beganMs > mostShownMs) {
    stop('The board has blinked for 5 minutes. Show it again if you need it: what stays on a screen can burn in.');
    return;
  }
  draw(now);
  frame = requestAnimationFrame(next);
}

async function show(): Promise<void> {
  ended.textContent = '';
  setup.hidden = true;
  stage.hidden = false;
  // Phones that cannot do it show the page as it is.
  await document.documentElement.requestFullscreen?.({ navigationUI: 'hide' }).catch(() => undefined);
  const wake = (navigator as { wakeLock?: { request(kind: 'screen'): Promise<{ release(): Promise<void> }> } }).wakeLock;
  lock = await wake?.request('screen').catch(() => null) ?? null;
  resize();
  beganMs = performance.now();
  frames = 0;
  frame = requestAnimationFrame(next);
}

function offerRates(): void {
  const chosen = rate.value;
  rate.replaceChildren(...blinkChoices(hz).map((refreshes) => {
    const option = document.createElement('option');
    option.value = String(refreshes);
    option.textContent = `${(hz / (2 * refreshes)).toFixed(1)} a second (${refreshes} refreshes each)`;
    return option;
  }));
  if ([...rate.options].some((option) => option.value === chosen)) rate.value = chosen;
}

function measure(): void {
  const timesMs: number[] = [];
  const take = (now: number): void => {
    timesMs.push(now);
    if (timesMs.length <= measuredFrames) {
      requestAnimationFrame(take);
      return;
    }
    hz = refreshHz(timesMs);
    if (hz === 0) {
      measured.textContent = 'The refresh rate could not be measured; reload the page.';
      return;
    }
    measured.textContent = `This screen is drawn ${hz.toFixed(1)} times a second, as measured.`;
    offerRates();
    start.disabled = false;
  };
  requestAnimationFrame(take);
}

size.value = String(storedPxPerMm());
size.addEventListener('input', () => {
  showSize();
  try {
    localStorage.setItem(storageKey, size.value);
  } catch {
    // It is asked for again the next time.
  }
});
start.addEventListener('click', () => void show());
stage.addEventListener('click', () => stop(''));
addEventListener('keydown', (event) => { if (event.key === 'Escape' && frame !== 0) stop(''); });
document.addEventListener('fullscreenchange', () => { if (!document.fullscreenElement && frame !== 0) stop(''); });
document.addEventListener('visibilitychange', () => { if (document.hidden && frame !== 0) stop(''); });
addEventListener('resize', () => { if (frame === 0) showSize(); else resize(); });
showSize();
measure();
