// SPDX-License-Identifier: Apache-2.0
// One scale from bad to good for everything that is measured. It runs from vermilion over yellow to
// bluish green and becomes lighter all the way up to good, so that it can be read with any colour
// vision; numbers and patterns go with it.

/** sRGB, 0 to 255. */
export type Rgb = readonly [number, number, number];

const stops: readonly Rgb[] = [[158, 46, 28], [206, 92, 26], [222, 150, 44], [206, 182, 82], [146, 236, 208]];

/** The colour of a quality from 0 (bad) to 1 (good). Values outside are taken as the nearest end. */
export function qualityRgb(quality: number): Rgb {
  const place = Math.min(1, Math.max(0, Number.isFinite(quality) ? quality : 0)) * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(place));
  const [from, to] = [stops[i]!, stops[i + 1]!];
  const t = place - i;
  return [0, 1, 2].map((k) => Math.round(from[k]! + (to[k]! - from[k]!) * t)) as unknown as Rgb;
}

/** As CSS. */
export function rgbText([r, g, b]: Rgb, alpha = 1): string {
  return alpha >= 1 ? `rgb(${r} ${g} ${b})` : `rgb(${r} ${g} ${b} / ${alpha})`;
}

/** Relative luminance of a colour, 0 to 1 (WCAG). */
export function luminance([r, g, b]: Rgb): number {
  const linear = (value: number) => {
    const v = value / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  };
  return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
}

/** Black or white, whichever is read better on a colour. */
export function inkOn(rgb: Rgb): '#000' | '#fff' {
  return luminance(rgb) > 0.179 ? '#000' : '#fff';
}

/** Quality of a count towards a goal: 0 at none, 1 at the goal, growing as the square root. */
export function countQuality(value: number, goal: number): number {
  return goal <= 0 ? 0 : Math.min(1, Math.sqrt(Math.max(0, value) / goal));
}

/** What is wanted where no goal is set, millimetres. */
const usualWantedMm = 0.5;

/** The error in millimetres that colours are made for: the goal, else always the same, so that a colour means the
 * same on every page and at any time. */
export function wantedMm(goalMm: number | undefined): number {
  return goalMm && goalMm > 0 ? goalMm : usualWantedMm;
}

/** Quality of an error against what is wanted: 1 at half of it or below, 0 at four times or above. */
export function errorQuality(value: number, wanted: number): number {
  if (!(value > 0) || !(wanted > 0)) return 0;
  return Math.min(1, Math.max(0, (Math.log2(wanted / value) + 2) / 3));
}

/** Step of a coverage cell: 0 none, 1 few, 2 some, 3 enough. Each has a pattern of its own. */
export function coverageStep(centres: number): 0 | 1 | 2 | 3 {
  return centres === 0 ? 0 : centres < 5 ? 1 : centres < 20 ? 2 : 3;
}

/** Quality that a coverage cell is coloured with. */
export const coverageStepQuality = [0, 0.35, 0.7, 1] as const;

/** Common instants of two cameras: fewer than 50 are too few, 200 are good. */
export function overlapStep(instants: number): 0 | 1 | 2 | 3 {
  return instants === 0 ? 0 : instants < 50 ? 1 : instants < 200 ? 2 : 3;
}
