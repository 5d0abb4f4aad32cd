// SPDX-License-Identifier: Apache-2.0
// Where the discs of a board of circles are on a screen. Lengths in CSS pixels and millimetres.

/** Circles in a row, and rows: only so has the board no twin that is turned by half. */
export const columns = 4;
export const rows = 11;
/** ISO/IEC 7810, ID-1: every bank card. */
export const cardMm = { width: 85.6, height: 53.98 } as const;
/** Of a circle's diameter over the distance of the nearest two, as printed boards have it. */
const circleShare = 0.55;
/** From the outermost centres to the border, in spacings. */
const marginSpacings = 1.4;
/** How far the board wanders to each side, in spacings: no pixel shows the same for long. */
const wanderSpacings = 0.3;
const wanderS = 47;
/** The board's text below it. */
const textPx = 28;

/** The board on one screen. */
export interface BoardLayout {
  spacingMm: number;
  diameterMm: number;
  /** Centres in the order of the board, without wandering. */
  centres: { x: number; y: number }[];
  radiusPx: number;
  /** How far the board wanders to each side. */
  wanderPx: number;
  /** For --board, metres. */
  text: string;
}

/** Metres of a length in hundredths of millimetres, without zeros at the end. */
const metres = (mm: number): string => (mm / 1000).toFixed(5).replace(/0+$/, '');

/** The largest board for a screen of this size; upright, or with its rows from left to right. */
export function layoutBoard(widthPx: number, heightPx: number, pxPerMm: number): BoardLayout {
  const isWide = widthPx > heightPx;
  const high = heightPx - textPx;
  const along = rows - 1 + 2 * marginSpacings;
  const across = 2 * columns - 1 + 2 * marginSpacings;
  const mostPx = isWide ? Math.min(widthPx / along, high / across) : Math.min(widthPx / across, high / along);
  const spacingMm = Math.max(1, Math.floor(mostPx / pxPerMm * 10) / 10);
  const diameterMm = Math.round(circleShare * Math.SQRT2 * spacingMm * 100) / 100;
  const spacing = spacingMm * pxPerMm;
  const centres: { x: number; y: number }[] = [];
  for (let row = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      // From the board's middle.
      const x = (2 * column + row % 2 - (2 * columns - 1) / 2) * spacing, y = (row - (rows - 1) / 2) * spacing;
      // A turn, no mirror image.
      centres.push(isWide ? { x: widthPx / 2 + y, y: high / 2 - x } : { x: widthPx / 2 + x, y: high / 2 + y });
    }
  }
  return { spacingMm, diameterMm, centres, radiusPx: diameterMm / 2 * pxPerMm, wanderPx: wanderSpacings * spacing,
    text: `board:circles,${columns}x${rows},${metres(spacingMm)},${metres(diameterMm)}` };
}

/** How far the board is from its place, some seconds after it began. */
export function wanderAt(layout: BoardLayout, seconds: number): { x: number; y: number } {
  const turn = 2 * Math.PI * seconds / wanderS;
  return { x: layout.wanderPx * Math.sin(turn), y: layout.wanderPx * Math.sin(1.618 * turn) };
}

/** From the times of animation frames, ms: how often the screen is drawn anew. 0: too few. */
export function refreshHz(timesMs: readonly number[]): number {
  const gaps = timesMs.slice(1).map((time, i) => time - (timesMs[i] ?? 0)).filter((gap) => gap > 1).sort((a, b) => a - b);
  const middle = gaps[Math.floor(gaps.length / 2)];
  if (gaps.length < 10 || middle === undefined) return 0;
  // The times are rounded; the mean of those near the middle one is not.
  const near = gaps.filter((gap) => Math.abs(gap - middle) < 0.2 * middle);
  return 1000 * near.length / near.reduce((sum, gap) => sum + gap, 0);
}

/** Numbers of refreshes for which the board can be shown, then hidden: 2 to 15 blinks a second, the first
 * one near 5. Shown for 1 s at most, whatever the screen. */
export function blinkChoices(hz: number): number[] {
  const choices = [5, 2, 3, 7.5, 10, 15].map((blinkHz) => Math.max(2, Math.round(hz / (2 * blinkHz))));
  return [...new Set(choices)].filter((refreshes) => refreshes / hz <= 1);
}
