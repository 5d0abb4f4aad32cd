// SPDX-License-Identifier: Apache-2.0
// The image of a camera tile: coverage cells and the wand's trail.
import { toBytes } from '../api/json_values';
import type { LiveCamera } from '../api/types';
import { palette } from '../shell/palette';
import { coverageStep, coverageStepQuality, qualityRgb, rgbText } from '../view/colour_scale';

/** The pattern of a step, so that it can be told without colour: hatched, one dot, two dots, plain. */
export function drawCell(context: CanvasRenderingContext2D, step: 0 | 1 | 2 | 3, x: number, y: number, w: number,
  h: number, clear = false): void {
  const colour = qualityRgb(coverageStepQuality[step]);
  // On a picture they let it through.
  context.fillStyle = rgbText(colour, step === 0 ? (clear ? 0.05 : 0.16) : clear ? 0.34 : 0.42 + 0.12 * step);
  context.fillRect(x + 0.5, y + 0.5, w - 1, h - 1);
  if (step === 0 && clear) return;
  if (step === 0) {
    context.strokeStyle = rgbText(colour, 0.6);
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x + 0.25 * w, y + 0.75 * h);
    context.lineTo(x + 0.75 * w, y + 0.25 * h);
    context.stroke();
  } else if (step < 3) {
    context.fillStyle = 'rgb(0 0 0 / 0.6)';
    const radius = Math.max(0.8, Math.min(w, h) * 0.09);
    for (const dx of step === 1 ? [0] : [-0.18, 0.18]) {
      context.beginPath();
      context.arc(x + (0.5 + dx) * w, y + 0.5 * h, radius, 0, 7);
      context.fill();
    }
  }
}

/** Draws a camera into a box of the same shape as its image; `clear`: there is a picture below. */
export function drawTile(context: CanvasRenderingContext2D, camera: LiveCamera, width: number, height: number,
  dim: boolean, clear = false): void {
  const colours = palette();
  if (!clear) {
    context.fillStyle = colours.surface;
    context.fillRect(0, 0, width, height);
  }
  const imageWidth = camera.image_size_px?.width || 1;
  const imageHeight = camera.image_size_px?.height || 1;
  const scale = Math.min(width / imageWidth, height / imageHeight);
  const left = (width - imageWidth * scale) / 2;
  const top = (height - imageHeight * scale) / 2;
  context.globalAlpha = dim ? 0.3 : 1;
  const columns = camera.coverage?.columns ?? 0;
  const rows = camera.coverage?.rows ?? 0;
  const counts = toBytes(camera.coverage?.counts);
  if (columns * rows > 0 && columns * rows <= 4096) {
    const w = (imageWidth * scale) / columns;
    const h = (imageHeight * scale) / rows;
    for (let i = 0; i < columns * rows; ++i) {
      drawCell(context, coverageStep(counts[i] ?? 0), left + (i % columns) * w, top + Math.floor(i / columns) * h, w, h, clear);
    }
  }
  const at = (x: number | undefined, y: number | undefined): [number, number] =>
    [left + ((x ?? 0) + 0.5) * scale, top + ((y ?? 0) + 0.5) * scale];
  const trail = camera.trail ?? [];
  context.lineCap = 'round';
  for (const [i, point] of trail.entries()) {
    const newest = i + 1 === trail.length && (point.age_ms ?? 0) < 500;
    const fade = Math.max(0.1, 1 - (point.age_ms ?? 0) / 2000);
    const a = at(point.x0_px, point.y0_px);
    const b = at(point.x1_px, point.y1_px);
    const line = () => {
      context.beginPath();
      context.moveTo(...a);
      context.lineTo(...b);
      context.stroke();
    };
    if (newest) {
      context.strokeStyle = 'rgb(0 0 0 / 0.75)';
      context.lineWidth = 4.5;
      line();
    }
    context.strokeStyle = newest ? '#fff' : `rgb(255 255 255 / ${0.5 * fade})`;
    context.lineWidth = newest ? 2.2 : 1;
    line();
    if (!newest) continue;
    for (const end of [a, b]) {
      context.beginPath();
      context.arc(...end, 3.4, 0, 7);
      context.fillStyle = '#fff';
      context.fill();
      context.strokeStyle = 'rgb(0 0 0 / 0.8)';
      context.lineWidth = 1;
      context.stroke();
    }
  }
  context.globalAlpha = 1;
}
