// SPDX-License-Identifier: Apache-2.0
// What a camera has seen of a board, and how uncertain its lens is, over the camera's image.
import type { Lens, LensMap } from '../api/types';
import type { Draw } from '../shell/canvas';
import { palette } from '../shell/palette';
import { errorQuality, inkOn, qualityRgb, rgbText } from '../view/colour_scale';
import { fixed } from '../view/format';

/** Uncertainty of a lens in 95 % of the image that is good, pixels: colours are made for it. */
export const wantedLensPx = 0.2;
/** Parts of the image for which a number is written. */
const shownColumns = 6;
const shownRows = 4;

/** Where an image is shown in a box. */
interface Place { left: number; top: number; scale: number; width: number; height: number }

function placeOf(lens: Lens, width: number, height: number): Place {
  const [imageWidth, imageHeight] = [lens.image_size_px?.width || 4, lens.image_size_px?.height || 3];
  const scale = Math.min(width / imageWidth, height / imageHeight);
  return { left: (width - imageWidth * scale) / 2, top: (height - imageHeight * scale) / 2, scale,
    width: imageWidth * scale, height: imageHeight * scale };
}

function frame(context: CanvasRenderingContext2D, place: Place, clear: boolean): void {
  const colours = palette();
  if (!clear) {
    context.fillStyle = colours.surface;
    context.fillRect(place.left, place.top, place.width, place.height);
  }
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  context.strokeRect(place.left + 0.5, place.top + 0.5, place.width - 1, place.height - 1);
}

/** A line that is seen on dark and on light. */
function outline(context: CanvasRenderingContext2D, points: readonly (readonly [number, number])[]): void {
  if (points.length < 2) return;
  for (const [colour, width] of [['rgb(0 0 0 / 0.8)', 5], ['#fff', 2.2]] as const) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = 'round';
    context.beginPath();
    points.forEach((point, i) => (i === 0 ? context.moveTo(...point) : context.lineTo(...point)));
    context.closePath();
    context.stroke();
  }
}

/** The corners of all views as dots, those of the newest one larger; the outline of the board in the next view.
 * `clear`: there is a picture below. */
export function drawViews(lens: Lens, clear: boolean): Draw {
  return (context, width, height) => {
    const colours = palette();
    const place = placeOf(lens, width, height);
    frame(context, place, clear);
    // The centre of the first pixel is (0, 0).
    const at = (x: number, y: number): [number, number] =>
      [place.left + (x + 0.5) * place.scale, place.top + (y + 0.5) * place.scale];
    const views = lens.views ?? [];
    const size = Math.max(1, Math.min(2.2, place.width / 260));
    views.forEach((view, i) => {
      const newest = i + 1 === views.length;
      context.fillStyle = view.left_out ? colours.bad : clear ? '#7cb8ff' : colours.accent;
      context.globalAlpha = newest ? 1 : view.left_out ? 0.5 : 0.65;
      const radius = newest ? 1.7 * size : size;
      (view.x_px ?? []).forEach((x, k) => {
        const [px, py] = at(x, view.y_px?.[k] ?? 0);
        context.beginPath();
        context.arc(px, py, radius, 0, 7);
        context.fill();
      });
    });
    context.globalAlpha = 1;
    const next = lens.next_pose;
    outline(context, (next?.outline_x_px ?? []).map((x, i) => at(x, next?.outline_y_px?.[i] ?? 0)));
  };
}

/** The largest value of each part of a map, row by row; undefined where the lens has no ray. */
export function largestOfParts(map: LensMap): (number | undefined)[] {
  const [columns, rows] = [map.columns ?? 0, map.rows ?? 0];
  const largest: (number | undefined)[] = new Array<number | undefined>(shownColumns * shownRows).fill(undefined);
  (map.values_px ?? []).forEach((text, i) => {
    // Not a number is the text "NaN".
    const value = Number(text);
    if (!Number.isFinite(value) || columns === 0 || rows === 0) return;
    const part = Math.floor((Math.floor(i / columns) * shownRows) / rows) * shownColumns +
      Math.floor(((i % columns) * shownColumns) / columns);
    largest[part] = Math.max(largest[part] ?? 0, value);
  });
  return largest;
}

/** Pixels with as many digits as a small field has room for. */
export function shortPx(value: number): string {
  return fixed(value, value < 0.0995 ? 3 : value < 9.95 ? 2 : value < 99.5 ? 1 : 0);
}

/** The uncertainty of the lens as coloured cells, with the largest number of each part. */
export function drawUncertainty(lens: Lens): Draw {
  return (context, width, height) => {
    const colours = palette();
    const place = placeOf(lens, width, height);
    frame(context, place, false);
    const map = lens.uncertainty;
    const [columns, rows] = [map?.columns ?? 0, map?.rows ?? 0];
    if (!map || columns * rows === 0 || columns * rows > 4096) return;
    const [w, h] = [place.width / columns, place.height / rows];
    for (let i = 0; i < columns * rows; ++i) {
      const value = Number(map.values_px?.[i] ?? NaN);
      const [x, y] = [place.left + (i % columns) * w, place.top + Math.floor(i / columns) * h];
      if (Number.isFinite(value)) {
        context.fillStyle = rgbText(qualityRgb(errorQuality(Math.max(value, 1e-6), wantedLensPx)));
        context.fillRect(x, y, w + 0.5, h + 0.5);
        continue;
      }
      context.strokeStyle = colours.faint;
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(x + 0.25 * w, y + 0.75 * h);
      context.lineTo(x + 0.75 * w, y + 0.25 * h);
      context.stroke();
    }
    const [partWidth, partHeight] = [place.width / shownColumns, place.height / shownRows];
    context.font = `${Math.round(Math.max(10, Math.min(15, partWidth / 4)))}px system-ui, sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    largestOfParts(map).forEach((value, i) => {
      if (value === undefined) return;
      context.fillStyle = inkOn(qualityRgb(errorQuality(Math.max(value, 1e-6), wantedLensPx)));
      context.fillText(shortPx(value), place.left + ((i % shownColumns) + 0.5) * partWidth,
        place.top + (Math.floor(i / shownColumns) + 0.5) * partHeight);
    });
  };
}
